"""Events on rigid walls one by one, for whoever integrates the motion between them."""

from typing import NamedTuple

import numpy as np

from reference_solver.contact import types
from reference_solver.equations import Equations
from reference_solver.kernel import Kernel, Topology
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.rigid.bouncing import Bouncing, followers, logged_impacts
from reference_solver.rigid.loop import bounce_by_error
from reference_solver.solver import contact_record
from reference_solver.tape import FloatArray


class Rebound(NamedTuple):
    """{q'} after an event (n,), what its pins did, the drivers' work in J, and who follows from then on."""

    v: FloatArray
    impacts: list[types.Impact]
    driver_work_J: float
    following: tuple[int, ...]


class Rebounds:
    """The rigid walls of a mechanism, from the coordinates ``q_start`` (n,) on.

    Pins bounce until a flight would be no higher than ``lowest`` times the distance's round-off.
    """

    def __init__(self, mechanism: Mechanism, q_start: FloatArray, lowest: float) -> None:
        equations, topology = Equations(mechanism, q_start), Topology(mechanism, projected=True)
        sums = [*equations.power_names, "removed"]
        self._kernel = Kernel(topology, q_start)
        self._bouncing = Bouncing(equations, sums, self._kernel["walls"].address, self._kernel.p, 0.0, lowest)
        contacts = np.array([contact_record(joint) for joint in mechanism.contacts], types.CONTACT_RECORD)
        sizes = len(q_start), len(sums), len(equations.C)
        self._run = types.new_run(topology.method, contacts, sizes, np.zeros(1), 1)
        self._kernel.bind(self._run)

    def __call__(self, t: float, q: FloatArray, v: FloatArray) -> Rebound:
        """Have the pins hit that fly and touch their walls at q and v, each (n,).

        Raises:
            SolverError: there is no way on (see ``Bouncing.refuse``).
        """
        run, s = self._run, self._bouncing.settling
        run.old.q[:], run.old.v[:], run.old.sums[:] = q, v, 0.0
        run.contacts["phase"], run.clock["time"], run.clock["rigid"] = types.FLIGHT, t, -1
        s.control["alone"] = 1
        if bounce_by_error(*types.plain((run, s))) == types.REFUSED:
            self._bouncing.refuse(run)
        work, following = float(run.old.sums[0]), followers(run.contacts, s)
        return Rebound(run.old.v.copy(), logged_impacts(s), work, following)

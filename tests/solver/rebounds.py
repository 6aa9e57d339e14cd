"""Events on rigid walls one by one, for whoever integrates the motion between them."""

from typing import NamedTuple

import numpy as np

from reference_solver.equations import Equations
from reference_solver.impacts import Impacts
from reference_solver.kernel import Kernel, Topology
from reference_solver.mechanism.contacts import FLIGHT
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Impact, new_run
from reference_solver.tape import FloatArray


class Rebound(NamedTuple):
    """{q'} after an event (n,), what its pins did, the drivers' work in J, and who follows from then on."""

    v: FloatArray
    impacts: list[Impact]
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
        self._impacts = Impacts(equations, sums, self._kernel["walls"], self._kernel.p)
        sizes = len(q_start), len(equations.C)
        self._run = new_run(topology.method, mechanism.contacts, sums, sizes, np.zeros(1))
        self._run.state["lowest"] = lowest

    def __call__(self, t: float, q: FloatArray, v: FloatArray) -> Rebound:
        """Have the pins hit that fly and touch their walls at q and v, each (n,).

        Raises:
            SolverError: there is no way on (see ``Impacts.resolve``).
        """
        run, impacts = self._run, self._impacts
        run.q[:], run.v[:], run.sums[:] = q, v, 0.0
        run.contacts["phase"], run.state["time"], run.state["wall"] = FLIGHT, t, -1
        impacts.impacts.clear()
        impacts.resolve(run)
        return Rebound(run.v.copy(), [*impacts.impacts], float(run.sums[0]), impacts.following)

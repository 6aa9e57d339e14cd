"""The mechanism in one set of modes: some pins follow their walls, each with a row of [B], the others fly.

Two faces of one algorithm, as everywhere: the readable equations, and a kernel compiled for the set.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from reference_solver import rigid_loop
from reference_solver.errors import NonFiniteState
from reference_solver.mechanism import Mechanism
from reference_solver.readable import step as readable_step
from reference_solver.rigid_friction import FollowingEquations, held
from reference_solver.rigid_joint import JointGeometry, RigidJoint

FloatArray = NDArray[np.float64]


class Mode:
    """The mechanism with n coordinates, m ideal rows, and one more row for each joint in ``following``.

    ``q_start`` (n,) are the coordinates that {g} is measured from. Positions and velocities are projected
    after every step. Sums over steps are (1 + 2J,): the drivers' work, then of every joint the impulse of its
    normal force while it follows, then the work it loses in friction.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        joints: tuple[RigidJoint, ...],
        following: tuple[int, ...],
        q_start: FloatArray,
        compiled: bool,
    ) -> None:
        self.following = following
        holding = held(mechanism, joints, following)
        self.equations = FollowingEquations(holding, joints, following, q_start)
        self._geometry = JointGeometry(mechanism, joints)
        self._follows = np.isin(np.arange(len(joints)), following)
        self._parameters, self._room = np.empty(0), np.empty(len(self.equations.C))
        self._until_alarm = partial(
            rigid_loop.until_alarm, self._readable_step, self._readable_gaps, self._readable_multipliers
        )
        self._step, self._gaps = self._readable_step, self._readable_gaps
        if compiled:
            from reference_solver.kernel import Topology
            from reference_solver.kernel_store import load_kernel  # Numba takes a moment to import
            from reference_solver.rigid_source import rigid_source_of

            topology = Topology(holding, None, True, joints, following)
            kernel = load_kernel(rigid_source_of(topology.marked()))
            self._parameters = topology.parameters(kernel, q_start)
            self._step, self._gaps, self._until_alarm = kernel.step, kernel.gaps, kernel.until_alarm

    def until_alarm(
        self,
        q: FloatArray,
        v: FloatArray,
        t: float,
        h: float,
        count: int,
        tolerance: FloatArray,
        sums: FloatArray,
    ) -> tuple[int, bool]:
        """Take up to ``count`` steps of h from t in place, and stop before one that may hold an event.

        ``tolerance`` (J, 2) is the round-off of g in m^2 and of its rate. The steps add to ``sums``. Returns
        the steps taken, and whether the next step may hold an event.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            PainleveParadox: friction leaves a pin no mobility along its normal.
            FrictionTooStiff: the step is too long for the damping by friction.
            NonFiniteState: the state overflows.
        """
        done, stopped = self._until_alarm(
            self._parameters, q, v, float(t), float(h), count, self._follows, tolerance, self._room, sums
        )
        if stopped == 2:  # the readable step tells why
            self._readable_step(self._parameters, t + done * h, h, q.copy(), v.copy(), np.zeros_like(sums))
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise NonFiniteState(t + done * h, h)
        return done, bool(stopped)

    def step(
        self, q: FloatArray, v: FloatArray, t: float, h: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return q, v and the sums of one step of length h from t."""
        new_q, new_v, sums = q.copy(), v.copy(), np.zeros(1 + 2 * len(self._follows))
        if h == 0:
            return new_q, new_v, sums
        held = self._step(self._parameters, float(t), float(h), new_q, new_v, sums)
        if held and np.isfinite(new_q).all() and np.isfinite(new_v).all():
            return new_q, new_v, sums
        new_q, new_v, sums = q.copy(), v.copy(), np.zeros_like(sums)
        self._readable_step(self._parameters, t, h, new_q, new_v, sums)
        return new_q, new_v, sums

    def gaps(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return (J, 2): g = (d.d - c^2)/2 in m^2, positive past the wall, and its rate d.d'."""
        out = np.empty((len(self._follows), 2))
        self._gaps(self._parameters, q, v, out)
        return out

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda}: of the m ideal rows, then of the joints that follow, in N/m."""
        return self.equations.accelerations(t, q, v)[1]

    def _readable_step(
        self, _: FloatArray, t: float, h: float, q: FloatArray, v: FloatArray, sums: FloatArray
    ) -> bool:
        """Take one step in place, and add its sums, as the kernels do."""
        with np.errstate(over="ignore", invalid="ignore"):
            new = readable_step(self.equations, t, q, v, h, projected=True)
        q[:], v[:] = new[:2]
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise NonFiniteState(t + h, h)
        sums += list(new[2].values())
        return True

    def _readable_gaps(self, _: FloatArray, q: FloatArray, v: FloatArray, out: FloatArray) -> None:
        out[:] = self._geometry.gaps(q, v)

    def _readable_multipliers(
        self, _: FloatArray, t: float, q: FloatArray, v: FloatArray, out: FloatArray
    ) -> bool:
        out[:] = self.multipliers(t, q, v)
        return True

"""The mechanism in one set of modes: some pins follow their walls, each with a row of [B], the others fly.

Two faces of one algorithm, as everywhere: the readable equations, and a kernel compiled for the set.
"""

import inspect
import re
from functools import partial

import numpy as np
from numpy.typing import NDArray

from reference_solver import rigid_loop
from reference_solver.equations import Equations
from reference_solver.errors import NonFiniteState
from reference_solver.generator import EquationsWriter
from reference_solver.kernel_source import function, kernel_source
from reference_solver.mechanism import Mechanism
from reference_solver.readable import project, rk4_step
from reference_solver.rigid_joint import JointGeometry, RigidJoint
from reference_solver.straight_line import StraightLine

FloatArray = NDArray[np.float64]


class Mode:
    """The mechanism with n coordinates, m ideal rows, and one more row for each joint in ``following``.

    ``q_start`` (n,) are the coordinates that {g} is measured from. Positions and velocities are projected
    after every step.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        joints: tuple[RigidJoint, ...],
        following: tuple[int, ...],
        q_start: FloatArray,
        compiled: bool,
    ) -> None:
        links = tuple(joints[k].link() for k in following)
        held = Mechanism(
            mechanism.bodies, (*mechanism.constraints, *links), mechanism.loads, mechanism.gravity_m_s2
        )
        self.following = following
        self.equations = Equations(held, q_start)
        self._geometry = JointGeometry(mechanism, joints)
        self._follows = np.isin(np.arange(len(joints)), following)
        self._parameters, self._room = np.empty(0), np.empty(len(self.equations.C))
        self._until_alarm = partial(
            rigid_loop.until_alarm, self._readable_advance, self._readable_gaps, self._readable_multipliers
        )
        self._advance = self._readable_advance
        if compiled:
            from reference_solver.compiled import load_kernel  # Numba takes a moment to import

            writer = EquationsWriter(held, q_start)
            kernel = load_kernel(rigid_kernel_source(writer, joints))
            self._parameters = np.array(writer.parameters)
            self._advance, self._until_alarm = kernel.advance, kernel.until_alarm

    def until_alarm(
        self, q: FloatArray, v: FloatArray, t: float, h: float, count: int, tolerance: FloatArray
    ) -> tuple[int, float, bool]:
        """Take up to ``count`` steps of h from t in place, and stop before one that may hold an event.

        ``tolerance`` (J, 2) is the round-off of g in m^2 and of its rate. Returns the steps taken, the
        drivers' work, and whether the next step may hold an event.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
        """
        done, work, stopped = self._until_alarm(
            self._parameters, q, v, float(t), float(h), count, self._follows, tolerance, self._room
        )
        if stopped == 2:
            self._readable_step(t + done * h, q.copy(), v.copy(), h)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise NonFiniteState(t + done * h, h)
        return done, work, bool(stopped)

    def step(self, q: FloatArray, v: FloatArray, t: float, h: float) -> tuple[FloatArray, FloatArray, float]:
        """Return q, v and the drivers' work after one step of length h from t."""
        q, v = q.copy(), v.copy()
        if h == 0:
            return q, v, 0.0
        taken, work = self._advance(self._parameters, q, v, float(h), t / h, 1)
        if not taken or not (np.isfinite(q).all() and np.isfinite(v).all()):
            return self._readable_step(t, q, v, h)
        return q, v, work

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda}: of the m ideal rows, then of the joints that follow, in N/m."""
        return self.equations.accelerations(t, q, v)[1]

    def _readable_step(
        self, t: float, q: FloatArray, v: FloatArray, h: float
    ) -> tuple[FloatArray, FloatArray, float]:
        with np.errstate(over="ignore", invalid="ignore"):
            q, v, work = rk4_step(self.equations, t, q, v, h)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise NonFiniteState(t + h, h)
        if len(self.equations.C):
            q, v = project(self.equations, t + h, q, v)
        return q, v, work

    def _readable_advance(
        self, _: FloatArray, q: FloatArray, v: FloatArray, h: float, first: float, count: int
    ) -> tuple[int, float]:
        """Take one step in place, as the kernels do; ``first`` is t/h."""
        q[:], v[:], work = self._readable_step(first * h, q, v, h)
        return count, work

    def _readable_gaps(self, _: FloatArray, q: FloatArray, v: FloatArray, out: FloatArray) -> None:
        out[:] = self._geometry.gaps(q, v)

    def _readable_multipliers(
        self, _: FloatArray, t: float, q: FloatArray, v: FloatArray, out: FloatArray
    ) -> bool:
        out[:] = self.multipliers(t, q, v)
        return True


def rigid_kernel_source(writer: EquationsWriter, joints: tuple[RigidJoint, ...]) -> str:
    """Return a module with ``advance`` of ``kernel_source`` and ``until_alarm`` of ``rigid_loop``.

    ``writer.parameters`` is complete afterwards.
    """
    source = kernel_source(writer, None, True)
    code = StraightLine()
    out = []
    for k, joint in enumerate(joints):
        ends = ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j))
        _, (x, y), (rate_x, rate_y) = writer.between(code, f"n{k}", ends)
        square = writer.parameter(f"clearance {k}", joint.radial_clearance_m**2)
        out.append(f"out[{k}, 0] = 0.5*({x}*{x} + {y}*{y} - {square})")
        out.append(f"out[{k}, 1] = {x}*({rate_x}) + {y}*({rate_y})")
    unpack = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]
    gaps = function("gaps", ["p", "q", "v", "out"], [*unpack, *code.lines, *out], ["True"])
    text = inspect.getsource(rigid_loop)
    text = text[text.index("\n\n\ndef ") :]
    text = re.sub(r"^    (advance|gaps|multipliers): Function,\n", "", text, flags=re.MULTILINE)
    text = text.replace("\ndef ", "\n@njit(**OPTIONS)\ndef ")
    annotations = "from __future__ import annotations\n\nimport numpy as np\n"
    return f"{annotations}{source}\n\n{gaps}\n{text}"

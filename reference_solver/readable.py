"""Steps (11)-(13) and the projection by the readable ``equations``: slow, the text to read."""

import numpy as np
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.errors import NonFiniteState
from reference_solver.methods import RK4, increments, quadrature, stages

FloatArray = NDArray[np.float64]


def step(
    equations: Equations, t: float, q: FloatArray, v: FloatArray, h: float, projected: bool
) -> tuple[FloatArray, FloatArray, dict[str, float], float]:
    """Return q, v, the integrals of all powers by name, and the energy that a stabilisation has removed.

    Baumgarte's is its power at the start of the step times h: within a step the stages violate the
    constraints by more than the solution does.

    Raises:
        SolverError: the equations have no answer at a stage.
    """
    found = stages(RK4, lambda t, q, v: equations.required(t, q, v, h), t, q, v, h)
    change_q, change_v = increments(RK4, h, found)
    powers = [stage.answer.powers for stage in found]
    sums = {name: float(quadrature(RK4, h, [power[name] for power in powers])) for name in powers[0]}
    q, v, removed = q + change_q, v + change_v, h * float(found[0].answer.removed_W)
    if projected:
        q, v, removed = project(equations, t + h, q, v)
    return q, v, sums, removed


def project(
    equations: Equations, t: float, q: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the state moved onto the constraints, first q, then q', and the energy in J this has removed.

    Raises:
        SingularConfiguration: the constraint matrix has not full row rank.
    """
    q, removed_q, ok = equations.project_q(t, q)
    v, removed_v, still_ok = equations.project_v(t, q, v)
    if not (ok and still_ok) and np.isfinite(q).all():
        equations.refuse_singular(t, q)
    return q, v, float(removed_q + removed_v)


class ReadableStepper:
    """Takes steps of size h from t = 0 with the readable equations.

    ``stabilisation_loss_J`` is the energy that the projections, or Baumgarte's feedback, have removed in all
    steps so far.
    """

    def __init__(self, equations: Equations, h: float, projected: bool) -> None:
        self._equations, self._h, self._projected = equations, h, projected
        self.stabilisation_loss_J = 0.0

    def advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> float:
        """Take steps number first to first + count - 1 in place; return the drivers' work.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
        """
        work = 0.0
        for number in range(first, first + count):
            t = number * self._h
            with np.errstate(over="ignore", invalid="ignore"):
                q[:], v[:], sums, removed = step(self._equations, t, q, v, self._h, self._projected)
            if not (np.isfinite(q).all() and np.isfinite(v).all()):
                raise NonFiniteState(t + self._h, self._h)
            work += sums["drivers"]
            self.stabilisation_loss_J += removed
        return work

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} (m,) at a state."""
        return self._equations.accelerations(t, q, v)[1]

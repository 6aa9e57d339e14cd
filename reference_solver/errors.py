"""How the solver fails: each error says when and why."""

import numpy as np
from numpy.typing import NDArray


class SolverError(Exception):
    """Base of the solver's errors."""


class SingularConfiguration(SolverError):
    """[B] has lost full row rank: redundant constraints, or a configuration such as a locked dead centre."""

    def __init__(self, rank: int, rows: int, time_s: float, q: NDArray[np.float64]) -> None:
        self.rank, self.rows, self.time_s, self.q = rank, rows, time_s, q
        super().__init__(
            f"the constraint matrix has rank {rank} of {rows} rows at t = {time_s:.6g} s, "
            f"q = {np.array2string(q, precision=4, max_line_width=10**6)}: remove redundant constraints "
            "or stop before the singular configuration"
        )


class NonFiniteState(SolverError):
    """The state has overflowed or become NaN; the step is None where it is not known."""

    def __init__(self, time_s: float, step_s: float | None = None) -> None:
        self.time_s = time_s
        step = "" if step_s is None else f" with step {step_s:.3g} s"
        super().__init__(f"non-finite state at t = {time_s:.6g} s{step}: shorten the step")


class InconsistentStart(SolverError):
    """The initial positions or velocities violate the constraints."""


class EventLost(SolverError):
    """The search for an event within a step has found none."""

    def __init__(self, time_s: float, step_s: float, joint: int, reason: str) -> None:
        self.time_s = time_s
        super().__init__(
            f"event of rigid joint {joint} within the step of {step_s:.3g} s at t = {time_s:.6g} s not found "
            f"({reason}): shorten the step"
        )


class Stalled(SolverError):
    """Steps have become too short to move time on."""

    def __init__(self, time_s: float, steps: int) -> None:
        self.time_s = time_s
        super().__init__(f"{steps} steps made no way at t = {time_s:.6g} s: soften the contact law")

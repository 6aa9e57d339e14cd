"""The compiled face for large mechanisms: the block kernel behind the interface of a stepper."""

import numpy as np
from numpy.typing import NDArray

from reference_solver import block_kernel
from reference_solver.arrays import row_slices
from reference_solver.block_plan import make_plan
from reference_solver.chunks import advance_in_chunks
from reference_solver.equations import Baumgarte, Equations
from reference_solver.mechanism import Mechanism
from reference_solver.readable import ReadableStepper

FloatArray = NDArray[np.float64]


class BlockStepper:
    """Takes steps of size h from t = 0 with the block kernel; its cost grows linearly with a chain."""

    def __init__(
        self,
        mechanism: Mechanism,
        q_start: FloatArray,
        h: float,
        baumgarte: Baumgarte | None,
        projected: bool,
    ) -> None:
        self._plan, self._h, self._projected = make_plan(mechanism, q_start, baumgarte), h, projected
        self._size = row_slices(mechanism)[-1].stop if mechanism.constraints else 0
        self._removed = 0.0
        self._readable = ReadableStepper(Equations(mechanism, q_start, baumgarte), h, projected)
        # Compiled or loaded here, so that what follows runs at full speed.
        q, v = q_start.copy(), np.zeros_like(q_start)
        self._advance(q, v, 0, 0)
        block_kernel.multipliers(self._plan, 0.0, q, v)

    def _advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> tuple[int, float]:
        arguments = (self._plan, q, v, self._h, first, count, self._projected)
        done, work, removed = block_kernel.advance(*arguments)
        self._removed += removed
        return done, work

    @property
    def stabilisation_loss_J(self) -> float:
        """Energy that the stabilisation has removed in all steps so far."""
        return self._removed + self._readable.stabilisation_loss_J

    def advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> float:
        """Take steps number first to first + count - 1 in place; return the drivers' work.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
        """
        return advance_in_chunks(self._advance, self._readable, q, v, self._h, first, count)

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} (m,) at a state."""
        if not block_kernel.multipliers(self._plan, t, q, v):
            return self._readable.multipliers(t, q, v)
        rows, out = self._plan.rows, np.empty(self._size + 1)
        out[rows["row"] + 1] = rows["z_y"]  # a driver's dummy, where the next row follows, is overwritten
        out[rows["row"]] = rows["z_x"]
        return out[:-1]

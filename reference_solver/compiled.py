"""The compiled face of the algorithm: the kernel written for a topology, compiled by Numba."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from reference_solver.chunks import advance_in_chunks
from reference_solver.equations import Baumgarte, Equations
from reference_solver.kernel import Topology, ideal_source
from reference_solver.kernel_store import load_kernel
from reference_solver.mechanism import Mechanism
from reference_solver.readable import ReadableStepper

FloatArray = NDArray[np.float64]

ideal_source_of = cache(ideal_source)


class CompiledStepper:
    """Takes steps of size h from t = 0 with the kernel of the mechanism's topology."""

    def __init__(
        self,
        mechanism: Mechanism,
        q_start: FloatArray,
        h: float,
        baumgarte: Baumgarte | None,
        projected: bool,
    ) -> None:
        topology = Topology(mechanism, baumgarte, projected)
        self._kernel = load_kernel(ideal_source_of(topology.marked()))
        self._parameters = topology.parameters(self._kernel, q_start)
        equations = Equations(mechanism, q_start, baumgarte)
        self._rows, self._h, self._removed = len(equations.C), h, 0.0
        self._readable = ReadableStepper(equations, h, projected)
        # Compiled or loaded here, so that what follows runs at full speed.
        q, v = q_start.copy(), np.zeros_like(q_start)
        self._advance(q, v, 0, 0)
        self._kernel.multipliers(self._parameters, 0.0, q, v, np.empty(self._rows))

    def _advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> tuple[int, float]:
        done, work, removed = self._kernel.advance(self._parameters, q, v, self._h, first, count)
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
        out = np.empty(self._rows)
        if not self._kernel.multipliers(self._parameters, t, q, v, out):
            return self._readable.multipliers(t, q, v)
        return out

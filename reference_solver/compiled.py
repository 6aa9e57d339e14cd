"""The compiled face of the algorithm: the kernel written for a topology, compiled by Numba, kept on disk."""

import hashlib
import importlib.util
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import platformdirs
from numpy.typing import NDArray

from reference_solver.chunks import advance_in_chunks
from reference_solver.equations import Baumgarte, Equations
from reference_solver.kernel import Topology, ideal_source
from reference_solver.mechanism import Mechanism
from reference_solver.readable import ReadableStepper

FloatArray = NDArray[np.float64]


def kernel_folder() -> Path:
    """Return where kernels and their machine code are kept: ``CRANKSLIDER_CACHE`` or the user's cache."""
    return Path(os.environ.get("CRANKSLIDER_CACHE") or platformdirs.user_cache_dir("crankslider")) / "kernels"


@cache
def load_kernel(source: str) -> ModuleType:
    """Return the generated module; it must be a real file for Numba to keep its machine code."""
    name = f"kernel_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    path = kernel_folder() / f"{name}.py"
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".new", delete=False) as file:
                file.write(source)
            os.replace(file.name, path)
    except OSError:  # a read-only home: compile anew in every process
        path = Path(tempfile.mkdtemp(prefix="crankslider-")) / f"{name}.py"
        path.write_text(source)
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # where Numba looks its functions up when it loads their machine code
    specification.loader.exec_module(module)
    return module


@contextmanager
def compiled_anew() -> Iterator[None]:
    """Have kernels compiled as on a machine that has none, in a folder that is gone afterwards.

    Numba itself has been set to work before that, which takes a second the first time.
    """
    kept = os.environ.get("CRANKSLIDER_CACHE")
    with tempfile.TemporaryDirectory(prefix="crankslider-") as folder:
        os.environ["CRANKSLIDER_CACHE"] = folder
        load_kernel.cache_clear()
        load_kernel("from numba import njit\n\nready = njit(lambda x: x + 1.0)\n").ready(1.0)
        try:
            yield
        finally:
            load_kernel.cache_clear()
            if kept is None:
                del os.environ["CRANKSLIDER_CACHE"]
            else:
                os.environ["CRANKSLIDER_CACHE"] = kept


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

"""Where machine code is kept, for whoever has any: the folder, its files, and what compiling takes."""

import time
from typing import ClassVar

from engine_models.engine import Engine, RunSettings
from engine_models.scene.parts import AnyScene
from reference_solver.compiled.checked_files import made_once, read_checked, write_checked
from reference_solver.compiled.folder import FolderRefused, KernelsRefused, writable_folder
from reference_solver.compiled.store import callback, compiled, compiled_anew, njit

__all__ = [
    "CompiledEngine",
    "FolderRefused",
    "KernelsRefused",
    "callback",
    "compiled",
    "made_once",
    "njit",
    "read_checked",
    "writable_folder",
    "write_checked",
]


class CompiledEngine(Engine):
    """An engine that runs kernels of this folder."""

    compiles: ClassVar[bool] = True

    def compile_time_s(self, scene: AnyScene, settings: RunSettings) -> float:
        """Return how much longer a run takes without kernels than with them, in s.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        with compiled_anew():
            without, again = (self._elapsed_s(scene, settings) for _ in range(2))
        return without - again

    def _elapsed_s(self, scene: AnyScene, settings: RunSettings) -> float:
        started = time.perf_counter()
        self.simulate(scene, settings)
        return time.perf_counter() - started

"""Where machine code is kept, for whoever has any: the folder, its files, and what compiling takes."""

import multiprocessing
import time
from typing import ClassVar

import numba

from engine_models.engine import Engine, RunSettings
from engine_models.scene.scene import Scene
from reference_solver.kept_files import (
    FolderRefused,
    read_kept,
    temporary_folder,
    writable_folder,
    write_kept,
)
from reference_solver.machine_code import compiled

__all__ = ["CompiledEngine", "FolderRefused", "compiled", "read_kept", "writable_folder", "write_kept"]


class CompiledEngine(Engine):
    """An engine that runs machine code of this folder."""

    compiles: ClassVar[bool] = True

    def compile_time_s(self, scene: Scene, settings: RunSettings) -> float:
        """Return how much longer a run takes without machine code than with it, in s, in its own process.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        with temporary_folder():
            context = multiprocessing.get_context("spawn")
            with context.Pool(1) as pool:
                without, again = (pool.apply(_elapsed_s, (self, scene, settings)) for _ in range(2))
        return float(without - again)


def _elapsed_s(engine: Engine, scene: Scene, settings: RunSettings) -> float:
    numba.njit(lambda x: x + 1.0)(1.0)  # Numba itself is set to work, which takes a second the first time
    started = time.perf_counter()
    engine.simulate(scene, settings)
    return time.perf_counter() - started

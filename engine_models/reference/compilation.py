"""What compiling kernels takes, measured where there are none."""

import time

from engine_models.engine import Engine, RunSettings
from engine_models.scene.scene import Scene
from reference_solver.compiled.store import compiled_anew


def compile_time_s(engine: Engine, scene: Scene, settings: RunSettings) -> float:
    """Return how much longer a run takes without kernels than with them, in s.

    Raises:
        UnsupportedScene, SimulationFailed: as ``simulate`` does.
    """
    with compiled_anew():
        without, again = (_elapsed_s(engine, scene, settings) for _ in range(2))
    return without - again


def _elapsed_s(engine: Engine, scene: Scene, settings: RunSettings) -> float:
    started = time.perf_counter()
    engine.simulate(scene, settings)
    return time.perf_counter() - started

"""Runs kept on disk by all that decides them, so that a converged solution is computed once.

They are beside the kernels, checked in the same way, and as private: what is read there is unpickled.
"""

import hashlib
import pickle
import platform
from functools import cache

from llvmlite.binding import get_host_cpu_name

from engine_models.engine import Engine, RunSettings, Trajectory
from engine_models.reference.kernels import read_checked, write_checked
from engine_models.scene.scene import Scene
from studies.running.provenance import fingerprint


def kept_run(engine: Engine, scene: Scene, settings: RunSettings) -> Trajectory:
    """Return an engine's run, made now or before by the same code on the same kind of processor.

    Its ``solve_time_s`` is that of the run that was made.

    Raises:
        UnsupportedScene, SimulationFailed: as ``simulate`` does; a failure is not kept.
        FolderRefused: others could have written what would be read.
    """
    what = (*_machine(), type(engine).__qualname__, engine, scene.model_dump_json(), settings)
    name = f"run-{hashlib.sha256(repr(what).encode()).hexdigest()[:32]}.pickle"
    found = read_checked(name)
    if found is not None:
        kept: Trajectory = pickle.loads(found)
        return kept
    run = engine.simulate(scene, settings)
    write_checked(name, pickle.dumps(run))
    return run


@cache
def _machine() -> tuple[str, str, str]:
    return fingerprint(), platform.machine(), get_host_cpu_name()

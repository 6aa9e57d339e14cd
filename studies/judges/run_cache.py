"""Runs kept on disk by all that decides them, so that a converged solution is computed once.

They are beside the kernels, checked in the same way, and as private: what is read there is unpickled.
"""

import hashlib
import pickle
import platform
from collections.abc import Callable
from typing import Protocol, TypeVar

from llvmlite.binding import get_host_cpu_name

from engine_models.engine import RunSettings, Trajectory
from engine_models.scene.scene import Scene
from reference_solver.kept_files import read_kept, write_kept
from studies.case import project_code, versions

Kept = TypeVar("Kept")
#: The folders whose files decide a run.
CODE = ("reference_solver", "engine_models", "studies/judges")


class Solver(Protocol):
    """A frozen dataclass of settings that can run scenes: an engine, or the independent solver."""

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene; raise UnsupportedScene or SimulationFailed rather than return nonsense."""
        ...


def kept_run(engine: Solver, scene: Scene, settings: RunSettings) -> Trajectory:
    """Return an engine's run, made now or before by the engine's same code on the same kind of processor.

    Its ``solve_time_s`` is that of the run that was made.

    Raises:
        UnsupportedScene, SimulationFailed: as ``simulate`` does; a failure is not kept.
        FolderRefused: others could have written what would be read.
    """
    made_by = type(engine).__module__
    return kept(made_by, engine, scene, settings, lambda: engine.simulate(scene, settings))


def kept(made_by: str, engine: Solver, scene: Scene, settings: RunSettings, make: Callable[[], Kept]) -> Kept:
    """Return what a module makes of an engine's run of a scene, now or before by the same code."""
    kind = type(engine)
    code = made_by, project_code(CODE), versions(), kind.__module__, kind.__qualname__
    run = engine, scene.to_toml(), settings
    text = repr((*code, *run, platform.machine(), get_host_cpu_name()))
    name = f"run-{hashlib.sha256(text.encode()).hexdigest()[:32]}.pickle"
    if (content := read_kept(name)) is not None:
        found: Kept = pickle.loads(content)
        return found
    made = make()
    write_kept(name, pickle.dumps(made))
    return made

"""From a user's input to a run, for the command line and the library."""

import numpy as np

from engine_models.convergence.doubts import doubts
from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import (
    Engine,
    ImpossibleStart,
    RunSettings,
    SimulationFailed,
    UnsupportedScene,
    plain,
)
from engine_models.kernels import FolderRefused
from engine_models.memory import TooLarge
from engine_models.reference.inspection import inspect
from engine_models.scene.parts import AnyScene
from studies.command.finished_run import Run
from studies.command.options import SimulateOptions, longest_step_s
from studies.failures import BadInput, Failed


def simulated(scene: AnyScene, engine_name: str, engine: Engine, options: SimulateOptions) -> Run:
    """Run a scene with an engine at the step, or to the tolerance, asked for.

    Raises:
        BadInput: the engine cannot run the scene, or not with this step or number of samples.
        Failed: the simulation failed, or the check after the run rejects it.
    """
    longest_step = longest_step_s(options, scene.end_time_s, engine)
    try:
        if not engine.any_mechanism:
            plain(scene, engine_name)
        with np.errstate(all="ignore"):  # engines check for non-finite numbers themselves
            if options.tolerance is not None:
                run = simulate_to_tolerance(engine, scene, options.tolerance, options.samples)
            else:
                run = engine.simulate(scene, RunSettings(longest_step, options.samples))
            warnings = doubts(engine, scene, run, options.tolerance is not None)
    except TooLarge as reason:
        raise BadInput(f"--{reason}") from None
    except UnsupportedScene as reason:
        raise BadInput(f"--engine: expected one that can run this scene, got '{reason}'") from None
    except FolderRefused as reason:
        raise BadInput(str(reason)) from None
    except SimulationFailed as reason:
        raise Failed(str(reason)) from None
    return Run(scene, engine_name, engine, options.tolerance, run, tuple(warnings))


def checked_mechanism(scene: AnyScene) -> list[str]:
    """Return lines on a scene's mechanism and its start, and on its nearest singular position.

    Raises:
        BadInput: there is no such start, or the joints' rows depend on each other.
        Failed: the run failed.
    """
    try:
        return inspect(scene)
    except ImpossibleStart as reason:
        raise BadInput(str(reason)) from None
    except SimulationFailed as reason:
        raise Failed(str(reason)) from None

"""Planar crank-sliders with joint clearance, simulated from Python.

    import crankslider as cs

    run = cs.simulate("clearance-driven-0.5mm", end=0.012, tolerance=1e-8)
    run.frame["slider_position_m"]      # pandas, over time_s
    run.plot_orbit("B")

Bad input raises ``BadInput``, with the message of the command line.
"""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from pkgutil import extend_path
from tempfile import mkdtemp
from types import MappingProxyType
from typing import TYPE_CHECKING
from warnings import warn

if TYPE_CHECKING:
    from studies.command.comparison import Comparison
    from studies.command.sweep import Swept
    from studies.command.truth import TrueRun

PACKAGES = ("reference_solver", "engine_models", "studies", "reports")


@contextmanager
def _home_first() -> Iterator[None]:
    """Import this project's packages from beside this file, also if the user's folder has the same names.

    Other modules in the user's folder can be imported before and after.

    Raises:
        ImportError: a module of the user has the full name of one of this project.
    """
    home = Path(__file__).resolve().parent
    for name, module in list(sys.modules.items()):
        place, ours = getattr(module, "__file__", None), home.joinpath(*name.split("."))
        is_ours = name.partition(".")[0] in PACKAGES and (ours.is_dir() or ours.with_suffix(".py").exists())
        if "." in name and place and is_ours and home not in Path(place).resolve().parents:
            raise ImportError(
                f"{name}: expected crankslider's own, got {place}: import crankslider before it"
            )
    sys.path.insert(0, str(home))
    try:
        for name in PACKAGES:
            package, folder = import_module(name), str(home / name)
            found = extend_path(list(getattr(package, "__path__", [])), name)
            package.__path__ = [folder, *(other for other in found if other != folder)]
        yield
    finally:
        sys.path.remove(str(home))


with _home_first():
    from engine_models.scene import file
    from engine_models.scene.arguments import Place, check_arguments
    from engine_models.scene.data import Duration, Positive
    from engine_models.scene.general import GeneralScene
    from engine_models.scene.library import SCENES
    from engine_models.scene.scene import Scene
    from studies.command.finished_run import Run
    from studies.command.options import (
        Samples,
        SimulateOptions,
        SomeScene,
        as_arguments,
        read_engine,
        read_scene,
    )
    from studies.failures import BadInput, Failed

__all__ = [
    "BadInput",
    "Failed",
    "GeneralScene",
    "Run",
    "Scene",
    "compare",
    "load",
    "scenes",
    "simulate",
    "sweep",
    "truth",
]
__version__ = version("crankslider")

#: The scenes of the library by name.
scenes: Mapping[str, Scene] = MappingProxyType({name: make() for name, make in SCENES.items()})


@check_arguments
def simulate(
    scene: SomeScene,
    engine: str = "reference",
    *,
    step: Positive | None = None,
    tolerance: Positive | None = None,
    end: Duration | None = None,
    samples: Samples = 200,
    settings: Mapping[str, object] | None = None,
    **more_settings: object,
) -> Run:
    """Return the run of a scene: a ``Scene``, the name of a library scene, or the path of a TOML file.

    ``step`` in s is the longest time step; the default is 1e-5, unless the engine chooses its steps. With a
    ``tolerance`` in m the run is refined until the slider position is accurate to it. ``end`` in s replaces
    the end time of the scene. ``samples`` is the number of output intervals of equal length. Settings of the
    engine are given by name, in a mapping or as further arguments. Doubts about the run are warnings.

    Raises:
        BadInput: an argument or the scene is refused, or the engine cannot run the scene.
        Failed: the simulation failed; the message says when and why.
    """
    from studies.command.simulation import simulated  # loads the compiler, which takes a second

    with as_arguments():
        options = SimulateOptions(step, tolerance, end, samples)
        physics = read_scene(scene, end_s=options.end)
        chosen = read_engine(engine, {**(settings or {}), **more_settings}, tolerance is not None)
        run = simulated(physics, engine, chosen, options)
    for doubt in run.warnings:
        warn(doubt, stacklevel=3)
    return run


@check_arguments
def truth(scene: SomeScene, *, end: Duration | None = None, samples: Samples = 120) -> "TrueRun":
    """Return the reference solution of a scene, for the validation of other solvers.

    It is independent of all engines. Its samples end at the predictability horizon, where two solutions
    diverge. ``certain_m`` is the uncertainty of the slider position, or of what else the scene observes, up
    to there, in m: of an angle times the longest lever.

    Raises:
        BadInput: an argument or the scene is refused.
        Failed: no solution was found.
    """
    from studies.command.truth import true_run

    with as_arguments():
        options = SimulateOptions(end=end, samples=samples)
        run = true_run(read_scene(scene, end_s=options.end), options)
    for doubt in run.warnings:
        warn(doubt, stacklevel=3)
    return run


@check_arguments
def compare(scene: SomeScene, engines: Sequence[str] = (), folder: Place | None = None) -> "Comparison":
    """Compare engines on a scene and return rows, a recommendation, and a page that can be saved.

    ``engines`` are the names of engines; empty means all. Runs are saved in ``folder`` (default:
    ``comparison/NAME``), from which a second call continues. They take one to a few minutes in processes of
    their own. In a script, call this function under ``if __name__ == "__main__":``.

    Raises:
        BadInput: an argument or the scene is refused, it has no reference solution, or no engine can run it.
        Failed: the reference solution was not found, or no engine finished.
    """
    from studies.command.comparison import comparison, default_folder
    from studies.command.study_run import joined, running_in

    with as_arguments(engine="engines", out="folder"):
        joined(engines)
        physics = read_scene(scene)
        place = default_folder(physics) if folder is None else Path(folder)
        with running_in(place):
            return comparison(physics, str(getattr(scene, "name", scene)), engines, place)


@check_arguments
def sweep(
    scene: SomeScene,
    vary: Mapping[str, str | Sequence[float]] | None = None,
    engine: str = "reference",
    *,
    out: Place | None = None,
    scheduler: str | None = None,
    settings: Mapping[str, object] | None = None,
    **options: object,
) -> "Swept":
    """Run a scene with many values of its fields and return the rows, one per member.

    ``vary`` maps the path of a field to a range as text, or to its values. ``options`` are those of the
    command line, by name (see ``studies.command.sweep.SweepOptions``). The rows are written to ``out``, a
    .parquet or .csv file (default: one in a temporary folder); an interrupted sweep resumes from the folder
    ``out``.rows. In a script, call this function under ``if __name__ == "__main__":``. How many members have
    warnings is a warning.

    Raises:
        BadInput: an argument is refused.
        Failed: the members cannot continue.
    """
    from studies.command.options import checked, ending_of
    from studies.command.sweep import TABLES, SweepOptions, read_sweep, run_sweep

    with as_arguments():
        chosen = checked(SweepOptions, "--", {"jobs": os.cpu_count() or 1, **options})
        wanted = read_sweep(read_scene(scene), vary or {}, engine, settings or {}, chosen)
        place = Path(mkdtemp(prefix="crankslider-")) / "sweep.parquet" if out is None else Path(out)
        ending_of("--out", place, TABLES)
        swept = run_sweep(wanted, place, chosen.jobs, scheduler)
    if swept.warning is not None:
        warn(swept.warning, stacklevel=3)
    return swept


@check_arguments
def load(path: Place) -> Scene | GeneralScene:
    """Return the scene in a TOML file.

    Raises:
        BadInput: there is no valid scene; the message names the file, the line and the field.
    """
    return file.load(Path(path))

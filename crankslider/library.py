"""The functions of the library: each checks its arguments once, and the commands call no others."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from tempfile import mkdtemp
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal
from warnings import warn

import numpy as np
from pydantic import Field, InstanceOf, TypeAdapter, ValidationError

from crankslider.run import ROWS, Comparison, Run, Sweep, TrueRun, ending_of
from engine_models.engine import (
    MOST_SAMPLES,
    Engine,
    RunSettings,
    SimulationFailed,
    UnsupportedScene,
)
from engine_models.engines import engine_class, join
from engine_models.scene.arguments import Metres, Place, Seconds, check_arguments, in_words
from engine_models.scene.file import load as load_scene
from engine_models.scene.format import NonNegative, Positive
from engine_models.scene.library import ALL_SCENES
from engine_models.scene.plain_words import (
    expect,
    fields,
    one_of,
    refusal,
    setting,
    shown,
    unknown,
)
from engine_models.scene.scene import Scene
from studies.failures import BadInput, Failed, writing
from studies.whole_file import require_folder, require_place

if TYPE_CHECKING:
    from studies.conform import Verdict

__version__ = version("crankslider")

#: The scenes of the library by name.
scenes: Mapping[str, Scene] = MappingProxyType({name: make() for name, make in ALL_SCENES.items()})

#: A scene as users may give one, and what else they type.
SomeScene = Annotated[InstanceOf[Scene] | str | Path, expect(f"{one_of(list(ALL_SCENES))}, or a TOML file")]
Samples = Annotated[int, Field(ge=1, le=MOST_SAMPLES), in_words()]
Jobs = Annotated[int, Field(ge=1, le=1000), in_words()]
Values = Annotated[str | Sequence[float], expect("a string or a list of numbers")]
#: What runs in all engines, in reference solutions and in studies.
DEFAULT_STEP_S = 1e-5
#: A step below this part of the end time is lost to the rounding of time.
SHORTEST_STEP_PART = 1e-12


@check_arguments
def load(path: Place) -> Scene:
    """Return the scene in a TOML file.

    Raises:
        BadInput: there is no valid scene; the message names the file, the line and the field.
    """
    return load_scene(Path(path))


@check_arguments
def read_scene(
    scene: SomeScene, changes: Mapping[str, object] | None = None, end: Seconds | None = None
) -> Scene:
    """Return a library scene by its name, the scene in a TOML file, or a scene itself, with changes.

    ``changes`` are values of fields by their paths, ``end`` is another end time in s. A scene is checked
    once, after all changes.

    Raises:
        BadInput: there is no such scene, or it is refused.
    """
    changes = {**(changes or {}), **({} if end is None else {"end_time_s": end})}
    if not isinstance(scene, str | Path):
        own = scene
    elif (name := str(scene)) in ALL_SCENES:
        own = scenes[name]
    elif os.path.exists(name):  # pathlib's raises for a name that is too long
        return load_scene(Path(name), changes, "with")
    elif "/" in name or name.endswith(".toml"):
        raise BadInput(f"scene: expected a TOML file that is there, got {shown(name)} (no such file)")
    else:
        raise BadInput(unknown("scene", name, scenes, f"{one_of([*scenes])}, or a TOML file"))
    return own.replace(changes) if changes else own


def read_engine(name: str, settings: Mapping[str, object], to_tolerance: bool = False) -> Engine:
    """Return the engine of this name with the settings given, values or text, the rest at their defaults.

    For a tolerance, an engine that can control its error does so, unless ``method`` is among the settings. If
    ``step_tolerance`` is among them, it starts with that.

    Raises:
        BadInput: the engine or a setting is unknown, or a value is refused.
    """
    try:
        kind = engine_class(name)
    except ValueError as reason:
        raise BadInput(str(reason)) from None
    try:
        engine: Engine = TypeAdapter(kind).validate_strings(
            {key: setting(it) for key, it in settings.items()}
        )
    except ValidationError as error:
        raise BadInput(refusal(error, settings, fields(kind))) from None
    if to_tolerance and "method" not in settings:
        given = {"step_tolerance": vars(engine)["step_tolerance"]} if "step_tolerance" in settings else {}
        engine = engine.controlling_error(**given)
    return engine


@check_arguments
def simulate(
    scene: SomeScene,
    engine: str = "reference",
    *,
    step: Seconds | None = None,
    tolerance: Metres | None = None,
    end: Seconds | None = None,
    samples: Samples = 200,
    start: Annotated[NonNegative, Field(json_schema_extra={"unit": "s"}), in_words("s")] = 0.0,
    settings: Mapping[str, object] | None = None,
    quick: bool = False,
) -> Run:
    """Return the run of a scene: a ``Scene``, the name of a library scene, or the path of a TOML file.

    ``step`` in s is the longest time step; the default is 1e-5, unless the engine chooses its steps. With a
    ``tolerance`` in m the run is refined until the slider position is accurate to it. ``end`` in s replaces
    the end time of the scene. ``samples`` is the number of output intervals of equal length. Before ``start``
    in s the run is a transient: the largest contact force is that after it. ``settings`` are the engine's.
    Times and lengths may be text with a unit.

    Doubts about the run are warnings. One without a tolerance is checked by another one at half the step and
    a tenth of the engine's own tolerance, which takes up to twice its time; ``quick`` leaves that out.

    Raises:
        BadInput: an argument or the scene is refused, or the engine cannot run the scene.
        Failed: the simulation failed; the message says when and why.
    """
    from engine_models.convergence.doubts import doubts  # loads the compiler, which takes a second
    from engine_models.convergence.step_halving import simulate_to_tolerance
    from reference_solver.kept_files import FolderRefused

    physics = read_scene(scene, end=end)
    chosen = read_engine(engine, settings or {}, tolerance is not None)
    if not start < physics.end_time_s:
        raise BadInput(f"start: expected a time < the end time {physics.end_time_s:g}, got {start:g}")
    longest = _longest_step_s(step, tolerance, physics.end_time_s, chosen)
    try:
        with np.errstate(all="ignore"):  # engines check for non-finite numbers themselves
            steps = RunSettings(longest, samples)
            if tolerance is None:
                run = chosen.simulate(physics, steps)
            else:
                run = simulate_to_tolerance(chosen, physics, tolerance, samples)
            check = steps if tolerance is None and not quick else None
            warnings = tuple(doubts(chosen, physics, run, check))
    except (UnsupportedScene, FolderRefused) as reason:
        raise _refused(reason) from None
    except SimulationFailed as reason:
        raise Failed(str(reason)) from None
    for doubt in warnings:
        warn(doubt, stacklevel=3)
    return Run(physics, engine, chosen, run, warnings, tolerance, start, bool(check or tolerance))


def _longest_step_s(step: float | None, tolerance: float | None, end_s: float, engine: Engine) -> float:
    """Return the step asked for, or the default: the whole run for an engine that controls its error."""
    if step is not None and tolerance is not None:
        raise BadInput(f"tolerance: expected nothing beside step, got {tolerance:g}")
    longest = step or (end_s if engine.controls_error else min(DEFAULT_STEP_S, end_s))
    shortest = SHORTEST_STEP_PART * end_s
    if tolerance is None and not shortest <= longest <= end_s:
        expected = f"a number from {shortest:g} to the end time {end_s:g}"
        raise BadInput(f"step: expected {expected}, got {longest:g}{'' if step else ', the default'}")
    return longest


def _refused(reason: Exception) -> BadInput:
    """Return the refusal of an engine, unless it names the argument itself."""
    text = str(reason)
    if text.startswith(("samples: ", "step: ", "environment ", "start: ")):
        return BadInput(text)
    return BadInput(f"engine: expected one that can run this scene, got '{text}'")


@check_arguments
def truth(scene: SomeScene, *, end: Seconds | None = None, samples: Samples = 120) -> TrueRun:
    """Return the reference solution of a scene, for the validation of other solvers.

    It is independent of all engines. Its samples end at the predictability horizon, where two solutions
    diverge. ``certain_m`` is the uncertainty of the slider position, or of what else the scene observes, up
    to there, in m: of an angle times the longest lever.

    Raises:
        BadInput: an argument or the scene is refused.
        Failed: no solution was found.
    """
    from crankslider.reference_solutions import reference_solution

    run = reference_solution(read_scene(scene, end=end), samples)
    for doubt in run.warnings:
        warn(doubt, stacklevel=3)
    return run


@check_arguments
def compare(
    scene: SomeScene,
    engines: Sequence[str] = (),
    out: Place | None = None,
    *,
    error: Annotated[Positive, in_words()] | None = None,
    signal: str | None = None,
    given: str | None = None,
) -> Comparison:
    """Compare engines on a scene and return rows, a recommendation, and a page that can be saved.

    ``engines`` are the names of engines; empty means all. They are judged by the largest error of a
    ``signal``, such as ``"slider_position"`` or ``"joint_B_force"``, and the one is recommended that is at or
    below ``error``, in the signal's unit, at the least run time; both have defaults for the scene. Runs are
    saved in the folder ``out`` (default: ``comparison/NAME``), from which a second call continues. ``given``
    is the scene as it is typed in a command. In a script, call this function under
    ``if __name__ == "__main__":``.

    Raises:
        BadInput: an argument or the scene is refused, it has no reference solution, or no engine can run it.
        Failed: the reference solution was not found, or no engine finished.
    """
    from crankslider.comparing import compare_engines

    join_engines(engines)
    physics = read_scene(scene)
    place = comparison_folder(physics) if out is None else Path(out)
    given = given or str(getattr(scene, "name", scene))
    with _workers() as pool:
        return compare_engines(physics, given, engines, place, pool, error, signal)


def comparison_folder(scene: Scene) -> Path:
    """Return the default folder of a scene's comparison."""
    return Path("comparison", re.sub(r"[^\w.-]+|^\.+", "-", scene.name))


def join_engines(engines: Sequence[str]) -> None:
    """Add engines to the studies, also those of the user.

    Raises:
        BadInput: one is unknown.
    """
    for name in engines:
        read_engine(name, {})
        join(name)


@check_arguments
def sweep(
    scene: SomeScene,
    vary: Mapping[str, Values] | None = None,
    engine: str = "reference",
    *,
    sample: Literal["grid", "random", "latin-hypercube", "sobol"] = "grid",
    members: Annotated[int, Field(ge=1, le=100_000), in_words()] | None = None,
    jitter: Annotated[
        NonNegative, Field(le=2 * np.pi, json_schema_extra={"unit": "rad"}), in_words("rad")
    ] = 0.0,
    seed: Annotated[int, Field(ge=0), in_words()] = 0,
    step: Seconds | None = None,
    transient: Annotated[NonNegative, in_words()] = 0.0,
    revolutions: Annotated[Positive, in_words()] = 2.0,
    settings: Mapping[str, object] | None = None,
    jobs: Jobs | None = None,
    scheduler: str | None = None,
    out: Place | None = None,
) -> Sweep:
    """Run a scene with many values of its fields and return the rows, one per member.

    ``vary`` maps the path of a field to a range as text, ``"LOW:HIGH[:log][:COUNT]"``, or to its values.
    ``sample`` is a grid of them or a drawing of ``members`` from ``seed``; ``jitter`` moves the angle of the
    turning body at each start by up to so many rad, of ``members`` at each point of a grid. A member runs for
    ``transient`` and then ``revolutions`` that are evaluated, of the turning body at its speed at the start;
    without such a speed, one revolution is the scene's end time. Members run in ``jobs`` processes or on the
    Dask cluster of a ``scheduler``. The rows are written to ``out``, a .parquet or .csv file (default: one in
    a temporary folder); an interrupted sweep resumes from the folder ``out``.rows. In a script, call this
    function under ``if __name__ == "__main__":``.

    Raises:
        BadInput: an argument is refused.
        Failed: the members cannot continue.
    """
    from studies.case import provenance
    from studies.runner import run_cases
    from studies.store import Store
    from studies.sweep import NAME, draw_values, member_cases, member_rows

    physics, chosen = read_scene(scene), read_engine(engine, settings or {})
    if step is None and not chosen.controls_error:
        step = DEFAULT_STEP_S
    values = draw_values(physics, vary or {}, sample, members, jitter, seed)
    columns = {"transient": transient, "revolutions": revolutions, "step": step}
    added = {name: vars(chosen)[name] for name in settings or {}}
    try:
        cases = member_cases(physics, values, engine, chosen, added, columns)
    except UnsupportedScene as reason:
        raise _refused(reason) from None
    place = Path(mkdtemp(prefix="crankslider-")) / "sweep.parquet" if out is None else Path(out)
    ending_of("out", place, ROWS)
    with writing("out", place):
        require_place(place)
    folder = place.with_name(f"{place.name}.rows")
    with _workers(jobs, scheduler) as workers, writing("out", folder), Store(folder) as store, store.held():
        store.describe(NAME, provenance(False, cases))
        run_cases({NAME: cases}, store, workers)
        frame = member_rows(cases, [*values], store.results(NAME)[0])
    made_by = {"version": __version__, "engine": engine, "settings": vars(chosen), **columns, "seed": seed}
    frame.attrs = {**made_by, "scene": physics.to_toml()}  # which Parquet keeps
    swept = Sweep(f"{physics.name}, {engine}", tuple(values), frame)
    with writing("out", place):
        swept.write(place)
    if swept.warning is not None:
        warn(swept.warning, stacklevel=3)
    return swept


@check_arguments
def run_studies(
    studies: Sequence[str] = (),
    full: bool = False,
    engines: Sequence[str] = (),
    jobs: Jobs | None = None,
    out: Place = "results",
    scheduler: str | None = None,
    retry_failed: bool = False,
) -> None:
    """Run studies, all without names, into the folder ``out``; finished cases are kept and skipped.

    Raises:
        BadInput: a study, an engine, the folder or the cluster is refused.
        Failed: the cases cannot go on.
    """
    from studies.registry import STUDIES
    from studies.runner import run_studies as run

    for name in studies:
        if name not in STUDIES:
            raise BadInput(unknown("STUDY", name, STUDIES))
    join_engines(engines)
    folder = Path(out)
    with writing("out", folder), _workers(jobs, scheduler) as workers:
        require_folder(folder)
        run([*dict.fromkeys(studies or STUDIES)], full, folder, workers, retry_failed, engines)


def verdicts_on(engine: str) -> "Iterator[Verdict]":
    """Return the verdicts on an engine, one after the other as they are found.

    Raises:
        BadInput: there is no such engine.
    """
    from studies.conform import verdicts

    chosen = read_engine(engine, {})
    join(engine)
    return verdicts(chosen)


def verdicts_on_file(table: Path, scene: Scene) -> "Iterator[Verdict]":
    """Return the verdicts on a table that another solver made of a scene, by the names of its columns.

    Its times ``time_s`` are equally spaced from 0 on, since the reference solution is sampled so.

    Raises:
        BadInput: it cannot be read, has other times, or shares no column with the reference solution.
        Failed: no reference solution was found.
    """
    import pandas as pd

    from studies.conform import verdicts_on_table

    try:
        columns = pd.read_csv(table)
    except (OSError, ValueError) as reason:
        raise BadInput(f"from: expected a CSV file, got '{reason}'") from None
    times = columns.get("time_s", pd.Series(dtype=float)).to_numpy()
    if len(times) < 2 or not np.allclose(times, np.linspace(0, times[-1], len(times)), atol=1e-9 * times[-1]):
        raise BadInput(f"from: expected time_s at equal distances from 0 on, got {shown(times.tolist())}")
    true = truth(scene, end=float(times[-1]), samples=len(times) - 1).frame.reset_index()
    shared = [name for name in true if name in columns]
    if len(shared) < 2:
        raise BadInput(f"from: expected columns such as {true.columns[1]}, got {', '.join(columns)}")
    return verdicts_on_table(columns[shared], true[shared])


def require_baselines(folder: Path, accept: bool) -> None:
    """Refuse a folder in which no baselines are, or none can be written, before any work."""
    from studies.baselines import read

    if not accept:
        read(folder)
        return
    with writing("baselines", folder):
        require_folder(folder)


def compare_baselines(
    engines: Sequence[str] = (), folder: Path | None = None, why: str | None = None
) -> list[str]:
    """Return a line for each number of engines that left its band, all without names; or accept them.

    Raises:
        BadInput: there are no baselines in the folder.
    """
    from engine_models.arms import NAMED
    from studies.baselines import FOLDER, compare_or_accept

    require_baselines(folder or FOLDER, bool(why))
    return compare_or_accept(engines or NAMED, folder or FOLDER, why)


@contextmanager
def _workers(jobs: int | None = None, scheduler: str | None = None) -> Iterator[Any]:
    """Give workers that run cases: processes here, or a cluster; machine code is kept for them."""
    from reference_solver.kept_files import FolderRefused, writable_folder
    from studies.cluster import Cluster
    from studies.workers import Pool

    try:
        workers = Cluster(scheduler) if scheduler is not None else Pool(jobs or os.cpu_count() or 1)
        with writable_folder(), workers:
            yield workers
    except FolderRefused as reason:
        raise BadInput(str(reason)) from None

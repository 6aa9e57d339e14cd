"""The functions of the library: each checks its arguments once, and the commands call no others.

All raise ``BadInput`` for an argument, a scene or a file that is refused, and for an engine that cannot run
the scene; ``Failed``, which says when and why, for work that breaks down. What a docstring says of an
argument is the help of the option of a command.
"""

import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from tempfile import mkdtemp
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal
from warnings import warn

import numpy as np
from pydantic import Field, InstanceOf

from crankslider.run import Comparison, Run, Sweep, Times, encode, require_outputs, write_file
from engine_models.engine import (
    MOST_SAMPLES,
    Engine,
    Impacts,
    ImpossibleStart,
    RunSettings,
    SimulationFailed,
    UnsupportedScene,
)
from engine_models.engines import join, make_engine
from engine_models.mechanics.quality import quality_of
from engine_models.mechanics.states import lever_m, observed_m
from engine_models.mechanics.trajectory import selected
from engine_models.scene.arguments import Metres, Place, Seconds, check_arguments, in_words
from engine_models.scene.file import load as load_scene
from engine_models.scene.format import NonNegative
from engine_models.scene.library import ALL_SCENES
from engine_models.scene.plain_words import expect, one_of, unknown
from engine_models.scene.scene import Scene
from studies.failures import BadInput, Failed, progress_console, writing

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]
if TYPE_CHECKING:
    from studies.conform import Verdict

__version__ = version("crankslider")

#: The scenes of the library by name, made when they are first asked for.
scenes: Mapping[str, Scene]

#: A scene as users may give one, and what else they type.
SomeScene = Annotated[InstanceOf[Scene] | str | Path, expect(f"{one_of([*ALL_SCENES])}, or a TOML file")]
Samples = Annotated[int, Field(ge=1, le=MOST_SAMPLES), in_words()]
Time = Annotated[NonNegative, in_words("s")]
Angle = Annotated[NonNegative, Field(le=2 * np.pi), in_words("rad")]
Jobs = Annotated[int, Field(ge=1, le=1000), in_words()]
Members = Annotated[int, Field(ge=1, le=100_000), in_words()]
Seed = Annotated[int, Field(ge=0), in_words()]
Transient = Annotated[NonNegative, in_words()]
Named = Mapping[str, object]
Values = Annotated[str | Sequence[float], expect("a string or a list of numbers")]
#: What runs in all engines, in reference solutions and in studies.
DEFAULT_STEP_S = 1e-5
#: A step below this part of the end time is lost to the rounding of time.
SHORTEST_STEP_PART = 1e-12


def __getattr__(name: str) -> Mapping[str, Scene]:
    """Return ``scenes``."""
    if name != "scenes":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return MappingProxyType({name: make() for name, make in ALL_SCENES.items()})


@check_arguments
def load(path: Place) -> Scene:
    """Return the scene in a TOML file."""
    return load_scene(Path(path))


@check_arguments
def read_scene(scene: SomeScene, changes: Named | None = None, end: Seconds | None = None) -> Scene:
    """Return a scene with changes, checked once, after them all.

    Args:
        scene [SCENE]: a library scene or a TOML file.
        changes [--with FIELD=VALUE]: change a field: clearance.B.radial_clearance_m='"0.1 mm"'.
        end: end time in s, or as 10ms; default: that of the scene.
    """
    values = {field: as_toml(value) for field, value in (changes or {}).items()}
    values |= {} if end is None else {"end_time_s": end}
    own = ALL_SCENES.get(str(scene), lambda: None)() if isinstance(scene, str | Path) else scene
    if own is not None:
        return own.replace(values) if values else own
    if os.path.exists(name := str(scene)) or "/" in name or name.endswith(".toml"):
        return load_scene(Path(name), values, "with")
    raise BadInput(unknown("scene", name, ALL_SCENES, f"{one_of([*ALL_SCENES])}, or a TOML file"))


def as_toml(value: object) -> object:
    """Return the value that a text has in a TOML file, or the text where it has none there."""
    if not isinstance(value, str):
        return value
    try:
        return tomllib.loads(f"value = {value}")["value"]
    except (ValueError, RecursionError):
        return value


def _engine(name: str, settings: Named, controls: bool) -> Engine:
    """Return the engine; where it is to control its error, by a method that does unless one is among them."""
    engine = make_engine(name, **settings)
    if not controls or "method" in settings:
        return engine
    return engine.controlling_error(**{key: vars(engine)[key] for key in settings if key == "step_tolerance"})


@check_arguments
def simulate(
    scene: SomeScene,
    engine: str = "reference",
    *,
    step: Seconds | None = None,
    tolerance: Metres | None = None,
    end: Seconds | None = None,
    samples: Samples = 200,
    start: Time = 0.0,
    settings: Named | None = None,
    quick: bool = False,
) -> Run:
    """Return the run of a scene: a ``Scene``, the name of a library scene, or the path of a TOML file.

    Times and lengths may be text with a unit. ``end`` replaces the scene's end time. Doubts are warnings.
    A run without a tolerance is checked by one at half the step and a tenth of the engine's own tolerance.

    Args:
        engine: see 'crankslider engines'; your own: my_module:MyEngine.
        step: longest step in s, or as 5us; default: 1e-5, unless the engine chooses its steps.
        tolerance: refine the run until the slider position is accurate to this, in m.
        samples: number of output intervals of equal length.
        start [--from --start TIME]: the largest contact force is that after this time in s.
        settings [--set KEY=VALUE]: a setting of the engine; see 'crankslider engines'.
        quick: do not check the run by a second one, at half its step, which takes up to twice its time.
    """
    from engine_models.convergence.doubts import doubts  # loads the compiler, which takes a second
    from engine_models.convergence.step_halving import simulate_to_tolerance

    physics = read_scene(scene, end=end)
    chosen, end_s = _engine(engine, settings or {}, tolerance is not None), physics.end_time_s
    if not start < end_s:
        raise BadInput(f"from: expected a time < the end time {end_s:g}, got {start:g}")
    if step is not None and tolerance is not None:
        raise BadInput(f"tolerance: expected nothing beside step, got {tolerance:g}")
    longest = step or (end_s if chosen.controls_error else min(DEFAULT_STEP_S, end_s))
    if tolerance is None and not SHORTEST_STEP_PART * end_s <= longest <= end_s:
        expected = f"a number from {SHORTEST_STEP_PART * end_s:g} to the end time {end_s:g}"
        raise BadInput(f"step: expected {expected}, got {longest:g}")
    with refusing(), np.errstate(all="ignore"):  # engines check for non-finite numbers themselves
        steps = RunSettings(longest, samples)
        if tolerance is None:
            run = chosen.simulate(physics, steps)
        else:
            run = simulate_to_tolerance(chosen, physics, tolerance, samples)
        check = steps if tolerance is None and not quick else None
        warnings = tuple(doubts(chosen, physics, run, quality_of(physics, run), check))
    for doubt in warnings:
        warn(doubt, stacklevel=3)
    return Run(physics, engine, chosen, run, warnings, tolerance, start, bool(check or tolerance))


@contextmanager
def refusing(solution: str = "") -> Iterator[None]:
    """Turn what an engine raises in the block into ``BadInput`` or ``Failed``; no ``solution`` is Failed."""
    from reference_solver.kept_files import FolderRefused

    try:
        yield
    except (FolderRefused, ImpossibleStart) as reason:
        raise BadInput(str(reason)) from None
    except (SimulationFailed, UnsupportedScene) as reason:
        if solution or isinstance(reason, SimulationFailed):
            raise Failed(f"{solution}{reason}") from None
        field = str(reason).startswith(("samples: ", "step: "))
        text = f"engine: expected one that can run this scene, got '{reason}'"
        raise BadInput(str(reason) if field else text) from None


@check_arguments
def truth(scene: SomeScene, *, end: Seconds | None = None, samples: Samples = 120) -> Run:
    """Return the reference solution of a scene, for the validation of other solvers.

    It is independent of all engines. Its samples end at the predictability horizon, where two solutions
    diverge; ``certain_m`` is the uncertainty up to there.

    Args:
        samples: number of output intervals of equal length.
    """
    from engine_models.convergence.doubts import doubts_of_tables
    from studies.judges.converged_truth import INDEPENDENT, TRUE, converged, followed, solved, truth_by
    from studies.judges.metrics import COVERAGE

    physics = read_scene(scene, end=end)
    with refusing("no reference solution was found: "):
        true, repeats = converged(physics, samples, judged=True)
        every, count = solved(physics, samples).truth.contacts, followed(physics, samples, judged=True)
    if not count:
        raise Failed("no reference solution was found: two solutions diverge before the first sample")
    place, end_s, warnings = observed_m(physics, true), true.time_s[count - 1], doubts_of_tables(physics)
    apart = max(float(np.abs(observed_m(physics, one) - place)[:count].max()) for one in repeats)
    resolution = float(np.spacing(max(np.abs(place).max(), lever_m(physics))))
    if count <= samples:
        warnings.append(f"two solutions diverge after t = {end_s:.6g} s; samples end there")
    known, contacts = selected(true, slice(count)), {}
    for joint, contact in known.contacts.items():
        impacts = every[joint].impacts
        over = impacts.time_s + impacts.duration_s <= end_s
        kept = Impacts(**{name: values[over] for name, values in vars(impacts).items()})
        contacts[joint] = replace(contact, impacts=kept)
    for doubt in warnings:
        warn(doubt, stacklevel=3)
    return Run(
        physics,
        "truth",
        TRUE,  # type: ignore[arg-type]
        replace(known, contacts=contacts),
        tuple(warnings),
        certain_m=max(COVERAGE * apart, resolution),
        by="independent equations" if truth_by(physics, samples) == INDEPENDENT else "the reference engine",
    )


@check_arguments
def compare(
    scene: SomeScene,
    engines: Sequence[str] = (),
    out: Place | None = None,
    *,
    error: Times | None = None,
    signal: str | None = None,
    given: str | None = None,
) -> Comparison:
    """Compare engines on a scene and return rows, a recommendation, and a page that can be saved.

    That engine is recommended whose largest error of a signal is at or below the one asked for at the least
    run time. A second call resumes in the folder. ``given`` is the scene as typed in a command.

    Args:
        engines [--engine NAME]: only this engine; repeat for more; your own: my_module:MyEngine.
        out: folder of the page and the rows; default: comparison/NAME.
        error: error asked for, in the signal's unit.
        signal: signal that is judged, such as slider_position or joint_B_force.
    """
    from reports.results import read_study
    from studies.compare import NAME, TRUTH_LIMIT_S, ask, cases
    from studies.running.runner import run_cases

    for name in engines:
        join(name)
    physics = read_scene(scene)
    folder = Path(out or Path("comparison", re.sub(r"[^\w.-]+|^\.+", "-", physics.name)))
    with _workers() as pool, writing("out", folder):
        folder.mkdir(parents=True, exist_ok=True)
        told = f"reference solution of {physics.name}"
        with progress_console().status(told), refusing(f"no {told} was found: "):
            column, wanted_error = pool.run(ask, physics, error, signal, limit_s=TRUTH_LIMIT_S)
        wanted = {case.key: case for case in cases(physics, column, wanted_error, engines)}
        run_cases({NAME: [*wanted.values()]}, folder, pool)
        results = read_study(folder, NAME)
        rows = results.rows[results.rows["case"].isin(wanted)].dropna(axis="columns", how="all")
        results = replace(results, rows=rows.assign(label=rows["label"].cat.remove_unused_categories()))
        compared = Comparison(physics, results, given or str(getattr(scene, "name", scene)), folder)
        recorded = compared.standings.recorded
        if not (recorded["status"] == "ok").any():
            raise Failed(f"no engine finished a run: {' '.join(compared.standings.not_run)}")
        return compared


@check_arguments
def sweep(
    scene: SomeScene,
    vary: Mapping[str, Values] | None = None,
    engine: str = "reference",
    *,
    sample: Literal["grid", "random", "latin-hypercube", "sobol"] = "grid",
    members: Members | None = None,
    jitter: Angle = 0.0,
    seed: Seed = 0,
    step: Seconds | None = None,
    transient: Transient = 0.0,
    revolutions: Times = 2.0,
    settings: Named | None = None,
    jobs: Jobs | None = None,
    scheduler: str | None = None,
    out: Place | None = None,
    plot: Place | None = None,
    show: str | None = None,
) -> Sweep:
    """Run a scene with many values of its fields and return the rows, one per member.

    An interrupted sweep resumes from the folder ``out``.rows.

    Args:
        vary [--vary FIELD=VALUES]: LOW:HIGH[:log][:COUNT] or a list, 0.1mm,0.2mm; repeat for a grid.
        engine: see 'crankslider engines'.
        sample: grid, or a sampling: random, latin-hypercube or sobol.
        members: number of members, or of members at each point of a grid.
        jitter: change the angle of the turning body at each start by up to this, in rad.
        seed: seed of the random members.
        step: longest step in s, or as 5us; default: 1e-5, unless the engine controls its error, as the
            reference then does.
        transient: revolutions before the evaluation starts.
        revolutions: revolutions that are evaluated.
        settings [--set KEY=VALUE]: a setting of the engine.
        jobs: local processes; default: one for each core.
        scheduler: address of a Dask scheduler.
        out: write the rows to .csv, .json or .parquet; default: sweep.parquet, in Python a temporary one.
        plot: draw them over the one or two fields that differ to this .png, .svg or .pdf file.
        show: column that the figure shows.
    """
    from studies.running.runner import run_cases
    from studies.running.store import Store
    from studies.sweep import NAME, draw_values, member_cases, member_rows

    physics, typed = read_scene(scene), settings or {}
    chosen = _engine(engine, typed, controls=step is None and {*typed} <= {"step_tolerance"})
    place = Path(mkdtemp(prefix="crankslider-")) / "sweep.parquet" if out is None else Path(out)
    require_outputs(physics, out=place, plot=plot)
    values = draw_values(physics, vary or {}, sample, members, jitter, seed)
    step = step or (None if chosen.controls_error else DEFAULT_STEP_S)
    columns = {"transient": transient, "revolutions": revolutions, "step": step}
    with refusing():
        cases = member_cases(physics, values, engine, chosen, columns)
    folder = place.with_name(f"{place.name}.rows")
    with _workers(jobs, scheduler) as workers, writing("out", folder):
        run_cases({NAME: cases}, folder, workers)
        with Store(folder) as store:
            frame = member_rows(cases, [*values], store.results(NAME)[0])
    made_by = {"version": __version__, "engine": engine, "settings": vars(chosen), **columns, "seed": seed}
    swept = Sweep(f"{physics.name}, {engine}", tuple(values), frame)
    write_file("out", place, encode(frame, place, {**made_by, "scene": physics.to_toml()}))
    if plot is not None:
        write_file("plot", plot, swept.plot(show))
    if not (warned := frame[frame["warnings"].fillna("") != ""]).empty:
        count = f"{len(warned)} of {len(frame)} members have warnings (column warnings)"
        warn(f"{count}: member {warned['member'].iloc[0]}: {warned['warnings'].iloc[0]}", stacklevel=3)
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
    """Run studies, all without names, into a folder; finished cases are kept and skipped.

    Args:
        studies [[STUDY]...]: accuracy, energy, predictability, cost, stability or extremes; default: all.
        full: run the full set of cases, not the quick one.
        engines [--engine NAME]: only this engine; repeat for more; your own: my_module:MyEngine.
        jobs: local processes; default: one for each core.
        out: folder of the results.
        scheduler: address of a Dask scheduler; timed cases run here.
        retry_failed: run cases again that neither finished nor were refused.
    """
    from studies.case import STUDIES, load_study
    from studies.running.runner import run_cases

    for name in studies:
        if name not in STUDIES:
            raise BadInput(unknown("STUDY", name, STUDIES))
    for name in engines:
        join(name)
    folder = Path(out)
    with writing("out", folder), _workers(jobs, scheduler) as workers:
        cases = {name: load_study(name).cases(full) for name in studies or STUDIES}
        run_cases(cases, folder, workers, full, engines, retry_failed)


def verdicts_on_table(table: str, scene: str) -> "Iterator[Verdict]":
    """Yield a verdict on each column of another solver's CSV table that ``simulate`` writes too.

    Its times ``time_s`` are equally spaced from 0 on, since the reference solution is sampled so.
    The energy-balance error is left out: that of the reference solution is round-off.
    """
    import pandas as pd

    from studies.conform import PLACE_M, STRENGTH, Verdict, within

    try:
        columns = pd.read_csv(table)
        times = columns["time_s"].to_numpy(dtype=float)
        np.testing.assert_allclose(times, np.linspace(0, times[-1], len(times)), atol=1e-9 * times[-1])
    except (OSError, ValueError, LookupError, AssertionError) as reason:
        expected = "a CSV file with time_s at equal distances from 0 on"
        raise BadInput(f"from: expected {expected}, got '{reason}'") from None
    true = truth(scene, end=float(times[-1]), samples=len(times) - 1).frame.reset_index(drop=True)
    true = true.drop(columns="energy_balance_residual_J")
    if not (shared := [name for name in true if name in columns]):
        raise BadInput(f"from: expected columns such as {true.columns[0]}, got {', '.join(columns)}")
    for name in shared:
        off, largest = (columns[name] - true[name]).abs().max(), true[name].abs().max()
        bound = PLACE_M if name.endswith("position_m") else STRENGTH * largest
        words = f"off, the largest is {largest:.3g}", "what is asked of every engine"
        yield Verdict(name, "", *within(float(off), bound, *words))


@contextmanager
def _workers(jobs: int | None = None, scheduler: str | None = None) -> Iterator[Any]:
    """Give workers that run cases: processes here, or a cluster; machine code is kept for them."""
    from reference_solver.kept_files import writable_folder
    from studies.running.cluster import Cluster
    from studies.running.workers import Pool

    with refusing():
        workers = Cluster(scheduler) if scheduler is not None else Pool(jobs or os.cpu_count() or 1)
        with writable_folder(), workers:
            yield workers

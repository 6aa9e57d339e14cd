"""Input of ``crankslider sweep``, checked before anything runs, and its result."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from itertools import islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from engine_models.engine import SETTINGS_CONFIG, FloatArray, UnsupportedScene, plain
from engine_models.kernels import KernelsRefused, writable_folder
from engine_models.mechanics.assembly import start_angle, start_state, started_from
from engine_models.reference.members import LISTS, numbers_of
from engine_models.reference.watch import SPEED, Watch, turning_speed_rad_s
from engine_models.scene.arguments import check_arguments
from engine_models.scene.data import NonNegative, Positive, SceneError
from engine_models.scene.parts import AnyScene, GeneralParts
from engine_models.scene.plain_words import meant, one_of, shown
from engine_models.scene.scene import Scene
from studies.command.options import DEFAULT_STEP_S, PICTURES, as_arguments, checked, ending_of, read_engine
from studies.predictability.sweeps.chunk import Direction
from studies.predictability.sweeps.draws import MOST_JITTER_RAD, Draw, Sample, drawn
from studies.predictability.sweeps.ranges import MOST_MEMBERS, values_of
from studies.predictability.sweeps.run import Sweep, run_sweep
from studies.predictability.sweeps.task import Task
from studies.running.cluster import cluster
from studies.running.execution import LimitedExecutor
from studies.running.failures import BadInput, terminated_as_interrupted, writing
from studies.running.whole_file import require_place, write_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: Directions of a chain, in which each member starts from the end of the one before.
Chain = Literal["up", "down", "both"]
#: What chains are made of.
CRANK_SLIDER = "a crank-slider on a guide along +x through O"
#: Number of corners of all ranges together, and of values of a field, that are checked before a sweep.
MOST_LOOKS = 64


@checked_dataclass(frozen=True, config=SETTINGS_CONFIG)
class SweepOptions:
    """The options of ``sweep`` with one value: revolutions (see ``Watch``), jitter in rad, step in s."""

    sample: Sample = "grid"
    members: Annotated[int, Field(ge=1, le=MOST_MEMBERS)] | None = None
    jitter: Annotated[NonNegative, Field(le=MOST_JITTER_RAD)] = 0.0
    seed: Annotated[int, Field(ge=0)] = 0
    transient: NonNegative = 0.0
    revolutions: Positive = 2.0
    step: Positive | None = None
    jobs: Annotated[int, Field(ge=1, le=1000)] = 1
    hours: Positive = 10.0
    chain: Chain | None = None


@dataclass(frozen=True)
class Swept:
    """A finished sweep: ``path`` is the file of its rows, one per member.

    ``show`` is the column of the default figure, None where the fields that were varied decide.
    """

    path: Path
    title: str
    show: str | None = None

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """The rows, in the order of members."""
        import pandas as pd

        return pd.read_parquet(self.path)

    @check_arguments
    def plot(self, show: str | None = None) -> "Figure":
        """Return the figure for the fields that were varied, of the column ``show`` or of a default one.

        Raises:
            BadInput: there is no figure of that number of fields, or no such column.
        """
        with as_arguments():
            return picture_of(self, show)


def picture_of(swept: Swept, show: str | None) -> "Figure":
    """Return the figure for the command, whose option is ``--show``."""
    from pyarrow import parquet

    from reports.plots.sweeps import NoPicture, sweep_picture

    varied = json.loads(parquet.read_schema(swept.path).metadata[b"varied"])
    try:
        return sweep_picture(swept.frame, varied, swept.title, show or swept.show)
    except NoPicture as reason:
        raise BadInput(f"--show: {reason}") from None


def asked(
    scene: AnyScene,
    vary: Mapping[str, str | Sequence[float]],
    engine_name: str,
    settings: Mapping[str, object],
    exponent: bool,
    options: SweepOptions,
) -> Sweep:
    """Return the sweep that a user asks for.

    Raises:
        BadInput: ranges, engine or options are refused, or a scene at the ends of the ranges is.
    """
    if not scene.joints_with_clearance:
        raise BadInput(f"SCENE: expected a joint with clearance, got none in {scene.name}")
    engine = read_engine(engine_name, settings, to_tolerance=True)
    step_s = options.step
    if step_s is None and not engine.controls_error:
        step_s = DEFAULT_STEP_S
    if exponent and engine_name != "reference" and engine.order is None:
        expected = "the reference, or an engine with a fixed step"
        raise BadInput(f"--exponent: expected {expected}, got {engine_name}")
    assert isinstance(scene, Scene | GeneralParts)
    states = tuple(f"start.{body}." for body in scene.mechanism.names)
    if any(field.startswith(states) for field in vary) and not scene.start.states:
        scene = started_from(scene, *start_state(scene))  # then each body has its own start
    watch = Watch(options.transient, options.revolutions, exponent)
    task = Task(scene, engine_name, dict(vars(engine)), step_s, watch)
    ranges = {field: values_of(field, given) for field, given in vary.items()}
    for field in ranges:
        if field == "end_time_s":
            raise BadInput(
                f"--vary {field}: expected --transient and --revolutions, which end a member's run"
            )
    draw = Draw(options.sample, options.members, options.jitter, options.seed)
    changes = drawn(scene, ranges, draw)
    _require_scenes(task, changes)
    if exponent:
        _require_neighbours(task, changes)
    return Sweep(task, changes, tuple(ranges), _directions(task, changes, options))


def _directions(
    task: Task, changes: Mapping[str, FloatArray], options: SweepOptions
) -> tuple[Direction, ...]:
    """Return the directions in which chains run; refuse input that gives no chain."""
    if options.chain is None:
        return ()
    scene, kind = task.scene, task.scene.driven_by.kind
    if not (isinstance(scene, Scene) and scene.is_plain and scene.is_crank_slider):
        raise BadInput(f"--chain: expected {CRANK_SLIDER}, got {scene.name}")
    if kind != "constant-speed" or not _turns(task, changes):
        raise BadInput(f"--chain: expected a crank at constant speed, got the drive '{kind}'")
    field, *others = changes
    values = changes[field]
    if others or options.sample != "grid" or (field.startswith("start.") and field != SPEED):
        raise BadInput(
            "--chain: expected one field with --vary, which of the start may only be the crank speed"
        )
    if len(values) < 2 or not (np.diff(values) > 0).all():
        raise BadInput(f"--chain: expected rising values of {field}, got others")
    if not (options.transient.is_integer() and options.revolutions.is_integer()):
        raise BadInput(
            "--chain: expected whole revolutions with --transient and --revolutions, got fractions"
        )
    return ("up", "down") if options.chain == "both" else (options.chain,)


def swept(
    sweep: Sweep,
    path: Path,
    options: SweepOptions,
    scheduler: str | None = None,
    pool: LimitedExecutor | None = None,
) -> Swept:
    """Run a sweep, or the rest of an interrupted one, into a file, on local cores or a Dask cluster.

    ``pool`` has ``options.jobs`` local processes, if they were started before.

    Raises:
        BadInput: the file, the cluster or the resources that the sweep needs are refused.
        Failed: the members cannot continue.
    """
    task = sweep.task
    made_by: dict[str, object] = {
        "version": version("crankslider"),
        "engine": task.engine_name,
        "settings": dict(task.settings),
        "watch": vars(task.watch),
        "seed": options.seed,
        "scene": task.scene.to_toml(),
    }
    try:
        with writing("--out", path), writable_folder(), terminated_as_interrupted():
            require_place(path)
            if scheduler is None:
                run_sweep(sweep, path, made_by, options.jobs, None, options.hours, pool)
            else:
                with cluster(scheduler) as executors:
                    run_sweep(sweep, path, made_by, options.jobs, executors, options.hours)
    except KernelsRefused as reason:
        raise BadInput(str(reason)) from None
    return Swept(path, f"{task.scene.name}, {task.engine_name}", _default_column(sweep))


def _turns(task: Task, changes: Mapping[str, FloatArray]) -> bool:
    """Return whether a body turns at the start, so that revolutions are its own."""
    first = {field: float(values[0]) for field, values in changes.items()}
    return turning_speed_rad_s(task.member(first)) != 0


def _default_column(sweep: Sweep) -> str | None:
    """Return the column of a sweep's figure where the fields that were varied do not decide."""
    return None if _turns(sweep.task, sweep.changes) else "largest_contact_force_N"


def drawing(path: Path | None, show: str | None, sweep: Sweep) -> Callable[[Swept], None]:
    """Return the function that draws a sweep into a file, if a figure is asked for.

    Raises:
        BadInput: it cannot be written, there is none of that number of fields or revolutions, there is no
            such column, or there is a column without a file.
    """
    if path is None:
        if show is not None:
            raise BadInput(f"--show: expected nothing without --plot, got {show}")
        return lambda _: None
    ending = ending_of("--plot", path, PICTURES)
    from reports.plots.sweeps import EXPONENT, MOST_FIELDS, MOTION, fewest_turns  # loads matplotlib

    varied, watch, default = sweep.varied, sweep.task.watch, _default_column(sweep)
    if len(varied) > MOST_FIELDS:
        raise BadInput(f"--plot: expected at most {MOST_FIELDS} fields with --vary, got {len(varied)}")
    columns = [*numbers_of(sweep.task.scene), *((MOTION,) if len(varied) == MOST_FIELDS else LISTS)]
    if show is not None and show not in columns:
        raise BadInput(f"--show: expected {one_of(columns)}, got {shown(show)}{meant(show, columns)}")
    if show == EXPONENT and not watch.exponent:
        raise BadInput(f"--show: expected --exponent beside {EXPONENT}, got none")
    if watch.revolutions < (fewest := fewest_turns(varied, show or default)):
        expected = f"a number >= {fewest} for this figure, or another one with --show"
        raise BadInput(f"--revolutions: expected {expected}, got {watch.revolutions:g}")
    with writing("--plot", path):
        require_place(path)

    def draw(result: Swept) -> None:
        from reports.plots.picture import picture_bytes

        with writing("--plot", path):
            write_whole(path, picture_bytes(picture_of(result, show), ending))

    return draw


def options_of(values: Mapping[str, object]) -> SweepOptions:
    """Return the options from values by name: strings, or values that can be typed as one."""
    return checked(SweepOptions, "--", values)


def _require_neighbours(task: Task, changes: Mapping[str, FloatArray]) -> None:
    """Refuse an exponent where no start beside a member's own is known, or no time in which to step."""
    try:
        if not isinstance(task.scene, Scene):
            start_angle(task.scene)
        if not _turns(task, changes):
            raise ValueError("expected a body that turns at the start, got none")
    except ValueError as reason:
        raise BadInput(f"--exponent: {reason}") from None


def _require_scenes(task: Task, changes: Mapping[str, FloatArray]) -> None:
    """Refuse values that give no valid scene, or none that the engine can run.

    The corners of all ranges together are checked, and the values of each field with the other values of the
    first member. Invalid scenes in between are failed rows.
    """
    ends = {field: sorted({float(of.min()), float(of.max())}) for field, of in changes.items()}
    looked_at = [
        dict(zip(ends, corner, strict=True)) for corner in islice(product(*ends.values()), MOST_LOOKS)
    ]
    first = {field: float(of[0]) for field, of in changes.items()}
    for field, of in changes.items():
        values = np.unique(of)
        places = np.linspace(0, len(values) - 1, min(len(values), MOST_LOOKS)).round().astype(int)
        looked_at += [{**first, field: value} for value in values[places].tolist()]
    for member in looked_at:
        try:
            scene = task.member(member)
            if not task.engine.any_mechanism:
                plain(scene, task.engine_name)
            task.engine.check(scene)
        except SceneError as error:
            raise BadInput(f"--vary {error}") from None
        except UnsupportedScene as reason:
            raise BadInput(f"--engine: expected one that can run this scene, got '{reason}'") from None

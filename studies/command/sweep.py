"""Input of ``crankslider sweep``, checked before anything runs, the run of its members, and the result."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from engine_models.arms import AS_IT_COMES, Arm
from engine_models.engine import SETTINGS_CONFIG, RunSettings, UnsupportedScene, plain
from engine_models.scene.arguments import check_arguments
from engine_models.scene.data import NonNegative, Positive, SceneError
from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import meant, one_of, shown
from studies.case import Case, Row, provenance
from studies.cluster import Cluster
from studies.command.options import DEFAULT_STEP_S, PICTURES, as_arguments, ending_of, read_engine
from studies.command.study_run import running_in
from studies.failures import BadInput, writing
from studies.runner import run_cases
from studies.store import Store
from studies.sweeps.measure import NAME, VARIED, member
from studies.sweeps.members import Draw, drawn, values_of
from studies.whole_file import require_place, write_whole
from studies.workers import Pool

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

#: Endings of the file of rows, and the most fields of a figure.
TABLES, MOST_SHOWN = (".parquet", ".csv"), 2
#: How a member ended; and columns of the rows that are kept which no user needs.
ENDS, OF_ROWS = ("status", "reason", "warnings"), ("case", "fingerprint", "checksum", "spoken_by")


@checked_dataclass(frozen=True, config=SETTINGS_CONFIG)
class SweepOptions(Draw):
    """The options of ``sweep`` with one value: the draw's, revolutions, longest step in s, processes."""

    transient: NonNegative = 0.0
    revolutions: Positive = 2.0
    step: Positive | None = None
    jobs: Annotated[int, Field(ge=1, le=1000)] = 1


@dataclass(frozen=True)
class Sweep:
    """A sweep that can run: its ``cases``, a member each, and the paths of the fields that differ."""

    title: str
    cases: Sequence[Case]
    fields: Sequence[str]
    made_by: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Swept:
    """A finished sweep: ``frame`` has its rows, one per member; they are in the file ``path``."""

    path: Path
    frame: "pd.DataFrame"
    sweep: Sweep

    @cached_property
    def warning(self) -> str | None:
        """A line that counts the members with warnings, with the first of them; None without any."""
        warned = self.frame[self.frame["warnings"].fillna("") != ""]
        if warned.empty:
            return None
        first = warned.iloc[0]
        count = f"{len(warned)} of {len(self.frame)} members have warnings (column warnings)"
        return f"{count}: member {first['member']}: {first['warnings']}"

    @check_arguments
    def plot(self, show: str | None = None) -> "Figure":
        """Return the figure over the one or two fields that differ, of the column ``show`` or of a default.

        Raises:
            BadInput: there is no figure of that number of fields, or no such column.
        """
        with as_arguments():
            return draw(self, show)


def draw(swept: Swept, show: str | None) -> "Figure":
    """Return the figure for the command, whose option is ``--show``."""
    from reports.plots.sweeps import NoPicture, sweep_picture

    frame = swept.frame
    numbers = list(frame.columns[list(frame).index("warnings") + 1 :])
    if show is not None and show not in numbers:
        raise BadInput(f"--show: expected {one_of(numbers)}, got {shown(show)}{meant(show, numbers)}")
    try:
        return sweep_picture(frame, swept.sweep.fields, swept.sweep.title, show)
    except NoPicture as reason:
        raise BadInput(f"--plot: {reason}") from None


def plotting(path: Path | None, show: str | None, sweep: Sweep) -> Callable[[Swept], None]:
    """Return the function that draws a sweep into a file, if a figure is asked for.

    Raises:
        BadInput: it cannot be written, there is none of that number of fields, or a column without a file.
    """
    if path is None:
        if show is not None:
            raise BadInput(f"--show: expected nothing without --plot, got {show}")
        return lambda _: None
    ending = ending_of("--plot", path, PICTURES)
    if len(sweep.fields) > MOST_SHOWN:
        raise BadInput(f"--plot: expected at most {MOST_SHOWN} fields that differ, got {len(sweep.fields)}")
    with writing("--plot", path):
        require_place(path)

    def write(swept: Swept) -> None:
        from reports.plots.picture import picture_bytes

        with writing("--plot", path):
            write_whole(path, picture_bytes(draw(swept, show), ending))

    return write


def read_sweep(
    scene: AnyScene,
    vary: Mapping[str, str | Sequence[float]],
    engine_name: str,
    settings: Mapping[str, object],
    options: SweepOptions,
) -> Sweep:
    """Return the sweep that a user asks for.

    Raises:
        BadInput: ranges, engine or options are refused, or a scene at the ends of the ranges is.
    """
    engine = read_engine(engine_name, settings)
    step = options.step
    if step is None and not engine.controls_error:
        step = DEFAULT_STEP_S
    if "end_time_s" in vary:
        expected = "--transient and --revolutions, which end a member's run"
        raise BadInput(f"--vary end_time_s: expected {expected}")
    changes = drawn(scene, {name: values_of(name, given) for name, given in vary.items()}, options)
    first = {name: float(values[0]) for name, values in changes.items()}
    ends = [{**first, name: float(end)} for name, of in changes.items() for end in (of.min(), of.max())]
    for values in ends:
        try:
            checked = member(scene, values, options.transient + options.revolutions)
            if not engine.any_mechanism:
                plain(checked, engine_name)
            engine.check(checked)
        except SceneError as error:
            raise BadInput(f"--vary {error}") from None
        except UnsupportedScene as reason:
            raise BadInput(f"--engine: expected one that can run this scene, got '{reason}'") from None
    arm = Arm(engine_name, AS_IT_COMES)
    asked: Row = {"transient": options.transient, "revolutions": options.revolutions, "step": step}
    run, added = RunSettings(step or scene.end_time_s, 1), {name: vars(engine)[name] for name in settings}
    rows = np.array([*changes.values()]).T.tolist()
    columns = [
        asked | {VARIED + name: value for name, value in zip(changes, row, strict=True)} for row in rows
    ]
    cases = [Case(NAME, scene, arm, run, added, columns=own) for own in columns]
    made_by: dict[str, object] = {
        "version": version("crankslider"),
        "engine": engine_name,
        "settings": dict(vars(engine)),
    }
    made_by |= {**asked, "seed": options.seed, "scene": scene.to_toml()}
    return Sweep(f"{scene.name}, {engine_name}", cases, list(changes), made_by)


def run_sweep(sweep: Sweep, path: Path, jobs: int, scheduler: str | None = None) -> Swept:
    """Run the members that the folder ``path``.rows lacks, and write the file of all rows.

    Members run in ``jobs`` processes here, or on the Dask cluster of a ``scheduler``.

    Raises:
        BadInput: the file, the folder or the cluster is refused.
        Failed: no member can go on.
    """
    folder = path.with_name(f"{path.name}.rows")
    with Pool(jobs) as pool, writing("--out", path):
        require_place(path)
        workers = nullcontext(pool) if scheduler is None else Cluster(scheduler)
        with running_in(folder), workers as anywhere, Store(folder) as store, store.held():
            store.describe(NAME, provenance(False, sweep.cases))
            run_cases({NAME: sweep.cases}, store, anywhere)
            frame = _frame(sweep, store.results(NAME)[0])
            csv = path.suffix.lower() == ".csv"
            content = frame.to_csv(index=False).encode("utf-8") if csv else frame.to_parquet(index=False)
            write_whole(path, content)
    return Swept(path, frame, sweep)


def _frame(sweep: Sweep, rows: Sequence[Row]) -> "pd.DataFrame":
    """Return the rows of members, in their order, from all rows that are kept."""
    import pandas as pd

    by_case = {row["case"]: row for row in rows}
    of_run = pd.DataFrame([by_case[case.key] for case in sweep.cases])
    head = {"member": range(len(of_run))} | {name: of_run[VARIED + name] for name in sweep.fields}
    ends = {name: of_run.get(name) for name in ENDS}
    others = {*sweep.cases[0].head(), *ENDS, *OF_ROWS}
    frame = pd.DataFrame({**head, **ends, **of_run[[name for name in of_run if name not in others]]})
    frame.attrs = dict(sweep.made_by)  # which Parquet keeps
    return frame

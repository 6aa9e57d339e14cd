"""What several chapters show: settings, observed orders, smallest errors, and runs that did not finish."""

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from reports.convergence import Order, observed_order
from reports.parts import Section, Table
from reports.quantities import scale, uncertainty, value
from reports.results import NOT_INSTALLED, with_columns
from reports.style import axis_label, labels, words
from reports.tables import ABSENT, error, listed, number

CASE = ("scene", "engine", "arm")
#: The column of why the check after every run fails one that finished; empty where it does not.
QUALITY = "quality_failure"
#: The column of signals that are not judged, with why: "joint_B_force_N: zero; ...".
NOT_JUDGED = "not_judged"
#: Who says that a run is none, by the rows' column ``spoken_by``, and what is said of how many are no
#: engine's failures.
SPEAKERS = {
    "engine": "the engine",
    "adapter": "our model of the engine",
    "guard": "a check of ours",
    "scene": "the scene",
}
SAID = {
    "adapter": "Not expressed by our models of the engines, which is no failure of an engine: {}.",
    "guard": "Ended by a check of ours, or by a limit of time or memory: {}.",
    "scene": "Without a motion, so that no engine was asked: {}.",
}
#: A comparison ends before its scene if it is short of this part of it.
SHORT_OF = 0.999


def head(rows: pd.DataFrame, *columns: str) -> dict[str, pd.Series]:
    """Return the columns that say what was run as a table has them, steps in two digits."""
    steps = {"step_s": ("step [s]", rows["step_s"].map(number))}
    return dict(steps.get(name, (name, rows[name])) for name in columns)


def heading(column: str) -> str:
    """Return the heading of a column of errors: slider position [m]."""
    return axis_label(column).replace(" error", "")


def orders(rows: pd.DataFrame, column: str) -> dict[str, dict[str, Order]]:
    """Return the observed order of a column by label and scene, where a finished run has it."""
    rows = rows.assign(error=value(rows, column), doubt=uncertainty(rows, column), scale=scale(rows, column))
    floors = rows.groupby("scene")["doubt"].max().fillna(0.0)
    scales = rows.groupby("scene")["scale"].max().fillna(np.inf)
    by_label: dict[str, dict[str, Order]] = {label: {} for label in labels(rows)}
    for (label, scene), points in rows.dropna(subset="error").groupby(["label", "scene"], observed=True):
        ends = floors[scene], scales[scene]
        by_label[label][scene] = observed_order(points["mean_step_s"], points["error"], *ends)
    return by_label


def orders_in_text(by_scene: Mapping[str, Order]) -> str:
    """Return in words between what the orders claimed lie, on which scenes, and where why none is claimed."""
    scenes: dict[str, list[str]] = {}
    for scene, order in sorted(by_scene.items(), key=lambda item: item[1].slope is None):
        scenes.setdefault(order.verdict, []).append(scene)
    slopes = sorted((order.slope, str(order)) for order in by_scene.values() if order.slope is not None)
    ends = " to ".join(dict.fromkeys(text for _, text in (*slopes[:1], *slopes[-1:])))
    words = {"order": f"order {ends}"}
    return "; ".join(f"{words.get(verdict, verdict)} on {listed(on)}" for verdict, on in scenes.items())


def order_cells(shown: pd.DataFrame, rows: pd.DataFrame, column: str, absent: str = ABSENT) -> pd.Series:
    """Return for each row shown the observed order of its arm on its scene over all ``rows``, as text."""
    by_label = orders(rows, column)
    cases = zip(shown["label"], shown["scene"], strict=True)
    return pd.Series(
        [str(by_label[label].get(scene, absent)) for label, scene in cases], shown.index, dtype=object
    )


def smallest_errors(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return the smallest error of each arm on each scene as a table has it, an arm a row."""
    arms = rows.groupby(list(CASE), sort=False)
    cells = [(*case, *(_smallest(arm, column) for column in columns)) for case, arm in arms]
    return pd.DataFrame(cells, columns=[*CASE, *map(heading, columns)])


def _smallest(rows: pd.DataFrame, column: str) -> str:
    errors = value(rows, column).dropna()
    return error(errors.min(), uncertainty(rows, column)[errors.idxmin()]) if len(errors) else ABSENT


def settings_table(rows: pd.DataFrame, study: str) -> Table:
    """Return what each arm sets; what it does not is the default of the engine's model here."""
    names = sorted(name for name in rows if name.startswith("setting_"))
    arms = rows.drop_duplicates("label").sort_values("label")
    settings = rows.groupby("label", observed=True)[names]
    return Table.of(
        f"{study}-settings",
        "Engines and arms",
        "What is not set has the default of the engine's model here, which is meant as its best practice. "
        "What is varied has another value in each rung of the arm's ladder.",
        {
            **head(arms, "engine", "arm"),
            "settings": [_settings(of_label) or "the defaults" for _, of_label in settings],
        },
    )


def followed(rows: pd.DataFrame) -> str:
    """Return in a sentence until when errors on each scene are compared, with the end of one that goes on."""
    rows = rows.dropna(subset="compared_until_s")
    if rows.empty:
        return ""
    until = rows.groupby("scene").agg({"compared_until_s": ["min", "max"], "end_time_s": "first"})
    times = [
        f"{' to '.join(dict.fromkeys((f'{low:.3g}', f'{high:.3g}')))} s"
        + (f" of {end:.3g} s" if low < SHORT_OF * end else "")
        + f" on {scene}"
        for scene, low, high, end in until.itertuples()
    ]
    return f"Compared until {listed(times)}."


def not_judged(rows: pd.DataFrame, signals: str = "") -> str:
    """Return which signals that match are not judged on which scenes, as a caption's end, "" if all are."""
    told = with_columns(rows, NOT_JUDGED).dropna(subset=NOT_JUDGED)
    scenes: dict[str, list[str]] = {}
    for scene, reasons in told.groupby("scene")[NOT_JUDGED]:
        for what in dict.fromkeys(what for text in reasons for what, _ in unjudged(text, signals)):
            scenes.setdefault(what, []).append(str(scene))
    parts = "; ".join(f"{what} on {listed(on)}" for what, on in scenes.items())
    return f" A signal that is zero, or whose peak no sample sees, is not judged: {parts}." if parts else ""


def unjudged(text: object, signals: str = "") -> list[tuple[str, str]]:
    """Return each signal that matches and is not judged, in words, and why, from a row's ``NOT_JUDGED``."""
    parts = (part.partition(": ") for part in (text.split("; ") if isinstance(text, str) else ()) if part)
    return [(words(name)[0], why) for name, _, why in parts if re.search(signals, name)]


def speakers(rows: pd.DataFrame) -> pd.Series:
    """Return in words who says that a run is none, a dash where a row does not tell."""
    return with_columns(rows, "spoken_by")["spoken_by"].map(SPEAKERS).fillna(ABSENT)


def unfinished(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the runs that did not finish, without those of engines that are not installed."""
    return rows[~rows["status"].isin(("ok", NOT_INSTALLED))]


def not_finished(rows: pd.DataFrame) -> Iterator[str]:
    """Yield in how many runs an engine failed, how many others did not finish, and who is not installed."""
    absent, failed = rows["status"] == NOT_INSTALLED, unfinished(rows)
    told, count = list(with_columns(failed, "spoken_by")["spoken_by"]), (~absent).sum()
    if count and failed.empty:
        yield f"All {count} runs finished."
    elif count:
        yield f"By its own word an engine failed in {told.count('engine')} of {count} runs."
        yield from (said.format(told.count(speaker)) for speaker, said in SAID.items() if speaker in told)
    yield from not_installed(rows)


def not_installed(rows: pd.DataFrame) -> Iterator[str]:
    """Yield of each engine that is not installed how many runs are not there for it."""
    for engine, runs in rows["engine"][rows["status"] == NOT_INSTALLED].value_counts(sort=False).items():
        yield f"{engine} is not installed: its runs are left out, {runs} of {len(rows)}."


def failures_table(rows: pd.DataFrame, study: str) -> Table | None:
    """Return the runs that did not finish, with the reason and whose that is; None if all did."""
    failed = unfinished(rows)
    if failed.empty:
        return None
    return Table.of(
        f"{study}-failures",
        "Runs that did not finish",
        "Where the engine gave up itself, the reason is its own, and the run counts as its failure. Our "
        "model of an engine is this project's: what it does not express the engine may well. A check of ours "
        "is of the run while it goes on, of what came out, or of time and memory. A scene that has no motion "
        "is refused before any engine is asked.",
        {
            **head(failed, *CASE, "step_s", "status"),
            "said by": speakers(failed),
            **head(failed, "reason"),
        },
    )


def quality_failures(rows: pd.DataFrame) -> pd.Series:
    """Return why the check fails each run, empty where it does not or was not made."""
    found = with_columns(rows, QUALITY)[QUALITY].astype(object)
    return found.where(found.notna(), "")


def quality_table(rows: pd.DataFrame, study: str) -> Table | None:
    """Return the runs that finished and that the check after every run fails; None if it fails none."""
    found = quality_failures(rows)
    failed = rows[found != ""]
    if failed.empty:
        return None
    return Table.of(
        f"{study}-quality",
        "Runs that fail the check",
        "What `crankslider simulate` says of such a run in place of its numbers.",
        {**head(failed, *CASE, "step_s"), "found": found[failed.index]},
    )


def failures_section(rows: pd.DataFrame, study: str, name: str = "failures") -> Section:
    """Return the section on runs that did not finish, or fail the check, with tables of them if any did."""
    table, failing = failures_table(rows, study), quality_table(rows, study)
    text = [*not_finished(rows)]
    if failing:
        text.append(
            f"{len(failing.rows)} finished and fail the check that is made after every run: of energy that "
            "no physics accounts for, gaps of ideal joints, and pins outside their bearings. They are in all "
            "figures and tables with the numbers that they gave."
        )
    return Section.of(name, "Runs that did not finish", text, (), [table, failing])


def _settings(settings: pd.DataFrame) -> str:
    """Return the settings of one label's rows; what its ladder sets otherwise in each rung is varied."""
    texts = settings.dropna(axis="columns", how="all").map(
        lambda of: f"{of:.4g}" if isinstance(of, float) else str(of)
    )
    return ", ".join(
        f"{name.removeprefix('setting_')} {'varied' if len(of) > 1 else f'= {of[0]}'}"
        for name, of in ((name, texts[name].unique()) for name in texts)
    )

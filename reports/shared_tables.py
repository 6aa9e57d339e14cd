"""What several chapters show: observed orders, smallest errors, settings, and runs that did not finish."""

import re
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from reports.analysis.convergence import Order, observed_order
from reports.parts import Finding, Number, Table
from reports.quantities import QUALITY, quality_failures, scale, uncertainty, value
from reports.results import with_columns
from reports.style import axis_label, labels, words
from reports.tables import ABSENT, error, listed, number

CASE = ("scene", "engine", "arm")
#: The column of signals that are not judged, with why: "joint_B_force_N: zero; ...".
NOT_JUDGED = "not_judged"
#: A comparison ends before its scene if it is short of this part of it.
SHORT_OF = 0.999


def head(rows: pd.DataFrame, *columns: str) -> dict[str, pd.Series]:
    """Return the columns that say what was run as a table has them, steps in two digits."""
    names = {"arm": "configuration", "step_s": "step [s]"}
    texts = {"step_s": rows["step_s"].map(number)}
    return {names.get(name, name): texts[name] if name in texts else rows[name] for name in columns}


def heading(column: str) -> str:
    """Return the heading of a column of errors: slider position [m]."""
    return axis_label(column).replace(" error", "")


def signal(column: str) -> str:
    """Return the signal of a column of errors in words: slider position."""
    return words(column)[0].replace(" error", "")


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


def order_cells(shown: pd.DataFrame, rows: pd.DataFrame, column: str, absent: str = ABSENT) -> pd.Series:
    """Return for each row shown the observed order of its label on its scene over all ``rows``, as text."""
    by_label = orders(rows, column)
    cases = zip(shown["label"], shown["scene"], strict=True)
    return pd.Series(
        [str(by_label[label].get(scene, absent)) for label, scene in cases], shown.index, dtype=object
    )


def smallest_errors(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return the smallest error of each configuration on each scene as a table has it."""
    series = rows.groupby(list(CASE), sort=False)
    cells = [(*case, *(_smallest(of, column) for column in columns)) for case, of in series]
    return pd.DataFrame(cells, columns=["scene", "engine", "configuration", *map(heading, columns)])


def _smallest(rows: pd.DataFrame, column: str) -> str:
    errors = value(rows, column).dropna()
    return error(errors.min(), uncertainty(rows, column)[errors.idxmin()]) if len(errors) else ABSENT


def nearest(rows: pd.DataFrame, column: str) -> pd.DataFrame:
    """Return each engine's run with the smallest ``error`` of a column on each scene, and its ``doubt``."""
    best = rows.assign(error=value(rows, column), doubt=uncertainty(rows, column).fillna(0.0))
    best = best.dropna(subset="error").sort_values("error", kind="stable")
    return best.drop_duplicates(["engine", "scene"]).sort_index()


def settings_table(rows: pd.DataFrame, study: str) -> Table:
    """Return what each configuration sets; what it does not is the default of the engine's model here."""
    names = sorted(name for name in rows if name.startswith("setting_"))
    first = rows.drop_duplicates("label").sort_values("label")
    settings = rows.groupby("label", observed=True)[names]
    reading = (
        "What is not set has the default of the engine's model here. A setting that is varied has another "
        "value in each run of the configuration's series."
    )
    columns = {
        **head(first, "engine", "arm"),
        "settings": [_settings(of_label) or "the defaults" for _, of_label in settings],
    }
    return Table.of(f"{study}-settings", "Engines and configurations", reading, study, columns)


def _settings(settings: pd.DataFrame) -> str:
    """Return the settings of one label's rows; what differs from run to run is varied."""
    texts = settings.dropna(axis="columns", how="all").map(
        lambda of: f"{of:.4g}" if isinstance(of, float) else str(of)
    )
    return ", ".join(
        f"{name.removeprefix('setting_')} {'varied' if len(of) > 1 else f'= {of[0]}'}"
        for name, of in ((name, texts[name].unique()) for name in texts)
    )


def followed(rows: pd.DataFrame) -> str:
    """Return in a sentence until when errors on each scene are compared, with the end of one that goes on."""
    rows = rows.dropna(subset="compared_until_s")
    if rows.empty:
        return ""
    until = rows.groupby("scene").agg({"compared_until_s": ["min", "max"], "end_time_s": "first"})
    short = [
        f"{' to '.join(dict.fromkeys((f'{low:.3g}', f'{high:.3g}')))} s of {end:.3g} s on {scene}"
        for scene, low, high, end in until.itertuples()
        if low < SHORT_OF * end
    ]
    return f"Compared until {listed(short)}." if short else ""


def not_judged(rows: pd.DataFrame, signals: str = "") -> str:
    """Return in a sentence which signals that match are not judged on which scenes, "" if all are."""
    told = with_columns(rows, NOT_JUDGED).dropna(subset=NOT_JUDGED)
    scenes: dict[str, list[str]] = {}
    for scene, reasons in told.groupby("scene")[NOT_JUDGED]:
        for what in dict.fromkeys(what for text in reasons for what, _ in unjudged(text, signals)):
            scenes.setdefault(what, []).append(str(scene))
    parts = "; ".join(f"{what} on {listed(on)}" for what, on in scenes.items())
    return f"Not judged, because the signal is zero or no sample resolves its peak: {parts}." if parts else ""


def unjudged(text: object, signals: str = "") -> list[tuple[str, str]]:
    """Return each signal that matches and is not judged, in words, and why, from a row's ``NOT_JUDGED``."""
    parts = (part.partition(": ") for part in (text.split("; ") if isinstance(text, str) else ()) if part)
    return [(words(name)[0], why) for name, _, why in parts if re.search(signals, name)]


def unfinished(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the runs that did not finish."""
    return rows[rows["status"] != "ok"]


def reliability(rows: pd.DataFrame) -> Finding:
    """Return in a sentence how many runs finished, and how many of these fail the check."""
    text = "{finished} of {asked} runs finished"
    counts = {"finished": len(rows) - len(unfinished(rows)), "asked": len(rows)}
    if QUALITY in rows:
        counts["failing"] = int((quality_failures(rows) != "").sum())
        text += "; {failing} of those that finished fail the check of energy, joint gaps and penetration"
    return Finding("reliability", f"{text}.", **{name: Number(float(of)) for name, of in counts.items()})


def runs_tables(rows: pd.DataFrame, study: str) -> Iterator[Table]:
    """Yield the runs that did not finish, and those that fail the check."""
    failed, found = unfinished(rows), quality_failures(rows)
    if len(failed):
        columns = head(with_columns(failed, "exception"), *CASE, "step_s", "status", "exception", "reason")
        columns["exception"] = columns["exception"].astype(object).fillna(ABSENT)
        yield Table.of(f"{study}-failures", "Runs that did not finish", "", study, columns)
    if (found != "").any():
        failing = rows[found != ""]
        columns = {**head(failing, *CASE, "step_s"), "found": found[failing.index]}
        yield Table.of(f"{study}-quality", "Finished runs that fail the check", "", study, columns)

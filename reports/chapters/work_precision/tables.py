"""The tables of the work-precision study, and its sentences on the reference's place."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from reports.equal_error import duel, ladders, levels, time_at
from reports.parts import Table
from reports.quantities import finished
from reports.results import FloatArray
from reports.shared_tables import failures_table, head
from reports.style import words
from reports.tables import ABSENT, in_text, number

REFERENCE = "reference"
#: At equal error the reference should need at most this part of the best rival's time on clearance scenes.
AIM = 0.1


def cheapest(kind: str, rows: pd.DataFrame, column: str) -> Table:
    """Return the run time of every engine's best arm at equal errors, and the ratio of the two cheapest."""
    name, unit = words(column)
    engines = rows.sort_values("label")["engine"].unique().tolist()
    cells = []
    for scene, (rungs, floor) in ladders(rows, column).items():
        for level in levels(rungs, floor):
            times = _times(rungs, level)
            shown = [f"{1e3 * times[engine]:.2g}" if engine in times else ABSENT for engine in engines]
            cells.append((scene, number(level), *shown, *_ratio(rungs, level)))
    return Table(
        f"work-precision-{kind}-{column.rpartition('_error')[0].replace('_', '-')}",
        f"Run time at equal {name}",
        f"Run time in ms of each engine's cheapest arm at an error in {unit}, interpolated between the rungs "
        "of its ladder; a dash where it does not get there. The ratio is the second cheapest engine's time "
        "in times the cheapest's: median over the rounds, and their range. In brackets where the rounds do "
        "not agree who is cheaper.",
        ("scene", f"error [{unit}]", *engines, "cheapest", "second", "ratio"),
        tuple(cells),
    )


def _times(rungs: pd.DataFrame, level: float) -> pd.Series:
    """Return the times in s of the engines that reach an error, cheapest first."""
    times = {engine: time_at(ladder, level) for engine, ladder in rungs.groupby("engine")}
    return pd.Series(times, dtype=float).dropna().sort_values()


def _duel(rungs: pd.DataFrame, slow: str, fast: str, level: float) -> FloatArray:
    return duel(rungs[rungs["engine"] == slow], rungs[rungs["engine"] == fast], level)


def _ratio(rungs: pd.DataFrame, level: float) -> tuple[str, str, str]:
    first, second, *_ = (*list(_times(rungs, level).index), ABSENT, ABSENT)
    ratios = np.array([math.nan]) if second == ABSENT else _duel(rungs, second, first, level)
    if np.isnan(ratios).any():
        return first, second, ABSENT
    text = f"{np.median(ratios):.2g} ({min(ratios):.2g} to {max(ratios):.2g})"
    return first, second, text if (ratios > 1).all() or (ratios < 1).all() else f"[{text}]"


def reference_against_rivals(rows: pd.DataFrame, column: str) -> Iterator[str]:
    """Yield the reference's place on each scene in a sentence, none where it has no rival."""
    name, unit = words(column)
    for scene, (rungs, floor) in ladders(rows, column).items():
        shares = _shares(rungs, floor)
        if shares.empty:
            continue
        best, worst = (
            f"{row['share']:.2g} (at {in_text(row['level'])} {unit}, against {row['rival']})"
            for row in (shares.loc[shares["share"].idxmin()], shares.loc[shares["share"].idxmax()])
        )
        met, dearer = (shares["share"] <= AIM).sum(), (shares["share"] >= 1).sum()
        yield (
            f"{scene}: at equal {name} the reference needs between {best} and {worst} of the best rival's "
            f"run time, at most a tenth at {met} of {len(shares)} errors"
            + (f"; it is not the cheapest at {dearer} of them." if dearer else ".")
        )


def _shares(rungs: pd.DataFrame, floor: float) -> pd.DataFrame:
    """Return the reference's run time as a share of its best rival's at each level that both reach."""
    shares = []
    for level in levels(rungs, floor):
        times = _times(rungs, level)
        rivals = times.index.drop(REFERENCE, errors="ignore")
        if REFERENCE in times and len(rivals):
            share = np.median(_duel(rungs, REFERENCE, rivals[0], level))
            shares.append({"level": level, "share": share, "rival": rivals[0]})
    return pd.DataFrame(shares, columns=["level", "share", "rival"]).dropna()


def building(rows: pd.DataFrame) -> Table:
    """Return what building the model and reading out take, by engine and arm, over the timed runs."""
    times = 1e3 * rows["build_time_s"].dropna()
    by_arm = times.groupby(rows["label"], observed=True).agg(["median", "min", "max"])
    arms = rows.drop_duplicates("label").set_index("label").loc[by_arm.index]
    return Table.of(
        "work-precision-building",
        "Building and reading out",
        "Wall time of a bare run besides the native solve, in ms, over all scenes and rungs.",
        {
            **head(arms, "engine", "arm"),
            **{
                f"{what} [ms]": by_arm[name].map("{:.2g}".format)
                for name, what in (("median", "median"), ("min", "least"), ("max", "most"))
            },
        },
    )


def compiling(rows: pd.DataFrame) -> Table | None:
    """Return what compiling takes, by scene and engine; None if nothing was compiled anew."""
    rows = finished(rows).dropna(subset="compile_time_s").sort_values(["scene", "engine"])
    if rows.empty:
        return None
    return Table.of(
        "work-precision-compiling",
        "Compiling",
        "Wall time in s of compiling a scene's kernels on a machine that has none; they are kept from then "
        "on. Engines that are not here bring their code compiled.",
        {**head(rows, "scene", "engine"), "time [s]": rows["compile_time_s"].map("{:.2g}".format)},
    )


def failures(rows: pd.DataFrame) -> Table | None:
    """Return the recorded runs that did not finish, with the reason; None if all did."""
    recorded = rows[rows["round"].isna() & rows["compiled_anew"].isna()]
    table = failures_table(recorded, "work-precision")
    return table and replace(table, reading="Recorded runs of a rung that ended early, and why.")

"""The tables of the work-precision study."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pandas as pd

from reports.equal_error import (
    ALONE,
    SLIDER,
    UNRESOLVED,
    Judged,
    arrival,
    arrivals,
    is_force,
    levels,
    ratio,
    saturated,
)
from reports.parts import Table
from reports.quantities import finished
from reports.results import with_columns
from reports.shared_tables import failures_table, followed, head
from reports.style import words
from reports.tables import ABSENT, number, plain

#: Columns of the slider's error until fixed times, by these in words.
EARLY = {
    "the third impact": "slider_position_error_until_3_impacts_m",
    "6 ms": "slider_position_error_until_6ms_m",
    "12 ms": "slider_position_error_until_12ms_m",
}
#: How a table of run times at equal errors is read.
READING = (
    "Run time of each engine's cheapest arm at an error, the cheapest engine first; an engine that is not "
    "there does not get to that error. An error counts if all finer settings of the arm that were run keep "
    "it. Between two neighbouring rungs of one arm's ladder, whose settings are both named, it is "
    "interpolated log-log. The ratio to the cheapest is the median over the rounds, with an interval of 95 % "
    "by drawing rounds with replacement; of three rounds that is their range."
)


def cheapest(judged: Judged) -> Table | None:
    """Return what every engine takes at equal errors, by which arm and at which setting; None if none."""
    what, unit = words(judged.column)
    lines = tuple(_at_equal_errors(judged))
    if not lines:
        return None
    ends = [ALONE] * is_force(judged.column) + [followed(judged.rows)]
    return Table(
        judged.name,
        f"Run time at equal {what}",
        " ".join([READING, UNRESOLVED, *ends]),
        ("scene", f"error [{unit}]", *WAYS),
        lines,
    )


#: The columns of how an engine gets to an error.
WAYS = ("engine and arm", "setting", "time [ms]", "ratio to the cheapest")


def _at_equal_errors(judged: Judged) -> Iterator[tuple[str, ...]]:
    for scene, (rungs, floor) in judged.ladders.items():
        for level in levels(rungs, floor):
            there = arrivals(rungs, level)
            for each in there:
                times = ABSENT if each is there[0] else str(ratio(each, there[0]) or ABSENT)
                time = plain(1e3 * each.time_s) + each.without(judged.column)
                yield scene, number(level), each.label, each.setting, time, times


def early(rows: pd.DataFrame, name: str) -> Table | None:
    """Return the same at fixed times, of scenes at whose end some errors have grown to the clearance."""
    rows = rows[rows["scene"].isin(rows["scene"][saturated(rows, SLIDER)])]
    lines = tuple(
        (scene, until, *rest)
        for until, column in EARLY.items()
        for scene, *rest in _at_equal_errors(Judged(name, with_columns(rows, column), column))
    )
    if not lines:
        return None
    return Table(
        f"{name}-early",
        "Run time at equal slider position error, at fixed times",
        "Of scenes at whose end errors have grown to a tenth of the clearance in some runs, which ranks none "
        f"of these: the slider's largest error until earlier times. {READING} {UNRESOLVED}",
        ("scene", "until", "error [m]", *WAYS),
        tuple(sorted(lines, key=lambda line: line[0])),
    )


def building(rows: pd.DataFrame) -> Table:
    """Return what building the model and reading out take, by engine and arm, over the timed runs."""
    rows = rows.dropna(subset="build_time_s")
    rows = rows.assign(build=1e3 * rows["build_time_s"], run=rows["build_time_s"] + rows["solve_time_s"])
    rows = rows.assign(part=100 * rows["build_time_s"] / rows["run"])
    by_arm = rows.groupby("label", observed=True)[["build", "part"]].agg(["median", "min", "max"])
    arms = rows.drop_duplicates("label").set_index("label").loc[by_arm.index]
    return Table.of(
        "work-precision-building",
        "Building and reading out",
        "Wall time of a bare run besides the native solve over all scenes and rungs, in ms and in percent of "
        "both together.",
        {
            **head(arms, "engine", "arm"),
            **{
                f"{what} [{unit}]": by_arm[quantity, name].map(plain)
                for quantity, unit in (("build", "ms"), ("part", "%"))
                for name, what in (("median", "median"), ("min", "least"), ("max", "most"))
            },
        },
    )


def compiling(rows: pd.DataFrame, judged: Sequence[Judged]) -> Table | None:
    """Return what compiling takes, by scene and engine, and how many runs pay for it; None if nothing is.

    A scene is judged by the first of ``judged`` that has it.
    """
    compiled = finished(rows).dropna(subset="compile_time_s").sort_values(["scene", "engine"])
    if compiled.empty:
        return None
    paid = [_paid(row, judged) for _, row in compiled.iterrows()]
    return Table.of(
        "work-precision-compiling",
        "Compiling",
        "Wall time of compiling a scene's kernels on a machine that has none; they are kept from then on. It "
        "is paid for after as many runs as the engine needs to save that time against the cheapest other "
        "one, at the middle one of the errors that both get to; never where the other is cheaper.",
        {
            **head(compiled, "scene", "engine"),
            "time [s]": compiled["compile_time_s"].map(plain),
            **pd.DataFrame(paid, compiled.index, ["at an error of", "against", "paid for after"]),
        },
    )


def _paid(compiled: pd.Series, judged: Sequence[Judged]) -> tuple[str, str, str]:
    """Return at which error, against whom and after how many runs an engine's compiling is paid for."""
    duels = []
    for one in [one for one in judged if compiled["scene"] in one.ladders][:1]:
        rungs, floor = one.ladders[compiled["scene"]]
        own = rungs["engine"] == compiled["engine"]
        for level in levels(rungs, floor):
            mine, other = arrival(rungs[own], level), arrival(rungs[~own], level)
            if mine and other:
                duels.append((f"{number(level)} {words(one.column)[1]}", mine, other))
    if not duels:
        return ABSENT, ABSENT, ABSENT
    error, mine, other = duels[len(duels) // 2]
    saved = other.time_s - mine.time_s
    runs = f"{plain(math.ceil(compiled['compile_time_s'] / saved))} runs" if saved > 0 else "never"
    return error, other.label, runs


def failures(rows: pd.DataFrame) -> Table | None:
    """Return the recorded runs that did not finish, with the reason; None if all did."""
    recorded = rows[rows["round"].isna() & rows["compiled_anew"].isna()]
    table = failures_table(recorded, "work-precision")
    return table and replace(table, reading=f"Recorded runs of a rung that ended early. {table.reading}")

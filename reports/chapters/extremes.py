"""Extreme cases: whether an engine says so where it cannot give the right motion."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import pandas as pd

from reports.look import listed, number, words
from reports.page import Chapter, Claim, Table
from reports.results import QUALITY, Studies, quality_failures, with_columns

Row = Mapping[str, Any]
INTRODUCTION = (
    "A gallery of named cases at the edge of what a solver can do, each with what theory expects. A run is "
    "right or wrong by its largest error, energy balance and constraints; a clear error misleads nobody."
)
#: What theory asks for in an extreme case, in words.
WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or an error that names step or numbers",
    "refusal": "a refusal",
    "stop": "an error at the right time, or a way on",
}
#: How a run came out: well, or not; by a status; from good to bad: what misleads is worse than what does not.
RIGHT, REFUSED, FAILED = WELL = ("right", "refused", "clear error")
NOTICED, INACCURATE, OBSCURE = "wrong, found by a check", "inaccurate", "unclear error"
ENDED, WRONG = ("timed out", "out of memory", "crashed"), "wrong, no error"
VERDICTS = (*WELL, NOTICED, INACCURATE, OBSCURE, *ENDED, WRONG)
#: The numbers that a verdict rests on, each with a column of its bound.
JUDGED = ("relative_error", "unaccounted_energy_part", "constraint_relative")
#: Verdicts on runs that end with word of when and why, the engine's own or that of the check after every run.
TOLD_SO = (FAILED, NOTICED)
#: The columns of the runs that are shown: those that went wrong.
SHOWN = ["case", "configuration", "verdict", "error", "energy", "gaps", "error of"]
#: How a failure tells its time, and to which part of the time.
TIME, TOLD = re.compile(r"\bt = (-?\d[\d.e+-]*) s\b"), 1e-2


def answers(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the study's runs, by the place of their cases, with what is made of them.

    ``reason`` is the engine's, or else why the check after every run fails it. ``verdict`` is one of the
    ``VERDICTS``, ``as_wanted`` whether theory asks for what came: the motion, or none where there is none.
    """
    rows = with_columns(rows, *JUDGED, "judged").sort_values("place", kind="stable")
    rows[QUALITY] = quality_failures(rows)
    rows["reason"] = rows["reason"].where(rows["reason"] != "", rows[QUALITY])
    for name, of in (("verdict", verdict_on), ("as_wanted", _as_wanted)):
        rows[name] = pd.Series([of(row) for _, row in rows.iterrows()], rows.index)
    return rows


def verdict_on(row: Row) -> str:
    """Return the verdict on a row.

    A success is wrong, and noticed, if the check after every run fails it. Others are wrong if a number is
    missing, for those that are not finite are no numbers, if motion, energy or constraints are off by more
    than ``nonsense_factor`` times their bounds, or if theory knows of no answer. One is right if nothing
    exceeds its bound. A failure is clear if it tells when: a time, or that it is the initial state's.
    """
    if row["status"] in ENDED:
        return str(row["status"])
    if row["status"] == "unsupported":
        return REFUSED
    if row["status"] != "ok":
        told = TIME.search(row["reason"]) or row["reason"].startswith("initial ")
        return FAILED if told else OBSCURE
    if row[QUALITY]:
        return NOTICED
    excess = pd.Series({name: row[name] / row[f"{name}_bound"] for name in JUDGED})
    if row["wanted"] == "refusal" or not (excess <= row["nonsense_factor"]).all():
        return WRONG
    return RIGHT if (excess <= 1).all() else INACCURATE


def _as_wanted(row: Row) -> bool:
    verdict, wanted = row["verdict"], row["wanted"]
    if wanted == "refusal":
        return verdict in (REFUSED, *TOLD_SO)
    if wanted == "stop" and verdict in TOLD_SO:
        time = TIME.search(row["reason"])
        return bool(time and abs(float(time[1]) - row["stop_s"]) <= row["step_s"] * (1 + TOLD))
    return verdict == RIGHT or (wanted == "answer or word" and verdict in (REFUSED, *TOLD_SO))


def parts(studies: Studies) -> Iterator[Claim | Table | None]:
    """Yield who returns wrong results, counts of verdicts, and the runs that went wrong."""
    answered = answers(studies["extremes"].rows)
    by_label = answered.groupby("label", observed=True)
    counts = pd.crosstab(answered["label"], answered["verdict"])
    counts = counts[[verdict for verdict in VERDICTS if verdict in counts]]
    counts.insert(0, "cases", by_label.size())
    yield wrong_without_error(counts, answered["nonsense_factor"].iloc[0])
    counts["as theory asks"] = by_label["as_wanted"].sum()
    table = counts.rename_axis("configuration").reset_index()
    yield Table("extremes-counts", "What came of the extreme cases?", "", "extremes", table)
    every = verdicts(answered)
    wrong = every.rows.loc[~answered["verdict"].isin(WELL).to_numpy(), SHOWN]
    yield replace(every, name="extremes-wrong", title="Which runs went wrong?", rows=wrong, shown=True)
    yield every


def wrong_without_error(counts: pd.DataFrame, factor: float) -> Claim:
    """Return how often each configuration returned a wrong result without an error, the most often first."""
    wrong = counts.get(WRONG, 0 * counts["cases"]).sort_values(ascending=False, kind="stable")
    told = [f"{label} in {{n{k}}} of {counts['cases'][label]}" for k, label in enumerate(wrong.index)]
    numbers = {"factor": (factor, "")} | {f"n{k}": (int(count), "") for k, count in enumerate(wrong)}
    text = "Results wrong by over {factor} times a bound, or given where no motion exists, without an error: "
    return Claim("wrong-results", f"{text}{listed(told)} extreme cases.", numbers)


def verdicts(answered: pd.DataFrame) -> Table:
    """Return every run: the verdict, the numbers that it rests on, the engine's reason, and theory's word."""
    bounds = [f"{answered[f'{bound}_bound'].max():g}" for bound in JUDGED]
    caption = "Right: error up to {} of the signal, energy {} of that in play, gaps {} of the crank's length."
    table = pd.DataFrame(
        {
            "case": answered["scene"],
            "configuration": answered["label"].astype(str),
            "verdict": answered["verdict"],
            **dict(zip(("error", "energy", "gaps"), (answered[of] for of in JUDGED), strict=True)),
            "error of": [words(of)[0] if isinstance(of, str) else "" for of in answered["judged"]],
            "reason": answered["reason"].str.split(" with step ").str[0],
            "asked for": answered["wanted"].map(WANTED),
            "theory": answered["theory"],
        }
    )
    formats = dict.fromkeys(("error", "energy", "gaps"), number)
    title, caption = "Every run of an extreme case", caption.format(*bounds)
    return Table("extremes-verdicts", title, caption, "extremes", table, formats, shown=False)


CHAPTER = Chapter("extremes", "Extreme cases", ("extremes",), INTRODUCTION, parts)

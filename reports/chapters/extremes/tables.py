"""Tables of the gallery: verdicts counted, what theory expects, and every run with its reason."""

import pandas as pd

from reports.chapters.extremes.verdict import CONSTRAINT, ENERGY, JUDGED, Verdict
from reports.parts import Table
from reports.shared_tables import head
from reports.tables import ABSENT, number

WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or word that the step is too long",
    "refusal": "a refusal",
    "stop": "a stop in time, or the smooth branch",
}


def counts(answers: pd.DataFrame) -> Table:
    """Return how often each verdict fell on each engine and arm."""
    arms = answers.drop_duplicates("label").sort_values("label")
    by_label = answers.groupby("label", observed=True)
    tally = {
        "cases": by_label.size(),
        **{
            verdict.value: (answers["verdict"] == verdict).groupby(answers["label"], observed=True).sum()
            for verdict in Verdict
            if (answers["verdict"] == verdict).any()
        },
        "as theory asks": by_label["as_wanted"].sum(),
    }
    reading = (
        "“As theory asks” counts what is right, refusals where there is no motion, and failures that say so "
        "in time where it ends or where the step is too long."
    )
    cells = {**head(arms, "engine", "arm"), **{name: of.map(str) for name, of in tally.items()}}
    return Table.of("extremes-counts", "Verdicts by engine", reading, cells)


def expectations(answers: pd.DataFrame) -> Table:
    """Return what theory expects of every case."""
    cases = answers.drop_duplicates("scene")
    return Table.of(
        "extremes-expectations",
        "What theory expects",
        "What an exact solver would do, and what is asked of an engine.",
        {
            "group": cases["group"],
            "case": cases["scene"],
            "asked for": cases["wanted"].map(WANTED),
            "theory": cases["theory"],
        },
    )


def verdicts(answers: pd.DataFrame) -> Table:
    """Return every run: its verdict, the numbers that it rests on, and the engine's reason."""
    motion, energy, constraint, nonsense = (
        answers[name].iloc[0] for name in (*(f"{name}_bound" for name in JUDGED), "nonsense_factor")
    )
    reading = (
        f"Errors are relative to the motion's own size; right is below {motion:g}. "
        "Energy that no physics accounts for is in parts of the largest energy there is, right below "
        f"{energy:g}; constraints in parts of the crank's length, right below {constraint:g}. Beyond "
        f"{nonsense:g} times these two a run is nonsense. Reasons are the engines' own words."
    )
    cells = {
        "case": answers["scene"],
        **head(answers, "engine", "arm"),
        "longest step [s]": answers["step_s"].map(number),
        "verdict": [verdict.value for verdict in answers["verdict"]],
        "error": answers[JUDGED[0]].map(number),
        "of what": answers["judged"].fillna(ABSENT),
        "energy": answers[ENERGY].map(number),
        "constraints": answers[CONSTRAINT].map(number),
        "reason": answers["reason"].replace("", ABSENT),
    }
    return Table.of("extremes-verdicts", "Every run", reading, cells)

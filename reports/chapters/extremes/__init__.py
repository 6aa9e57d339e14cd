"""The gallery of extremes on the page: one matrix, and why each verdict fell."""

from collections.abc import Iterator

import pandas as pd

from reports.chapters.extremes.matrix import verdict_matrix
from reports.chapters.extremes.verdict import CONSTRAINT, ENERGY, JUDGED, Verdict, answers
from reports.parts import Figure, Section, Table, stated
from reports.results import Results
from reports.shared_tables import head
from reports.style import labels
from reports.tables import ABSENT, in_text, number

STUDY = "extremes"
TITLE = "Extremes"
INTRODUCTION = (
    "A gallery of cases at the edge of what can be simulated, or beyond. Theory says what an exact solver "
    "would do; every engine runs every case in a process of its own with limits on time and memory, so that "
    "a crash or a hang is a verdict and not the end. Engines take the step they would take at ordinary "
    "numbers, or one that theory asks for; those that choose their steps choose. A wrong number told with "
    "confidence is worse than a refusal, and the verdicts are ordered so. Nonsense is noticed where the "
    "check fails it that `crankslider simulate` makes after every run of every engine."
)
REFERENCE = "reference (default)"
#: Ways to end that no engine chooses.
ENDED = (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)
#: What theory asks for, in words.
WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or word that the step is too long",
    "refusal": "a refusal",
    "stop": "a stop in time, or the smooth branch",
}


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    answered = answers(results.rows)
    figure = Figure(
        "extremes-matrix",
        "Verdicts, case by case",
        "A cell is a run; dark is bad. A frame marks what theory asks for: the motion (✓), a refusal where "
        "there is none (⊘), a stop at the time when it is determined no more (F), word that the step is too "
        "long (✓ F). Numbers are relative errors of what is inaccurate: of the motion, of energy (E), of "
        "constraints (C).",
        f"Matrix of {answered['scene'].nunique()} named cases against {', '.join(labels(answered))}, a "
        "symbol and a shade per verdict, with theory's expectation beside each case.",
        verdict_matrix(answered),
    )
    text = (*_sound(answered), *_outcomes(answered), *_reference(answered))
    gallery = Section("gallery", "The gallery", text, (figure,), (counts(answered),))
    shown = (expectations(answered), verdicts(answered))
    return [gallery, Section("cases", "Case by case", (), (), shown)]


def _sound(answered: pd.DataFrame) -> Iterator[str]:
    """Yield what is true of all verdicts."""
    sound = answered[answered["verdict"].isin((Verdict.RIGHT, Verdict.INACCURATE))]
    if len(sound):
        energy, constraint = sound[ENERGY].max(), sound[CONSTRAINT].max()
        bounds = sound[[f"{ENERGY}_bound", f"{CONSTRAINT}_bound"]].iloc[0] * sound["nonsense_factor"].iloc[0]
        sentence = (
            f"{len(answered)} runs of {answered['scene'].nunique()} cases all ended in a verdict. None that "
            f"counts as right or inaccurate leaves more than {in_text(energy)} of its energy unaccounted "
            f"for, or opens a joint by more than {in_text(constraint)} of the crank's length."
        )
        yield stated(sentence, bool((bounds >= [energy, constraint]).all()))
    ended = answered[answered["verdict"].isin(ENDED)]
    if ended.empty:
        yield "No run crashed, ran out of memory, or had to be stopped."
    else:
        ends = (f"{row['label']} {row['verdict'].value} on {row['scene']}" for _, row in ended.iterrows())
        yield f"Contained: {'; '.join(ends)}."


def _outcomes(answered: pd.DataFrame) -> Iterator[str]:
    """Yield for every label what it gave without a word of warning that was nonsense."""
    for label, of_label in answered.groupby("label", observed=True):
        asked = f"{label} does what theory asks in {of_label['as_wanted'].sum()} of {len(of_label)} cases"
        noticed, nonsense = (
            of_label["scene"][of_label["verdict"] == verdict]
            for verdict in (Verdict.NOTICED, Verdict.NONSENSE)
        )
        found = [
            f"returns nonsense {how} in {len(cases)}: {'; '.join(cases)}"
            for how, cases in (("that the check notices", noticed), ("that nothing notices", nonsense))
            if len(cases)
        ]
        yield f"{asked}, and {', and '.join(found) or 'never returns nonsense'}."


def _reference(answered: pd.DataFrame) -> Iterator[str]:
    """Yield where the reference stops, for want of a motion or of a step short enough."""
    stopped = answered[(answered["label"] == REFERENCE) & (answered["verdict"] == Verdict.FAILED)]
    if len(stopped):
        reasons = stopped["reason"].str.split(":").str[0].str.split(", q =").str[0]
        stops = stopped["scene"] + " (" + reasons + ")"
        yield f"The reference stops with a reason in: {'; '.join(stops)}."


def counts(answers: pd.DataFrame) -> Table:
    """Return how often each verdict fell on each engine and arm."""
    arms = answers.drop_duplicates("label").sort_values("label")
    by_label = answers.groupby("label", observed=True)
    names = [verdict.value for verdict in Verdict if (answers["verdict"] == verdict).any()]
    tally = pd.crosstab(answers["label"], answers["verdict"].map(lambda verdict: verdict.value))[names]
    tally.insert(0, "cases", by_label.size())
    tally["as theory asks"] = by_label["as_wanted"].sum()
    reading = (
        "“As theory asks” counts what is right, refusals where there is no motion, and failures that say so "
        "in time where it ends or where the step is too long, by the engine or by the check after the run."
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
        f"{nonsense:g} times these two a run is nonsense. Reasons are the engines' own words, or the "
        "check's."
    )
    cells = {
        "case": answers["scene"],
        **head(answers, "engine", "arm"),
        "longest step [s]": answers["step_s"].map(number),
        "verdict": [verdict.value for verdict in answers["verdict"]],
        "error": answers[JUDGED[0]].map(number),
        "of what": answers["judged"].astype(object).fillna(ABSENT),
        "energy": answers[ENERGY].map(number),
        "constraints": answers[CONSTRAINT].map(number),
        "reason": answers["reason"].replace("", ABSENT),
    }
    return Table.of("extremes-verdicts", "Every run", reading, cells)

"""The gallery of extremes on the page: one matrix, and why each verdict fell."""

from collections.abc import Iterator

import pandas as pd

from reports.chapters.extremes.matrix import verdict_matrix
from reports.chapters.extremes.verdict import CONSTRAINT, ENERGY, JUDGED, MODEL, Verdict, answers
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
    "confidence is worse than a refusal, and the verdicts are ordered so. A wrong result is noticed where "
    "the check fails it that `crankslider simulate` makes after every run of every engine. That check is a "
    "guard of ours, as are those of the start and of Pymunk's joints, pins and rod: with guards off every "
    "run is made again, and where a guard spoke the gallery shows what the engine does by itself."
)
REFERENCE = "reference (default)"
#: Ways to end that no engine chooses.
ENDED = (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)
#: What theory asks for, in words.
WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or word that step or numbers are none to run with",
    "refusal": "a refusal",
    "stop": "a stop in time, or the smooth branch",
}


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    answered = answers(results.rows)
    figure = Figure(
        "extremes-matrix",
        "Verdicts, case by case",
        "A cell is a run; dark is bad. In a divided cell a guard of ours speaks on the left; on the right is "
        "what the engine does without it. A frame marks what theory asks for: the motion (✓), a refusal "
        "where there is none (⊘), a stop at the time when it is determined no more (F), word that there is "
        "no running with the step or the numbers (✓ F). Numbers are relative errors of what is inaccurate: "
        "of the motion, of energy (E), of constraints (C). A cell that is pointed at, or tapped, tells why.",
        f"Matrix of {answered['scene'].nunique()} named cases against {', '.join(labels(answered))}, a "
        "symbol and a shade per verdict, with theory's expectation beside each case.",
        verdict_matrix(answered),
        dense=True,
    )
    text = (*_sound(answered), *_outcomes(answered), *_reference(answered))
    gallery = Section("gallery", "The gallery", text, (figure,), (counts(answered),))
    shown = (expectations(answered), verdicts(answered))
    return [gallery, *_guards(answered), Section("cases", "Case by case", (), (), shown)]


def _guards(answered: pd.DataFrame) -> Iterator[Section]:
    spoke = answered[answered["unguarded"].notna()]
    if len(spoke):
        yield Section("guards", "Without our guards", tuple(unguarded(spoke)), (), (guards(spoke),))


def unguarded(spoke: pd.DataFrame) -> Iterator[str]:
    """Yield for every label what it does in the runs that a guard ended or failed."""
    for label, of_label in spoke.groupby("label", observed=True):
        passed = of_label[of_label["came"].str.startswith("success")]
        text = f"Of the runs of {label} guards end or fail {len(of_label)}."
        yield f"{text} Without them it reports success in {len(passed)}." if len(passed) else text


def _sound(answered: pd.DataFrame) -> Iterator[str]:
    """Yield what is true of all verdicts."""
    sound = answered[answered["verdict"].isin((Verdict.RIGHT, Verdict.INACCURATE))]
    if len(sound):
        energy, constraint = sound[ENERGY].max(), sound[CONSTRAINT].max()
        bounds = sound[[f"{ENERGY}_bound", f"{CONSTRAINT}_bound"]].iloc[0] * sound["nonsense_factor"].iloc[0]
        sentence = (
            f"{len(answered)} runs of {answered['scene'].nunique()} cases all ended in a verdict. None that "
            f"counts as right or inaccurate leaves more than {in_text(energy)} of the energy in play "
            f"unaccounted for, or opens a joint by more than {in_text(constraint)} of the crank's length."
        )
        yield stated(sentence, bool((bounds >= [energy, constraint]).all()))
    ended = answered[answered["verdict"].isin(ENDED)]
    if ended.empty:
        yield "No run crashed, ran out of memory, or had to be stopped."
    else:
        ends = (f"{row['label']} {row['verdict'].value} on {row['scene']}" for _, row in ended.iterrows())
        yield f"Contained: {'; '.join(ends)}."


def _outcomes(answered: pd.DataFrame) -> Iterator[str]:
    """Yield for every label what it does, with our guards and without, and where its results are wrong."""
    for label, of_label in answered.groupby("label", observed=True):
        asked = of_label[of_label["told_by"] != MODEL]
        wanted, bare = asked["as_wanted"].sum(), asked["wanted_unguarded"].sum()
        yield f"{label} does what theory asks in {wanted} of {len(asked)} cases."
        if bare != wanted:
            yield f"Without our guards {label} would in {bare}."
        if len(asked) < len(of_label):
            yield f"Cases that our model of {label} does not express: {len(of_label) - len(asked)}."
        for how, verdict in (("that the check notices", Verdict.NOTICED), ("as a success", Verdict.WRONG)):
            cases = of_label["scene"][of_label["verdict"] == verdict]
            if len(cases):
                yield f"{label} returns a wrong result {how} in: {'; '.join(cases)}."


def _reference(answered: pd.DataFrame) -> Iterator[str]:
    """Yield where the reference stops, for want of a motion or of a step; the table has its reasons."""
    stopped = answered[(answered["label"] == REFERENCE) & (answered["verdict"] == Verdict.FAILED)]
    if len(stopped):
        yield f"The reference stops with a reason in: {'; '.join(stopped['scene'])}."


def counts(answers: pd.DataFrame) -> Table:
    """Return how often each verdict fell on each engine and arm."""
    arms = answers.drop_duplicates("label").sort_values("label")
    by_label = answers.groupby("label", observed=True)
    names = [verdict.value for verdict in Verdict if (answers["verdict"] == verdict).any()]
    tally = pd.crosstab(answers["label"], answers["verdict"].map(lambda verdict: verdict.value))[names]
    tally.insert(0, "cases", by_label.size())
    tally["by our model"] = (answers["told_by"] == MODEL).groupby(answers["label"], observed=True).sum()
    tally["as theory asks"] = by_label["as_wanted"].sum()
    tally["by guards"] = by_label["unguarded"].count()
    tally["as theory asks without them"] = by_label["wanted_unguarded"].sum()
    reading = (
        "“As theory asks” counts what is right, refusals where there is no motion, and failures that say so "
        "in time where it ends or where step or numbers are none to run with, by the engine or by a guard. "
        "“By our model” counts cases that our model of the engine does not express, which is no failure of "
        "the engine; “by guards” runs that a guard of ours ended or failed."
    )
    cells = {**head(arms, "engine", "arm"), **{name: of.map(str) for name, of in tally.items()}}
    return Table.of("extremes-counts", "Verdicts by engine", reading, cells)


def guards(spoke: pd.DataFrame) -> Table:
    """Return what guards said, and what comes of the same runs without them."""
    return Table.of(
        "extremes-guards",
        "Without our guards",
        "Guards are checks of ours that end a run with which its engine would go on, or that fail one that "
        "has ended. What came is what the engine returns when they are off.",
        {
            "case": spoke["scene"],
            **head(spoke, "engine", "arm"),
            "the guard": spoke["reason"],
            "verdict": [verdict.value for verdict in spoke["unguarded"]],
            "what came": spoke["came"],
        },
    )


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
    motion, energy, constraint, wrong = (
        answers[name].iloc[0] for name in (*(f"{name}_bound" for name in JUDGED), "nonsense_factor")
    )
    reading = (
        f"Errors are relative to the motion's own size; right is below {motion:g}. "
        "Energy that no physics accounts for is in parts of that in play, right below "
        f"{energy:g}; constraints in parts of the crank's length, right below {constraint:g}. Beyond "
        f"{wrong:g} times one of these a success is wrong. The reason is told by the engine itself, by a "
        "guard of ours, by our model of the engine where that has no such law, or by the scene's own check "
        "before any engine."
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
        "told by": answers["told_by"].replace("", ABSENT),
        "reason": answers["reason"].replace("", ABSENT),
    }
    return Table.of("extremes-verdicts", "Every run", reading, cells)

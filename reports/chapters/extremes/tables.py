"""Tables of the gallery: verdicts counted, what theory expects, and every run with its reason."""

from collections import Counter
from collections.abc import Sequence

from reports.chapters.extremes.verdict import CONSTRAINT, ENERGY, JUDGED, Answer, Verdict, cases
from reports.parts import Table
from reports.style import ordered
from reports.tables import ABSENT, error, number

WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or word that the step is too long",
    "refusal": "a refusal",
    "stop": "a stop in time, or the smooth branch",
}


def counts(found: Sequence[Answer]) -> Table:
    """Return how often each verdict fell on each engine and arm."""
    names = ordered(answer.run.name for answer in found)
    tally = Counter((answer.run.name, answer.verdict) for answer in found)
    wanted = Counter(answer.run.name for answer in found if answer.as_wanted)
    used = [verdict for verdict in Verdict if any(answer.verdict is verdict for answer in found)]
    rows = [
        (
            *name,
            str(sum(tally[name, v] for v in used)),
            *(str(tally[name, v]) for v in used),
            str(wanted[name]),
        )
        for name in names
    ]
    head = ("engine", "arm", "cases", *(verdict.value for verdict in used), "as theory asks")
    reading = (
        "“As theory asks” counts what is right, refusals where there is no motion, and failures that say so "
        "in time where it ends or where the step is too long."
    )
    return Table("extremes-counts", "Verdicts by engine", reading, head, tuple(rows))


def expectations(found: Sequence[Answer]) -> Table:
    """Return what theory expects of every case."""
    rows = []
    for case, by_name in cases(found).items():
        answer = next(iter(by_name.values()))
        words = answer.words
        rows.append((words["group"], case, WANTED[words["wanted"]], words["theory"]))
    reading = "What an exact solver would do, and what is asked of an engine."
    head = ("group", "case", "asked for", "theory")
    return Table("extremes-expectations", "What theory expects", reading, head, tuple(rows))


def verdicts(found: Sequence[Answer]) -> Table:
    """Return every run: its verdict, the numbers that it rests on, and the engine's reason."""
    rows = []
    for case, by_name in cases(found).items():
        for name in ordered(by_name):
            run, words = by_name[name].run, by_name[name].words
            numbers = [error(run.values.get(column)) for column in JUDGED]
            step = number(run.step_s)
            reason = run.reason or ABSENT
            verdict = by_name[name].verdict.value
            rows.append(
                (case, *name, step, verdict, numbers[0], words.get("judged", ABSENT), *numbers[1:], reason)
            )
    head = ("case", "engine", "arm", "longest step [s]", "verdict", "error", "of what")
    bounds = next((a.run.values for a in found), {})
    reading = (
        f"Errors are relative to the motion's own size; right is below {bounds[f'{JUDGED[0]}_bound']:g}. "
        "Energy that no physics accounts for is in parts of the largest energy there is, right below "
        f"{bounds[f'{ENERGY}_bound']:g}; constraints in parts of the crank's length, right below "
        f"{bounds[f'{CONSTRAINT}_bound']:g}. Beyond {bounds['nonsense_factor']:g} times these two a run is "
        "nonsense. Reasons are the engines' own words."
    )
    columns = (*head, "energy", "constraints", "reason")
    return Table("extremes-verdicts", "Every run", reading, columns, tuple(rows))

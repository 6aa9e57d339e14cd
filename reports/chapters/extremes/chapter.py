"""The gallery of extremes on the page: one matrix, and why each verdict fell."""

from collections.abc import Sequence

from reports.chapters.extremes import tables
from reports.chapters.extremes.matrix import matrix
from reports.chapters.extremes.verdict import CONSTRAINT, ENERGY, Answer, Verdict, answers, cases
from reports.parts import Figure, Section, stated
from reports.results import Results
from reports.style import ordered, title
from reports.tables import in_text

TITLE = "Extremes"
INTRODUCTION = (
    "A gallery of cases at the edge of what can be simulated, or beyond. Theory says what an exact solver "
    "would do; every engine runs every case in a process of its own with limits on time and memory, so that "
    "a crash or a hang is a verdict and not the end. Engines take the step they would take at ordinary "
    "numbers, or one that theory asks for; those that choose their steps choose. A wrong number told with "
    "confidence is worse than a refusal, and the verdicts are ordered so."
)
REFERENCE = ("reference", "default")
#: Ways to end that no engine chooses.
ENDED = (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    found = answers(results)
    text = (*_sound(found), *_outcomes(found), *_reference(found))
    names = ", ".join(title(name) for name in ordered(answer.run.name for answer in found))
    figure = Figure(
        "extremes-matrix",
        "Verdicts, case by case",
        "A cell is a run; dark is bad. A frame marks what theory asks for: the motion (✓), a refusal where "
        "there is none (⊘), a stop at the time when it is determined no more (F), word that the step is too "
        "long (✓ F). Numbers are relative errors of what is inaccurate: of the motion, of energy (E), of "
        "constraints (C).",
        f"Matrix of {len(cases(found))} named cases against {names}, a symbol and a shade per verdict, "
        "with theory's expectation beside each case.",
        matrix(found),
    )
    gallery = Section("gallery", "The gallery", text, (figure,), (tables.counts(found),))
    shown = (tables.expectations(found), tables.verdicts(found))
    return [gallery, Section("cases", "Case by case", (), (), shown)]


def _sound(found: Sequence[Answer]) -> list[str]:
    """Return what is true of all verdicts."""
    kept = [a.run.values for a in found if a.verdict in (Verdict.RIGHT, Verdict.INACCURATE)]
    out = []
    if kept:
        energy, constraint = (max(values[column] for values in kept) for column in (ENERGY, CONSTRAINT))
        factor = kept[0]["nonsense_factor"]
        within = (
            energy <= factor * kept[0][f"{ENERGY}_bound"]
            and constraint <= factor * kept[0][f"{CONSTRAINT}_bound"]
        )
        sentence = (
            f"{len(found)} runs of {len(cases(found))} cases all ended in a verdict. None that counts as "
            f"right or inaccurate leaves more than {in_text(energy)} of its energy unaccounted for, or opens "
            f"a joint by more than {in_text(constraint)} of the crank's length."
        )
        out.append(stated(sentence, within))
    ended = [answer for answer in found if answer.verdict in ENDED]
    if not ended:
        return [*out, "No run crashed, ran out of memory, or had to be stopped."]
    told = "; ".join(f"{title(a.run.name)} {a.verdict.value} on {a.run.scene}" for a in ended)
    return [*out, f"Contained: {told}."]


def _outcomes(found: Sequence[Answer]) -> list[str]:
    """Return for every engine and arm what it gave without a word of warning that was nonsense."""
    out = []
    for name in ordered(answer.run.name for answer in found):
        mine = [answer for answer in found if answer.run.name == name]
        asked = sum(answer.as_wanted for answer in mine)
        nonsense = [answer.run.scene for answer in mine if answer.verdict is Verdict.NONSENSE]
        text = f"{title(name)} does what theory asks in {asked} of {len(mine)} cases"
        if nonsense:
            out.append(
                f"{text}, and returns nonsense without a word in {len(nonsense)}: {'; '.join(nonsense)}."
            )
        else:
            out.append(f"{text}, and never returns nonsense.")
    return out


def _reference(found: Sequence[Answer]) -> list[str]:
    """Return where the reference stops, for want of a motion or of a step short enough."""
    stopped = [a for a in found if a.run.name == REFERENCE and a.verdict is Verdict.FAILED]
    if not stopped:
        return []
    told = "; ".join(f"{a.run.scene} ({a.run.reason.split(':')[0].split(', q =')[0]})" for a in stopped)
    return [f"The reference stops with a reason in: {told}."]

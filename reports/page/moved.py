"""What moved between two reports: claims that are new or gone, and numbers that changed."""

import math
from collections.abc import Iterator, Sequence

from reports.page.claims import Claim
from reports.parts import Number

#: Numbers are written with two digits in sentences; what changes less than that has not moved.
DIGITS = 0.05


def moved(old: Sequence[Claim], new: Sequence[Claim]) -> list[str]:
    """Return in lines what is otherwise in the new claims, each number with its uncertainty."""
    before, after = ({claim.id: claim for claim in claims} for claims in (old, new))
    lines = [
        line for name, claim in after.items() if name in before for line in _changes(before[name], claim)
    ]
    lines += [f"new  {name}: {claim.text}" for name, claim in after.items() if name not in before]
    lines += [f"gone {name}: {claim.text}" for name, claim in before.items() if name not in after]
    return lines


def _changes(old: Claim, new: Claim) -> Iterator[str]:
    """Yield the numbers of a claim that moved, or that it says something else with the same numbers."""
    pairs = list(zip(old.numbers, new.numbers, strict=False))
    changes = [pair for pair in pairs if _differ(*pair)]
    if changes:
        for one, other in changes:
            verdict = "within uncertainty" if _overlap(one, other) else "moved"
            yield f"{verdict} {new.id}: {_shown(one)} -> {_shown(other)}"
    elif len(old.numbers) != len(new.numbers) or (old.text != new.text and not pairs):
        yield f"says {new.id}: {old.text} -> {new.text}"


def _differ(one: Number, other: Number) -> bool:
    return one.unit != other.unit or not math.isclose(one.value, other.value, rel_tol=DIGITS)


def _overlap(one: Number, other: Number) -> bool:
    """Return whether the intervals of two numbers meet; one without has a width of zero."""
    ends = [
        (each.value if each.low is None else each.low, each.value if each.high is None else each.high)
        for each in (one, other)
    ]
    return one.unit == other.unit and max(low for low, _ in ends) <= min(high for _, high in ends)


def _shown(of: Number) -> str:
    interval = "" if of.low is None or of.high is None else f" ({of.low:.3g} to {of.high:.3g})"
    return f"{of.value:.3g}{of.unit and ' ' + of.unit}{interval}"

"""The verdict on an engine: every claim on every scene that it runs, and what was found."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from typing import NamedTuple, TypeVar

from engine_models.engine import Engine, UnsupportedScene
from studies.conformance.claims import CLAIMS, Finding, Trial
from studies.conformance.mechanisms import NAMES, scene_of
from studies.conformance.orders import states_its_accuracy, states_its_order

Subject = TypeVar("Subject")


class Verdict(NamedTuple):
    """A claim on a scene; ``scene`` is empty where a claim is about the engine."""

    claim: str
    scene: str
    finding: Finding


#: The claims about an engine, by their sentences.
OF_ENGINE: dict[str, Callable[[Engine], Finding]] = {
    str(claim.__doc__).rstrip("."): claim for claim in (states_its_order, states_its_accuracy)
}


def scenes_of(engine: Engine) -> list[str]:
    """Return the scenes that an engine runs."""
    runs = []
    for name in NAMES:
        with suppress(UnsupportedScene):
            engine.check(scene_of(name))
            runs.append(name)
    return runs


def count(engine: Engine) -> int:
    """Return how many verdicts there are on an engine."""
    return len(OF_ENGINE) + len(CLAIMS) * len(scenes_of(engine))


def verdicts(engine: Engine) -> Iterator[Verdict]:
    """Yield the verdicts on an engine, scene by scene."""
    for claim, holds_of in OF_ENGINE.items():
        yield Verdict(claim, "", tried(holds_of, engine))
    for scene in scenes_of(engine):
        trial = Trial(engine, scene_of(scene))
        for claim, holds in CLAIMS.items() if not trial.refusal else ():
            yield Verdict(claim, scene, tried(holds, trial))


def tried(claim: Callable[[Subject], Finding], subject: Subject) -> Finding:
    """Return what a claim found, which does not hold where the engine raises anything."""
    try:
        return claim(subject)
    except Exception as error:
        return Finding(False, f"{type(error).__name__}: {error}")


def summary(verdicts: Iterable[Verdict]) -> tuple[list[str], bool]:
    """Return a line for each claim, below it those scenes on which it does not hold, and whether all do."""
    by_claim: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        by_claim.setdefault(verdict.claim, []).append(verdict)
    lines = []
    for claim, ones in by_claim.items():
        failed = [one for one in ones if not one.finding.holds]
        held = f"{len(ones) - len(failed)} of {len(ones)} scenes"
        found = held if ones[0].scene else ones[0].finding.measured
        lines.append(f"{'FAILS' if failed else 'holds'}  {claim}: {found}")
        lines += [f"         {one.scene}: {one.finding.measured}" for one in failed if one.scene]
    return lines, all(line.startswith(("holds", " ")) for line in lines)

"""The verdict on a run of the gallery, from its row alone."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from reports.results import Results, Run
from reports.style import Name


class Verdict(Enum):
    """How a run came out, from good to bad: what misleads nobody is better than what does."""

    RIGHT = "right"
    REFUSED = "refused"
    FAILED = "failed clearly"
    INACCURATE = "inaccurate"
    FAILED_OBSCURELY = "failed obscurely"
    TIMED_OUT = "timed out"
    OUT_OF_MEMORY = "out of memory"
    CRASHED = "crashed"
    NONSENSE = "nonsense"


#: The numbers that a verdict rests on, each with a column of its bound.
JUDGED = ("relative_error", "energy_relative", "constraint_relative")
ENERGY, CONSTRAINT = JUDGED[1:]
#: How a failure tells its time.
_TIME = re.compile(r"\bt = -?\d[\d.e+-]* s\b")
#: A failure tells its time to six digits.
TOLD = 1e-2
_ENDED = {v.value: v for v in (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)}


@dataclass(frozen=True)
class Answer:
    """A run of the gallery with the words of its row: ``group``, ``theory``, ``wanted``, ``judged``."""

    run: Run
    words: Mapping[str, str]

    @property
    def verdict(self) -> Verdict:
        """The verdict; see ``verdict_on``."""
        return verdict_on(self.run, self.words["wanted"])

    @property
    def as_wanted(self) -> bool:
        """Whether theory asks for no more than what came: the motion, or no motion where there is none."""
        verdict, wanted = self.verdict, self.words["wanted"]
        if wanted == "refusal":
            return verdict in (Verdict.REFUSED, Verdict.FAILED)
        if wanted == "stop" and verdict is Verdict.FAILED:
            late = _told_time(self.run.reason) - self.run.values["stop_s"]
            return abs(late) <= self.run.step_s * (1 + TOLD)
        return verdict is Verdict.RIGHT or (wanted == "answer or word" and verdict is Verdict.FAILED)

    @property
    def worst(self) -> str | None:
        """Which of the numbers exceeds its bound most, None where there are none."""
        values = self.run.values
        there = [name for name in JUDGED if name in values]
        return max(there, key=lambda name: values[name] / values[f"{name}_bound"], default=None)


def _told_time(reason: str) -> float:
    found = _TIME.search(reason)
    return float(found[0].removeprefix("t = ").removesuffix(" s")) if found else float("inf")


def verdict_on(run: Run, wanted: str) -> Verdict:
    """Return the verdict on a run.

    An answer is nonsense if a number is missing, for those that are not finite are no numbers, if energy or
    constraints are off by more than ``nonsense_factor`` times their bounds, or if theory knows of no answer.
    It is right if nothing exceeds its bound. A failure is clear if it tells when.
    """
    if run.status in _ENDED:
        return _ENDED[run.status]
    if run.status == "unsupported":
        return Verdict.REFUSED
    if not run.ok:
        return Verdict.FAILED if _TIME.search(run.reason) else Verdict.FAILED_OBSCURELY
    if wanted == "refusal" or any(name not in run.values for name in JUDGED):
        return Verdict.NONSENSE
    excess = {name: run.values[name] / run.values[f"{name}_bound"] for name in JUDGED}
    if max(excess[ENERGY], excess[CONSTRAINT]) > run.values["nonsense_factor"]:
        return Verdict.NONSENSE
    return Verdict.RIGHT if max(excess.values()) <= 1 else Verdict.INACCURATE


def answers(results: Results) -> list[Answer]:
    """Return the study's runs with their words, by the place of their cases in the gallery."""
    text = (results.folder / "rows.jsonl").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in text.splitlines(keepends=True) if line.endswith("\n")]
    words = {
        row["case"]: {name: value for name, value in row.items() if isinstance(value, str)} for row in rows
    }
    found = [Answer(run, words[run.case]) for run in results.runs]
    return sorted(found, key=lambda answer: answer.run.values["place"])


def cases(found: Sequence[Answer]) -> dict[str, dict[Name, Answer]]:
    """Return the answers by case, in the gallery's order, and by engine and arm."""
    out: dict[str, dict[Name, Answer]] = {}
    for answer in found:
        out.setdefault(answer.run.scene, {})[answer.run.name] = answer
    return out

"""The order of the page: a reader's questions, and the studies that answer each."""

from dataclasses import dataclass
from typing import Protocol

from reports import gallery
from reports.chapters import agreement, clearance, energy, extremes, predictability, stability, work_precision
from reports.parts import Section
from reports.results import Results


class StudyReport(Protocol):
    """What a study's module provides; ``STUDY`` is the name of its folder."""

    STUDY: str
    TITLE: str
    INTRODUCTION: str

    def sections(self, results: Results) -> list[Section]:
        """Return the study's part of the page."""
        ...


@dataclass(frozen=True)
class Question:
    """A question of a reader, and the studies that answer it; one without results is not on the page."""

    name: str
    title: str
    studies: tuple[StudyReport, ...]


#: A new study is a new module and a word here.
QUESTIONS = (
    Question("mechanism", "The mechanism", (gallery,)),
    Question("right", "How right is each engine?", (agreement, clearance)),
    Question("cost", "What does it cost?", (work_precision,)),
    Question("energy-kept", "Does energy stay?", (energy,)),
    Question("known", "How far can anybody predict, and what holds beyond?", (predictability,)),
    Question("breaks", "Where does each engine break?", (stability, extremes)),
)

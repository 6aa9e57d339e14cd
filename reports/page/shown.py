"""Makes chapters into what the page shows: sentences first, figures drawn and saved, tables written."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl

from reports.chapters.answer import Answer, answer
from reports.chapters.headlines import HEADLINES
from reports.page.figures import Picture, save
from reports.page.questions import QUESTIONS
from reports.parts import Figure, Section, Table
from reports.results import Results
from reports.style import RC
from reports.tables import write_table


@dataclass(frozen=True)
class ShownFigure:
    """A figure on the page: its words, its picture, and the ends of the names of its files."""

    name: str
    title: str
    reading: str
    alt: str
    dense: bool
    card: bool
    picture: Picture
    files: tuple[str, ...]


@dataclass(frozen=True)
class ShownSection:
    """A section whose figures and tables are written."""

    name: str
    title: str
    text: tuple[str, ...]
    figures: tuple[ShownFigure, ...]
    tables: tuple[Table, ...]
    markup: str


@dataclass(frozen=True)
class ShownChapter:
    """A study on the page; ``headline`` is what it finds in a few sentences, ``runs`` how many it has."""

    name: str
    title: str
    introduction: str
    headline: tuple[str, ...]
    sections: tuple[ShownSection, ...]
    sidecar: dict[str, Any] | None
    runs: int


def shown_chapter(name: str, results: Results, folder: Path) -> ShownChapter:
    """Write the figures and tables of a study into ``folder`` and return its chapter."""
    study = next(each for question in QUESTIONS for each in question.studies if name == each.STUDY)
    with mpl.rc_context(RC):
        sections = study.sections(results)
    headline = HEADLINES[name](results) if name in HEADLINES else ()
    return ShownChapter(
        name,
        study.TITLE,
        study.INTRODUCTION,
        tuple(headline),
        tuple(show(section, folder) for section in sections),
        results.sidecar,
        len(results.rows),
    )


def shown_answer(studies: Mapping[str, Results], folder: Path) -> tuple[Answer, ShownSection]:
    """Write the figures and tables of the answer and return it, as it is and as the page shows it."""
    with mpl.rc_context(RC):
        said = answer(studies)
    return said, show(Section("answer", "The answer", said.text, said.figures, said.tables), folder)


def show(section: Section, folder: Path) -> ShownSection:
    """Write the figures and tables of a section and return it without what drew them."""
    figures = tuple(_shown(figure, folder / "figures") for figure in section.figures)
    for table in section.tables:
        write_table(table, folder / "tables")
    return ShownSection(section.name, section.title, section.text, figures, section.tables, section.markup)


def _shown(figure: Figure, folder: Path) -> ShownFigure:
    picture = save(figure, folder)
    return ShownFigure(
        figure.name,
        figure.title,
        figure.reading,
        figure.alt,
        figure.dense,
        figure.card,
        picture,
        picture.files,
    )

"""Makes chapters into what the page shows: sentences first, figures drawn, tables written."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl

from reports.chapters.answer import Answer, answer
from reports.chapters.headlines import HEADLINES
from reports.page.figures import Picture, draw
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


def shown_chapter(name: str, results: Results, folder: Path, paper: bool) -> ShownChapter | None:
    """Write a study's tables, and for a ``paper`` its figures, into ``folder`` and return its chapter."""
    study = next(each for question in QUESTIONS for each in question.studies if name == each.STUDY)
    try:
        with mpl.rc_context(RC):
            sections = study.sections(results)
        headline = tuple(HEADLINES[name](results)) if name in HEADLINES else ()
    except KeyError:
        if results.is_published:
            return None
        raise
    return ShownChapter(
        name,
        study.TITLE,
        study.INTRODUCTION,
        headline,
        tuple(show(section, folder, paper) for section in sections),
        results.sidecar,
        len(results.rows),
    )


def shown_answer(studies: Mapping[str, Results], folder: Path, paper: bool) -> tuple[Answer, ShownSection]:
    """Write the files of the answer and return it, as it is and as the page shows it."""
    with mpl.rc_context(RC):
        said = answer(studies)
    section = Section("answer", "The answer", said.text, said.figures, said.tables)
    return said, show(section, folder, paper)


def show(section: Section, folder: Path, paper: bool) -> ShownSection:
    """Write the files of a section and return it without what drew its figures."""
    figures = tuple(_shown(figure, folder / "figures" if paper else None) for figure in section.figures)
    for table in section.tables:
        write_table(table, folder / "tables", paper)
    return ShownSection(section.name, section.title, section.text, figures, section.tables, section.markup)


def _shown(figure: Figure, folder: Path | None) -> ShownFigure:
    picture = draw(figure, folder)
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

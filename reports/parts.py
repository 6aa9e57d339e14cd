"""What a page is made of. A study's module gives sections; the page writes them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure as Drawing


class Contradiction(Exception):
    """A sentence of the report is not true of the results; the message is the sentence."""


def stated(sentence: str, holds: bool) -> str:
    """Return a sentence that the results bear out.

    Raises:
        Contradiction: they do not.
    """
    if not holds:
        raise Contradiction(f"the results contradict the report's sentence: {sentence}")
    return sentence


class Number(NamedTuple):
    """A number of a finding; ``low`` and ``high`` end its uncertainty, None where there is none."""

    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None


class Finding(str):
    """A sentence that keeps its name from results to results, with its numbers and their uncertainty."""

    name: str
    numbers: tuple[Number, ...]

    def __new__(cls, text: str, name: str = "", numbers: Iterable[Number] = ()) -> "Finding":
        """Return the sentence."""
        finding = super().__new__(cls, text)
        finding.name, finding.numbers = name, tuple(numbers)
        return finding


@dataclass(frozen=True)
class Figure:
    """A figure. ``name`` is its file's, ``reading`` says how to read it, ``alt`` what is on it.

    A ``dense`` one has letters in coloured cells: a page shows it wide, and on paper in the dark as well.
    A ``card`` is small and says what it shows: a page has several of them in a row.
    """

    name: str
    title: str
    reading: str
    alt: str
    drawing: Drawing
    dense: bool = False
    card: bool = False


@dataclass(frozen=True)
class Table:
    """A table of finished text: numbers are rounded once, so that all formats show the same digits."""

    name: str
    title: str
    reading: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(
        cls, name: str, title: str, reading: str, columns: Mapping[str, Iterable[str]] | pd.DataFrame
    ) -> "Table":
        """Return a table of columns, all of one length, by their headings."""
        rows = zip(*(cells for _, cells in columns.items()), strict=True)
        return cls(name, title, reading, tuple(columns), tuple(rows))


@dataclass(frozen=True)
class Section:
    """A part of the page under one heading; ``markup`` is finished HTML that stands below its sentences."""

    name: str
    title: str
    text: tuple[str, ...]
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()
    markup: str = ""

    @classmethod
    def of(
        cls,
        name: str,
        title: str,
        text: Iterable[str],
        figures: Iterable[Figure | None] = (),
        tables: Iterable[Table | None] = (),
    ) -> "Section":
        """Return a section without the figures and tables that there are none of."""
        return cls(name, title, tuple(text), tuple(filter(None, figures)), tuple(filter(None, tables)))

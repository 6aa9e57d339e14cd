"""What a page is made of. A study's module gives sections; the page writes them."""

from dataclasses import dataclass

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


@dataclass(frozen=True)
class Figure:
    """A figure. ``name`` is its file's, ``reading`` says how to read it, ``alt`` what is on it."""

    name: str
    title: str
    reading: str
    alt: str
    drawing: Drawing


@dataclass(frozen=True)
class Table:
    """A table of finished text: numbers are rounded once, so that all formats show the same digits."""

    name: str
    title: str
    reading: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Section:
    """A part of the page under one heading."""

    name: str
    title: str
    text: tuple[str, ...]
    figures: tuple[Figure, ...] = ()
    tables: tuple[Table, ...] = ()

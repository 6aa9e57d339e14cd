"""What a page is made of: chapters of findings, figures and tables, which the page numbers and draws."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure as Drawing

from reports.results import Results

#: The results of the studies at hand, by the names of their folders.
Studies = Mapping[str, Results]


class Contradiction(Exception):
    """A sentence of the report is not true of the results; the message is the sentence."""


class Number(NamedTuple):
    """A number of a finding; ``low`` and ``high`` end its uncertainty, None where there is none."""

    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None

    def __str__(self) -> str:
        """Return the number as a sentence has it: two significant digits, an SI prefix, a unit."""
        return quantity(self.value, self.unit)


#: SI prefixes, by the power of ten of each; and the units that take them.
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
PREFIXED = ("m", "s", "N", "W", "J", "N·m")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def quantity(value: float, unit: str = "") -> str:
    """Return a number with two significant digits and its unit: 0.12 µm, 4.4 %, 1.2×10⁻⁵; a count has all."""
    if not unit and float(value).is_integer() and abs(value) < 1e5:
        return f"{value:.0f}"
    rounded = float(f"{value:.2g}")
    power = int(f"{abs(rounded):e}".partition("e")[2]) // 3 * 3
    if unit in PREFIXED and rounded and power in PREFIXES:
        value, unit, rounded = value / 10.0**power, PREFIXES[power] + unit, rounded / 10.0**power
    plain = not rounded or 1e-3 <= abs(rounded) < 1e5
    digits, raised = f"{value:.1e}".split("e")
    text = f"{float(f'{value:.2g}'):g}" if plain else f"{digits}×10{str(int(raised)).translate(_RAISED)}"
    return f"{text}{unit and ' ' + unit}"


class Finding(str):
    """A sentence that keeps its name from results to results, with its numbers and their uncertainty."""

    name: str
    numbers: tuple[Number, ...]

    def __new__(cls, name: str, text: str, /, **values: object) -> "Finding":
        """Return a sentence: ``text`` with its ``values`` in place of their names; numbers are kept."""
        finding = super().__new__(cls, text.format(**values))
        finding.name = name
        finding.numbers = tuple(value for value in values.values() if isinstance(value, Number))
        return finding

    def require(self, holds: bool) -> "Finding":
        """Return the finding if the results bear it out.

        Raises:
            Contradiction: they do not.
        """
        if not holds:
            raise Contradiction(f"the results contradict the report's sentence: {self}")
        return self


@dataclass(frozen=True)
class Figure:
    """A figure: its title asks a question, ``reading`` says what it shows and how to read it.

    ``study`` is the study whose runs it shows; ``data`` names the table with what is shown where that is not
    the points of lines.
    """

    name: str
    title: str
    reading: str
    study: str
    drawing: Drawing
    data: str = ""


@dataclass(frozen=True)
class Table:
    """A table of finished text: numbers are rounded once, so that all formats show the same digits.

    One that is not ``shown`` is a file to be downloaded. ``study`` is the study whose runs it is made from.
    """

    name: str
    title: str
    reading: str
    study: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    shown: bool = False

    @classmethod
    def of(
        cls,
        name: str,
        title: str,
        reading: str,
        study: str,
        columns: Mapping[str, Iterable[str]] | pd.DataFrame,
    ) -> "Table":
        """Return a table of columns, all of one length, by their headings."""
        rows = zip(*(cells for _, cells in columns.items()), strict=True)
        return cls(name, title, reading, study, tuple(columns), tuple(rows))

    def on_page(self) -> "Table":
        """Return the table as one that the page shows."""
        return replace(self, shown=True)


@dataclass(frozen=True)
class Chapter:
    """A chapter of the page, made from the rows of the ``studies`` that it names, of which some are there.

    Each of ``findings``, ``figures`` and ``tables`` yields what these rows give; None is left out.
    ``introduction`` says in a sentence or two what is compared.
    """

    name: str
    title: str
    studies: tuple[str, ...]
    introduction: str
    findings: Callable[[Studies], Iterator[Finding]]
    figures: Callable[[Studies], Iterator[Figure | None]]
    tables: Callable[[Studies], Iterator[Table | None]]

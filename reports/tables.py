"""Numbers as text, and a table as CSV, LaTeX (booktabs) and Markdown."""

import math
import re
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from reports.parts import Table

#: What stands for a number that a scene or an engine does not have.
ABSENT = "–"

_NUMBER = re.compile(r"(< )?(\d(?:\.\d+)?)e([+-]\d+)")
_LATEX = {
    "\\": r"\textbackslash{}",
    **{c: f"\\{c}" for c in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    ABSENT: "--",
    "“": "``",
    "”": "''",
    "·": r"$\cdot$",
}


def number(value: float) -> str:
    """Return a number with two significant digits, 0.00123 as 1.2e-03, and NaN as a dash."""
    return ABSENT if math.isnan(value) else f"{value:.1e}"


def setting(name: str, *values: float) -> str:
    """Return a setting with its value or its range as it is typed: step_tolerance 1e-10, step 0.001 s."""
    ends = " to ".join(dict.fromkeys(f"{value:.3g}" for value in values))
    return f"{name} {ends}{' s' if name == 'step' else ''}"


def plain(value: float) -> str:
    """Return a number of ordinary size with two significant digits and no exponent: 140, 0.12."""
    return f"{float(f'{value:.2g}'):g}"


def span(values: Iterable[float], form: str = "") -> str:
    """Return the least and the largest of some numbers, as one number if they read the same; NaN is left out.

    They are ``plain``, or by a format.
    """
    known = sorted(value for value in values if not math.isnan(value))
    texts = [f"{end:{form}}" if form else plain(end) for end in (*known[:1], *known[-1:])]
    return " to ".join(dict.fromkeys(texts)) or ABSENT


def error(value: float, uncertainty: float = math.nan) -> str:
    """Return an error with two significant digits, never with digits below the reference's uncertainty.

    An error below the uncertainty u is shown as ``< u``; NaN as a dash.
    """
    return f"< {number(uncertainty)}" if value < uncertainty else number(value)


def listed(parts: Iterable[str]) -> str:
    """Return parts as a list in a sentence: a, b and c."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last


def on_scenes(count: int, whole: int | None = None) -> str:
    """Return on how many of some scenes something is so, without ``whole`` on all: on 2 of 15 scenes."""
    if whole == 1 or (whole or count) > count:
        return f"on {count} of {whole} scenes"
    return {1: "on the one scene", 2: "on both scenes"}.get(count, f"on all {count} scenes")


def markdown(table: Table) -> str:
    """Return the table as Markdown, without its caption."""
    rows = [table.head, ("---",) * len(table.head), *table.rows]
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def latex(table: Table) -> str:
    """Return the table as a LaTeX ``table`` that needs ``\\usepackage{booktabs}``."""
    head = " & ".join(_stacked(cell) for cell in table.head)
    rows = [" & ".join(_latex_cell(cell) for cell in row) for row in table.rows]
    lines = [
        r"\begin{table}",
        r"\centering\footnotesize\setlength{\tabcolsep}{4pt}",
        rf"\caption{{{_escaped(f'{table.title}. {table.reading}')}}}",
        rf"\label{{tab:{table.name}}}",
        rf"\begin{{tabular}}{{{'l' * len(table.head)}}}",
        r"\toprule",
        rf"{head} \\",
        r"\midrule",
        *(rf"{line} \\" for line in rows),
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def comma_separated(table: Table) -> str:
    """Return the table as CSV with a header."""
    return str(pd.DataFrame(table.rows, columns=table.head).to_csv(index=False, lineterminator="\n"))


#: The formats of files by the ends of their names: that of every report, and those for papers with it.
SCREEN = {"csv": comma_separated}
FORMATS = {**SCREEN, "tex": latex}


def write_table(table: Table, folder: Path, paper: bool) -> None:
    """Write a table as CSV, and for a ``paper`` as LaTeX too."""
    for end, form in (FORMATS if paper else SCREEN).items():
        (folder / f"{table.name}.{end}").write_text(form(table), encoding="utf-8")


def _latex_cell(cell: str) -> str:
    match = _NUMBER.fullmatch(cell)
    if not match:
        return _escaped(cell)
    less, digits, power = match.groups()
    return rf"${less or ''}{digits} \times 10^{{{int(power)}}}$"


def _stacked(cell: str) -> str:
    """Return a column's heading on two lines, broken at the space nearest to its middle."""
    spaces = [m.start() for m in re.finditer(" ", cell)]
    if len(cell) <= 10 or not spaces:
        return _escaped(cell)
    cut = min(spaces, key=lambda at: abs(at - len(cell) / 2))
    return rf"\shortstack[l]{{{_escaped(cell[:cut])}\\{{}}{_escaped(cell[cut + 1 :])}}}"


def _escaped(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)

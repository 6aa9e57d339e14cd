"""Numbers as text, and a table as CSV and Markdown."""

import math
from collections.abc import Iterable

import pandas as pd

from reports.parts import Table

#: What stands for a number that a scene or an engine does not have.
ABSENT = "–"


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


def comma_separated(table: Table) -> str:
    """Return the table as CSV with a header."""
    return str(pd.DataFrame(table.rows, columns=table.head).to_csv(index=False, lineterminator="\n"))

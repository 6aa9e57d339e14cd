"""The command line in this process: what a user would see of one call."""

import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from unittest.mock import patch

import pandas as pd

from crankslider import command


@dataclass(frozen=True)
class Finished:
    """Exit code and output of a finished command."""

    code: object
    stdout: str
    stderr: str


def crankslider(*arguments: object) -> Finished:
    """Run ``crankslider`` with these arguments."""
    argv = ["crankslider", *map(str, arguments)]
    code: object = None
    with (
        patch.object(sys, "argv", argv),
        redirect_stdout(StringIO()) as out,
        redirect_stderr(StringIO()) as err,
    ):
        try:
            command.main()
        except SystemExit as leave:
            code = leave.code
    return Finished(code, out.getvalue(), err.getvalue())


def table_of(csv: str) -> pd.DataFrame:
    """Return the table in a CSV text with every digit: floats, and texts where they are none."""
    header, *rows = (line.split(",") for line in csv.splitlines())
    columns = zip(*rows, strict=True) if rows else ([] for _ in header)
    return pd.DataFrame({name: _values(list(cells)) for name, cells in zip(header, columns, strict=True)})


def _values(cells: list[str]) -> list[float] | list[str]:
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        return cells

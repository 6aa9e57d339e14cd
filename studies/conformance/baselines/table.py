"""The tables of baselines beside this file, one for each study: a number a line, with its band."""

import csv
import io
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from itertools import groupby
from pathlib import Path

from studies.conformance.baselines.measured import Key
from studies.running.whole_file import write_whole

FOLDER = Path(__file__).parent / "tables"
COLUMNS = (*Key._fields, "value", "low", "high", "unit", "moved", "truth", "why")


@dataclass(frozen=True)
class Baseline:
    """A number that was accepted, the band it keeps, both in ``unit``, and ``why`` it is what it is.

    ``moved`` is the most by which the processors of ``accept`` moved it, ``truth`` what it was held against.
    """

    value: float
    low: float
    high: float
    unit: str
    moved: float
    truth: str
    why: str


class DamagedTable(Exception):
    """A table of baselines cannot be read; the message names the file and what is wrong."""


def read_tables(folder: Path = FOLDER) -> dict[Key, Baseline]:
    """Return all baselines.

    Raises:
        DamagedTable: a line is no baseline, or its number is there twice.
    """
    out: dict[Key, Baseline] = {}
    for path in sorted(folder.glob("*.csv")):
        try:
            lines = list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"), newline="")))
        except (csv.Error, ValueError) as error:
            raise DamagedTable(f"{path}: expected a table of baselines, got {error}") from None
        for n, line in enumerate(lines, 2):
            try:
                key = Key(*(line[name] for name in Key._fields))
                value, low, high, moved = (float(line[name]) for name in ("value", "low", "high", "moved"))
                baseline = Baseline(value, low, high, line["unit"], moved, line["truth"], line["why"])
            except (KeyError, ValueError, TypeError) as error:
                raise DamagedTable(f"{path}:{n}: expected a baseline, got {error}") from None
            if key in out or not low <= value <= high:
                raise DamagedTable(f"{path}:{n}: expected one number within its band, got {line}")
            out[key] = baseline
    return out


def write_tables(baselines: Mapping[Key, Baseline], folder: Path = FOLDER) -> None:
    """Write all baselines in the order of their keys; tables of studies that have none are removed."""
    folder.mkdir(parents=True, exist_ok=True)
    written = set()
    for study, keys in groupby(sorted(baselines), key=lambda key: key.study):
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows((*key, *map(_cell, astuple(baselines[key]))) for key in keys)
        written.add(folder / f"{study}.csv")
        write_whole(folder / f"{study}.csv", text.getvalue().encode())
    for path in set(folder.glob("*.csv")) - written:
        path.unlink()


def _cell(value: float | str) -> str:
    """Return a number with the digits that a reader has a use for; bands are far wider."""
    return value if isinstance(value, str) else f"{value:.6g}"

"""Users' files as text, and columns of numbers in CSV files.

The first line of a table names its columns, in any order and among others. Where semicolons are between the
columns, numbers may have decimal commas.
"""

import csv
import math
from pathlib import Path

from engine_models.scene.plain_words import BadInput, shortened, shown
from engine_models.scene.units import NUMBER, converted


def read_text(path: Path) -> str:
    """Return the text in a file; raise BadInput where it cannot be read, or is not UTF-8 text."""
    try:
        return path.read_text(encoding="utf-8-sig")  # Windows' editors put a mark first
    except OSError as error:
        name, came = shortened(str(path), 255), f"'{error.strerror}'"
        raise BadInput(f"{name}: expected a file that can be read, got {came}") from None
    except UnicodeDecodeError as error:
        byte = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise BadInput(f"{path}: expected UTF-8 text, got {byte}") from None


def read_columns(path: Path, columns: tuple[str, ...]) -> dict[str, list[float]]:
    """Return columns of a CSV file by name: the first, and of the others those that are there, one at least.

    Raises BadInput where the file cannot be read, or is no table of these columns.
    """
    content, named = read_text(path), f"{columns[0]} and {' or '.join(columns[1:])}"
    first = content.partition("\n")[0]
    separator = ";" if first.count(";") > first.count(",") else ","
    reader = csv.reader(content.splitlines(), delimiter=separator, skipinitialspace=True)
    numbered = ((line, [cell.strip() for cell in row]) for line, row in enumerate(reader, 1))
    (_, head), *rows = [(line, row) for line, row in numbered if any(row)] or [(1, [""])]
    places = {column: at for column in columns for at, name in enumerate(head) if converted(column, name)}
    if columns[0] not in places or len(places) < 2:
        came = shown(", ".join(head)) if any(head) else "nothing"
        raise BadInput(f"{path}: expected the columns {named} in its first line, got {came}")
    return {
        column: [
            converted(column, head[at]) * _number(f"{path} line {line}", row[at:], column, separator)
            for line, row in rows
        ]
        for column, at in places.items()
    }


def _number(where: str, cells: list[str], column: str, separator: str) -> float:
    """Return the number in the first of some cells."""
    typed = cells[0] if cells else ""
    number = typed.replace(",", ".") if separator == ";" else typed
    if not (NUMBER.fullmatch(number) and math.isfinite(float(number))):
        raise BadInput(f"{where}: expected a finite number for {column}, got {shown(typed or None)}")
    return float(number)

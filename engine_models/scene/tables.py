"""Users' files as text, and columns of numbers in CSV files.

The first line of a table names its columns, in any order and among others. Where semicolons are between the
columns, numbers may have decimal commas.
"""

import csv
import math
from pathlib import Path

from engine_models.scene.plain_words import shortened, shown
from engine_models.scene.units import NUMBER, converted

#: More than any table needs, and any scene with two tables of that size in it.
LARGEST_BYTES = {"a table": 1_000_000, "a scene": 5_000_000}
#: Where a shell puts pipes that it has opened, which cannot keep us waiting for somebody to open them.
OPENED = (Path("/dev/stdin"), Path("/dev/fd"))


class BadFile(ValueError):
    """A file cannot be read, or is no table; the message names it, what was expected and what came."""


def read_text(path: Path, what: str) -> str:
    """Return the text in a file, or in what the shell has opened: ``/dev/stdin``, ``/dev/fd/3``.

    ``what`` it is to hold is a key of ``LARGEST_BYTES``. Raises BadFile where it cannot be read, is too large
    or not UTF-8 text.
    """
    try:
        waits = not (path.is_file() or path.is_dir() or {path, path.parent} & {*OPENED})
        if path.exists() and waits:
            raise BadFile(f"{path}: expected a file that can be read, got a pipe or a device")
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES[what] + 1)
        text = data.decode("utf-8-sig")  # Windows' editors put a mark first
    except OSError as error:
        name = shortened(str(path), 255)
        raise BadFile(f"{name}: expected a file that can be read, got '{error.strerror}'") from None
    except UnicodeDecodeError as error:
        byte = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise BadFile(f"{path}: expected UTF-8 text, got {byte}") from None
    if len(data) > LARGEST_BYTES[what]:
        raise BadFile(f"{path}: expected {what} of at most {LARGEST_BYTES[what]} bytes, got more")
    return text


def read_columns(path: Path, columns: tuple[str, ...]) -> dict[str, list[float]]:
    """Return columns of a CSV file by name: the first, and of the others those that are there, one at least.

    Raises BadFile where the file cannot be read, or is no table of these columns.
    """
    content, named = read_text(path, "a table"), f"{columns[0]} and {' or '.join(columns[1:])}"
    first = content.partition("\n")[0]
    separator = ";" if first.count(";") > first.count(",") else ","
    reader = csv.reader(content.splitlines(), delimiter=separator, skipinitialspace=True)
    numbered = ((line, [cell.strip() for cell in row]) for line, row in enumerate(reader, 1))
    (_, head), *rows = [(line, row) for line, row in numbered if any(row)] or [(1, [""])]
    places = {column: [at for at, name in enumerate(head) if converted(column, name)] for column in columns}
    counts = [len(at) for at in places.values()]
    if counts[0] != 1 or max(counts) > 1 or sum(counts) < 2:
        came = shown(", ".join(head)) if any(head) else "nothing"
        raise BadFile(f"{path}: expected the columns {named} in its first line, got {came}")
    out = dict[str, list[float]]()
    for column, at in places.items():
        for place in at:
            numbers = [_number(f"{path} line {line}", row[place:], column, separator) for line, row in rows]
            out[column] = [converted(column, head[place]) * number for number in numbers]
    return out


def _number(where: str, cells: list[str], column: str, separator: str) -> float:
    """Return the number in the first of some cells."""
    typed = cells[0] if cells else ""
    number = typed.replace(",", ".") if separator == ";" else typed
    if not (NUMBER.fullmatch(number) and math.isfinite(float(number))):
        raise BadFile(f"{where}: expected a finite number for {column}, got {shown(typed or None)}")
    return float(number)

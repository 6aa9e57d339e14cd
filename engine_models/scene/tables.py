"""Users' files as text, and tables in CSV files: their columns, put where the scene would have lists.

``file = "drive.csv"`` stands for the lists of the part that it is in. The first line of the file names its
columns, in any order and among others. Where semicolons are between the columns, numbers may have decimal
commas.
"""

import copy
import csv
import io
import math
import re
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from engine_models.scene.plain_words import shortened, shown
from engine_models.scene.units import NUMBER, converted

#: The columns of tables by the kind of drive, of one on a guide, of gas and of loads by time. Of those in
#: OPTIONAL a table has one at least.
OF_DRIVES = {
    "table": ("time_s", "angle_rad"),
    "torque": ("time_s", "torque_N_m"),
    "motor": ("speed_rad_s", "torque_N_m"),
}
OF_GUIDES, OF_CRANK = ("time_s", "position_m"), ("crank_angle_rad", "force_N")
OF_GAS = "angle_rad", "force_N"
OPTIONAL = ("force_N", "torque_N_m")
BY_TIME = ("time_s", *OPTIONAL)
COLUMN = re.compile(r"(drive|load\.[^.]+\.(gas|by_time))\.(\w+)")


#: More than any table needs, and any scene with two tables of that size in it.
LARGEST_BYTES = {"a table": 1_000_000, "a scene": 5_000_000}
#: Where a shell puts pipes that it has opened, which cannot keep us waiting for somebody to open them.
OPENED = (Path("/dev/stdin"), Path("/dev/fd"))
KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


class BadFile(ValueError):
    """A file cannot be read, or is no table; the message names it, what was expected and what came."""


def read_text(path: Path, what: str) -> str:
    """Return the text in a file, or in what the shell has opened: ``/dev/stdin``, ``/dev/fd/3``.

    ``what`` it is to hold is a key of ``LARGEST_BYTES``.

    Raises:
        BadFile: it cannot be read, is too large, or not UTF-8 text.
    """
    try:
        kind = stat.S_IFMT(path.stat().st_mode)
        if kind not in (stat.S_IFREG, stat.S_IFDIR) and not {path, path.parent} & set(OPENED):
            got = KINDS.get(kind, "a device")
            raise BadFile(f"{path}: expected a file that can be read, got {got}")
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES[what] + 1)
    except OSError as error:
        name = shortened(str(path), 255)
        raise BadFile(f"{name}: expected a file that can be read, got '{error.strerror}'") from None
    if len(data) > LARGEST_BYTES[what]:
        raise BadFile(f"{path}: expected {what} of at most {LARGEST_BYTES[what]} bytes, got more")
    try:
        return data.decode("utf-8-sig")  # Windows' editors put a mark first
    except UnicodeDecodeError as error:
        byte = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise BadFile(f"{path}: expected UTF-8 text, got {byte}") from None


def is_column(path: str) -> bool:
    """Return whether the path of a field is that of a column of a table."""
    columns = {*BY_TIME, *OF_GUIDES, *OF_CRANK, *OF_GAS, *(c for of in OF_DRIVES.values() for c in of)}
    found = COLUMN.fullmatch(path)
    return found is not None and found[3] in columns


def with_tables(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the data of a scene with lists in place of the names of files.

    Raises:
        BadFile: a file cannot be read, or is no table of these columns.
    """
    out = copy.deepcopy(dict(data))
    for path, part, columns in _tables(out):
        if "file" in part:
            lists = _lists(part, columns, path, folder)
            del part["file"]
            part.update(lists)
    return out


def files_of(data: Mapping[str, Any], folder: Path) -> list[Path]:
    """Return the files of all tables in the data of a scene."""
    return [folder / part["file"] for _, part, _ in _tables(data) if isinstance(part.get("file"), str)]


def _tables(data: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any], tuple[str, ...]]]:
    """Yield the parts of a scene that have a table, if they are mappings: path, part and columns."""
    drive, loads = data.get("drive"), data.get("load")
    if isinstance(drive, dict) and str(drive.get("kind", "table")) in OF_DRIVES:
        kind = str(drive.get("kind", "table"))
        yield "drive", drive, OF_GUIDES if kind == "table" and "guide" in drive else OF_DRIVES[kind]
    for body, load in loads.items() if isinstance(loads, dict) else ():
        for name, columns in (("gas", OF_GAS), ("by_time", BY_TIME)):
            part = load.get(name) if isinstance(load, dict) else None
            if isinstance(part, dict):
                by_crank = "crank" in data and name == "gas"
                yield f"load.{body}.{name}", part, OF_CRANK if by_crank else columns


def _lists(
    part: Mapping[str, Any], columns: tuple[str, ...], name: str, folder: Path
) -> dict[str, list[float]]:
    """Return the columns of a part's file."""
    file, field = part["file"], f"{name}.file"
    beside = [column for column in columns if column in part]
    if beside:
        raise BadFile(f"{field}: expected nothing beside {beside[0]}, got {shown(file)}")
    if not isinstance(file, str) or not file or not file.isprintable():
        raise BadFile(f"{field}: expected the name of a CSV file, got {shown(file)}")
    return _columns(folder / file, columns, field)


def _columns(path: Path, columns: tuple[str, ...], field: str) -> dict[str, list[float]]:
    """Return columns of a CSV file by name."""
    try:
        content = read_text(path, "a table")
        first = content.partition("\n")[0]
        separator = ";" if first.count(";") > first.count(",") else ","
        reader = csv.reader(io.StringIO(content, newline=""), delimiter=separator, skipinitialspace=True)
        lines = [(reader.line_num, line) for line in reader if any(cell.strip() for cell in line)]
    except BadFile as reason:
        raise BadFile(f"{field}: {reason}") from None
    except csv.Error as reason:
        raise BadFile(f"{field}: {path}: expected a table of numbers, got '{reason}'") from None
    head = [name.strip() for name in lines[0][1]] if lines else []
    if columns == BY_TIME:
        columns = tuple(column for column in BY_TIME if column not in OPTIONAL or column in head)
        columns = columns if len(columns) > 1 else (*columns, OPTIONAL[0])
    places, factors = dict[str, int](), dict[str, float]()
    for column in columns:
        like = [other for other in head if other == column] or [it for it in head if converted(column, it)]
        if len(like) != 1:
            came = shown(", ".join(head)) if head else "nothing"
            expected = f"{field}: {path}: expected the columns {', '.join(columns)} in its first line"
            raise BadFile(f"{expected}, got {came}")
        places[column] = head.index(like[0])
        factors[column] = 1.0 if like[0] == column else float(converted(column, like[0]) or 1.0)
    out: dict[str, list[float]] = {column: [] for column in columns}
    for line_number, line in lines[1:]:
        for column in columns:
            place = places[column]
            typed = line[place].strip() if place < len(line) else ""
            number = typed.replace(",", ".") if separator == ";" else typed
            if not (NUMBER.fullmatch(number) and math.isfinite(float(number))):
                came = shown(typed) if typed else "nothing"
                expected = f"{field}: {path} line {line_number}: expected a finite number for {column}"
                raise BadFile(f"{expected}, got {came}")
            out[column].append(factors[column] * float(number))
    return out

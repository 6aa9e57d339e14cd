"""Tables in CSV files beside a scene's own: their columns, put where the scene would have lists.

``file = "drive.csv"`` stands for the lists of the part that it is in. The first line of the file names its
columns, in any order and among others. Where semicolons are between the columns, numbers may have decimal
commas.
"""

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from engine_models.scene.plain_words import shown
from engine_models.scene.text_files import UnreadableFile, read_text
from engine_models.scene.units import NUMBER

#: The parts of a scene that have a table, with its columns; the drive only if it is one.
TABLES = {("drive",): ("time_s", "angle_rad"), ("load", "slider", "gas"): ("crank_angle_rad", "force_N")}
#: The paths of all columns.
COLUMNS = {".".join([*path, column]) for path, columns in TABLES.items() for column in columns}


class BadTable(ValueError):
    """A table's file was refused; the message names the field, what was expected and what came."""


def with_tables(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the data of a scene with lists in place of the names of files.

    Raises:
        BadTable: a file cannot be read, or is no table of these columns.
    """
    out = dict(data)
    for path, columns in TABLES.items():
        part: Any = out
        for name in path[:-1]:  # what is changed is copied
            if not isinstance(part.get(name), dict):
                break
            part[name] = dict(part[name])
            part = part[name]
        else:
            if path[-1] in part:
                part[path[-1]] = _with_lists(part[path[-1]], columns, ".".join(path), folder)
    return out


def files_of(data: Mapping[str, Any], folder: Path) -> list[Path]:
    """Return the files of all tables in the data of a scene."""
    found = []
    for path in TABLES:
        part: Any = data
        for name in path:
            part = part.get(name) if isinstance(part, dict) else None
        if isinstance(part, dict) and isinstance(part.get("file"), str):
            found.append(folder / part["file"])
    return found


def _with_lists(part: Any, columns: tuple[str, ...], name: str, folder: Path) -> Any:
    """Return a part of a scene with the columns of its file."""
    is_table = isinstance(part, dict) and "file" in part and part.get("kind", "table") == "table"
    if not is_table:
        return part
    file, field = part["file"], f"{name}.file"
    beside = [column for column in columns if column in part]
    if beside:
        raise BadTable(f"{field}: expected nothing beside {beside[0]}, got {shown(file)}")
    if not isinstance(file, str) or not file or not file.isprintable():
        raise BadTable(f"{field}: expected the name of a CSV file, got {shown(file)}")
    rest = {key: value for key, value in part.items() if key != "file"}
    return rest | _columns(folder / file, columns, field)


def _columns(path: Path, columns: tuple[str, ...], field: str) -> dict[str, list[float]]:
    """Return columns of a CSV file by name."""
    try:
        content = read_text(path, "a table")
        first = content.partition("\n")[0]
        separator = ";" if first.count(";") > first.count(",") else ","
        reader = csv.reader(io.StringIO(content, newline=""), delimiter=separator, skipinitialspace=True)
        lines = [(reader.line_num, line) for line in reader if any(cell.strip() for cell in line)]
    except UnreadableFile as reason:
        raise BadTable(f"{field}: {reason}") from None
    except csv.Error as reason:
        raise BadTable(f"{field}: {path}: expected a table of numbers, got '{reason}'") from None
    head = [name.strip() for name in lines[0][1]] if lines else []
    for column in columns:
        if head.count(column) != 1:
            came = shown(", ".join(head)) if head else "nothing"
            expected = f"{field}: {path}: expected the columns {', '.join(columns)} in its first line"
            raise BadTable(f"{expected}, got {came}")
    out: dict[str, list[float]] = {column: [] for column in columns}
    for line_number, line in lines[1:]:
        for column in columns:
            place = head.index(column)
            typed = line[place].strip() if place < len(line) else ""
            number = typed.replace(",", ".") if separator == ";" else typed
            if not (NUMBER.fullmatch(number) and math.isfinite(float(number))):
                came = shown(typed) if typed else "nothing"
                expected = f"{field}: {path} line {line_number}: expected a finite number for {column}"
                raise BadTable(f"{expected}, got {came}")
            out[column].append(float(number))
    return out

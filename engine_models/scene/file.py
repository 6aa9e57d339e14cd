"""Scenes from TOML files, with every refusal in one plain line."""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from engine_models.scene.format import SceneError as SceneError
from engine_models.scene.plain_words import shortened
from engine_models.scene.scene import Scene, with_fields
from engine_models.scene.tables import read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: Values of fields by their paths, as ``Scene.replace`` takes them.
Fields = Mapping[str, object]
NONE: Fields = MappingProxyType({})
#: A section's head, or a key before its value: names with dots between them.
NAME = r"(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')"
LINE = re.compile(rf"\s*(\[?)\s*({NAME}(?:\s*\.\s*{NAME})*)\s*[]=]")


def entries(text: str) -> dict[str, Any]:
    """Return what a TOML text says; raise SceneError if it is none."""
    try:
        data: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also an integer too long for Python to read
        reason = shortened(" ".join(str(error).split()), 150)
        raise SceneError(f"TOML syntax: expected valid TOML, got '{reason}'") from None
    return data


def from_toml(text: str, folder: Path = Path(), changes: Fields = NONE) -> Scene:
    """Return the scene that a TOML text describes with some changes, with tables in a folder."""
    return Scene.checked(with_fields(entries(text), changes), folder)


def load(path: Path, changes: Fields = NONE, option: str = "") -> Scene:
    """Return the scene in a TOML file, whose tables are beside it, with changes that an option asked for.

    Raises BadFile where there is no text, SceneError where that is no scene: what is wrong in the file is
    told with the line, what is with a change with the option.
    """
    text = read_text(path)
    try:
        return from_toml(text, path.parent, changes)
    except SceneError as error:
        reasons, file, lines = [], f"{path}: ", lines_of(text)
        for why in error.reasons:
            field = why.partition(": ")[0]
            beside = field if field in lines else f"{field.rpartition('.')[0] or field}."
            if any(f"{field}.".startswith(f"{it}.") or it.startswith(beside) for it in changes):
                reasons.append(f"{option} {why}")
            else:  # neither changed, nor missing beside or above a change
                line = line_of(lines, field)
                reasons.append(f"{file}line {line}: {why}" if line else f"{file}{why}")
                file = ""
        raise SceneError(*reasons) from None


def line_of(lines: Mapping[str, int], field: str) -> int | None:
    """Return the number of the line, from 1, of a field such as ``rod.mass_kg``, or of its first part.

    Of one that is not there it is the line of what it would stand in, None if there is no such thing either.
    """
    while field:
        within = (number for path, number in lines.items() if f"{path}.".startswith(f"{field}."))
        if number := lines.get(field) or next(within, None):
            return number
        field = field.rpartition(".")[0]
    return None


def lines_of(text: str) -> dict[str, int]:
    """Return the numbers of the lines, from 1, of the heads of sections and of the fields in a text."""
    lines, section = dict[str, int](), ""
    for number, line in enumerate(text.splitlines(), 1):
        if typed := LINE.match(line):
            path = re.sub(r"[\"']|\s*(\.)\s*", r"\1", typed[2])  # without quotes, and blanks around dots
            section = path if typed[1] else section
            lines.setdefault(path if typed[1] else f"{section}.{path}".removeprefix("."), number)
    return lines

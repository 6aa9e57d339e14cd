"""Scenes from TOML files, with every refusal in one plain line."""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from engine_models.scene.format import SceneError as SceneError
from engine_models.scene.plain_words import shortened
from engine_models.scene.scene import Scene, with_fields
from engine_models.scene.tables import OPENED, BadFile, read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: Values of fields by their paths, as ``Scene.replace`` takes them.
Fields = Mapping[str, object]
NONE: Fields = MappingProxyType({})
#: A section's head, and a key before its value; a path of names with dots between them.
NAME = r"(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')"
PATH = rf"{NAME}(?:\s*\.\s*{NAME})*"
HEAD, KEY = re.compile(rf"\s*\[\s*({PATH})\s*\]"), re.compile(rf"\s*({PATH})\s*=")


def from_toml(text: str, folder: Path = Path(), changes: Fields = NONE) -> Scene:
    """Return the scene that a TOML text describes with some changes; raise SceneError if it is none.

    Files of tables are in a folder.
    """
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also an integer too long for Python to read
        reason = shortened(" ".join(str(error).split()), 150)
        raise SceneError(f"TOML syntax: expected valid TOML, got '{reason}'") from None
    return Scene.checked(with_fields(data, changes), folder)


def load(path: Path, changes: Fields = NONE, option: str = "") -> Scene:
    """Return the scene in a TOML file, or in what the shell has opened: ``/dev/stdin``, ``/dev/fd/3``.

    It is looked at with the changes alone, which an ``option`` has asked for. Raises SceneError where it is
    none: what is wrong in the file is told with the line, what is with a change with the option.
    """
    try:
        text = read_text(path, "a scene")
    except BadFile as reason:
        raise SceneError(str(reason)) from None
    try:
        return from_toml(text, folder_of(path), changes)
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


def folder_of(path: Path) -> Path:
    """Return where the tables of a scene's file are looked for: beside it, or where we are."""
    return Path() if {path, path.parent} & set(OPENED) else path.parent


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
        if head := HEAD.match(line):
            section = _plain(head[1])
            lines.setdefault(section, number)
        elif key := KEY.match(line):
            lines.setdefault(f"{section}.{_plain(key[1])}".removeprefix("."), number)
    return lines


def _plain(path: str) -> str:
    """Return a path without quotes, and blanks around its dots."""
    return re.sub(r"[\"']|\s*(\.)\s*", r"\1", path)

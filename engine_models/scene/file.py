"""Scenes as TOML files: written from a scene, and read with every refusal in one plain line."""

import sys
from pathlib import Path

import tomli_w

from engine_models.scene.data import SceneError as SceneError
from engine_models.scene.lines import line_of
from engine_models.scene.plain_words import shortened
from engine_models.scene.scene import Scene
from engine_models.scene.tables import BadTable, files_of, with_tables
from engine_models.scene.text_files import OPENED, UnreadableFile, read_text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]


def to_toml(scene: Scene) -> str:
    """Return the scene as a TOML file that reads back to an equal scene; what is not there is left out."""
    data = scene.model_dump(exclude_none=True)
    return tomli_w.dumps({name: part for name, part in data.items() if part != {}})


def from_toml(text: str, folder: Path = Path()) -> Scene:
    """Return the scene that a TOML text describes; files of tables are looked for in a folder.

    Raises:
        SceneError: the text is not TOML or not a scene.
    """
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise SceneError(
            "TOML syntax: expected a scene's few levels, got too many inside each other"
        ) from None
    except ValueError as error:  # also an integer too long for Python to read
        reason = shortened(" ".join(str(error).split()), 150)
        raise SceneError(f"TOML syntax: expected valid TOML, got '{reason}'") from None
    try:
        return Scene.checked(with_tables(data, folder))
    except BadTable as reason:
        raise SceneError(str(reason)) from None


def load(path: Path) -> Scene:
    """Return the scene in a TOML file, or in what the shell has opened: ``/dev/stdin``, ``/dev/fd/3``.

    Raises:
        SceneError: the file cannot be read, is too large, is not UTF-8 text, not TOML or not a scene. What is
            wrong in it is told with the file and the line.
    """
    try:
        text = read_text(path, "a scene")
    except UnreadableFile as reason:
        raise SceneError(str(reason)) from None
    try:
        return from_toml(text, folder_of(path))
    except SceneError as error:
        first, *others = [_with_line(text, reason) for reason in error.reasons]
        raise SceneError(f"{path}: {first}", *others) from None


def _with_line(text: str, reason: str) -> str:
    """Return a reason with the line of the field that it begins with, if there is one."""
    line = line_of(text, reason.partition(": ")[0])
    return f"line {line}: {reason}" if line else reason


def sources(path: Path) -> list[Path]:
    """Return the files that a scene was loaded from: its own and those of its tables."""
    return [path, *files_of(tomllib.loads(read_text(path, "a scene")), folder_of(path))]


def folder_of(path: Path) -> Path:
    """Return where the tables of a scene's file are looked for: beside it, or where we are."""
    return Path() if {path, path.parent} & set(OPENED) else path.parent

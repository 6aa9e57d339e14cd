"""Scenes as TOML files: written from a scene, and read with every refusal in one plain line."""

import stat
import sys
from pathlib import Path

import tomli_w
from pydantic import ValidationError

from engine_models.scene.plain_words import refusal, shortened
from engine_models.scene.scene import Scene

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: More than any scene needs.
LARGEST_BYTES = 1_000_000
#: Where a shell puts pipes that it has opened, which cannot keep us waiting for somebody to open them.
OPENED = (Path("/dev/stdin"), Path("/dev/fd"))
KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


class SceneError(ValueError):
    """A scene file was refused; the message names the field, what was expected and what came."""


def to_toml(scene: Scene) -> str:
    """Return the scene as a TOML file that reads back to an equal scene; what is not there is left out."""
    data = scene.model_dump(exclude_none=True)
    if not data["clearance"]:
        del data["clearance"]
    return tomli_w.dumps(data)


def from_toml(text: str) -> Scene:
    """Return the scene that a TOML text describes.

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
        return Scene.model_validate(data)
    except ValidationError as error:
        raise SceneError(refusal(error, Scene)) from None


def load(path: Path) -> Scene:
    """Return the scene in a TOML file, or in what the shell has opened: ``/dev/stdin``, ``/dev/fd/3``.

    Raises:
        SceneError: the file cannot be read, is too large, is not UTF-8 text, not TOML or not a scene.
    """
    try:
        kind = stat.S_IFMT(path.stat().st_mode)
        if kind not in (stat.S_IFREG, stat.S_IFDIR) and not {path, path.parent} & set(OPENED):
            got = KINDS.get(kind, "a device")
            raise SceneError(f"{path}: expected a file that can be read, got {got}")
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise SceneError(f"{path}: expected a file that can be read, got '{error.strerror}'") from None
    if len(data) > LARGEST_BYTES:
        raise SceneError(f"{path}: expected a scene of at most {LARGEST_BYTES} bytes, got more")
    try:
        text = data.decode("utf-8-sig")  # Windows' editors put a mark first
    except UnicodeDecodeError as error:
        byte = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise SceneError(f"{path}: expected UTF-8 text, got {byte}") from None
    return from_toml(text)

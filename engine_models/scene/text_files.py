"""Users' files as text, or the reason in one line why they cannot be read."""

import stat
from pathlib import Path

from engine_models.scene.plain_words import shortened

#: More than any table needs, and any scene with two tables of that size in it.
LARGEST_BYTES = {"a table": 1_000_000, "a scene": 5_000_000}
#: Where a shell puts pipes that it has opened, which cannot keep us waiting for somebody to open them.
OPENED = (Path("/dev/stdin"), Path("/dev/fd"))
KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


class UnreadableFile(ValueError):
    """A file cannot be read; the message names it, what was expected and what came."""


def read_text(path: Path, what: str) -> str:
    """Return the text in a file, or in what the shell has opened: ``/dev/stdin``, ``/dev/fd/3``.

    ``what`` it is to hold is a key of ``LARGEST_BYTES``.

    Raises:
        UnreadableFile: it cannot be read, is too large, or not UTF-8 text.
    """
    try:
        kind = stat.S_IFMT(path.stat().st_mode)
        if kind not in (stat.S_IFREG, stat.S_IFDIR) and not {path, path.parent} & set(OPENED):
            got = KINDS.get(kind, "a device")
            raise UnreadableFile(f"{path}: expected a file that can be read, got {got}")
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES[what] + 1)
    except OSError as error:
        name = shortened(str(path), 255)
        raise UnreadableFile(f"{name}: expected a file that can be read, got '{error.strerror}'") from None
    if len(data) > LARGEST_BYTES[what]:
        raise UnreadableFile(f"{path}: expected {what} of at most {LARGEST_BYTES[what]} bytes, got more")
    try:
        return data.decode("utf-8-sig")  # Windows' editors put a mark first
    except UnicodeDecodeError as error:
        byte = f"byte 0x{error.object[error.start]:02x} at {error.start}"
        raise UnreadableFile(f"{path}: expected UTF-8 text, got {byte}") from None

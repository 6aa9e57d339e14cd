"""Files and folders written whole or not at all: what was there stays until the new one is complete."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EISDIR
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryDirectory, TemporaryFile


def require_place(path: Path) -> None:
    """Raise OSError, before any work is done, if ``path`` is a folder or no file can be written there."""
    path = Path(os.path.realpath(path))
    if path.is_dir():
        raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
    if path.is_file() or not path.exists():
        with TemporaryFile(dir=path.parent):
            pass


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that takes the place of ``path`` once it is on the disk, and vanishes if it fails.

    A device or pipe has nothing to lose and is written directly.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    new = path.with_name(f".{path.name}.{token_hex(8)}.new")
    try:
        with new.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Give an empty folder that takes the place of ``path`` at the block's end, and vanishes if it fails."""
    path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as beside:
        new, old = Path(beside, "new"), Path(beside, "old")
        new.mkdir()
        yield new
        if path.exists():
            path.rename(old)
        new.rename(path)

"""Files and folders written whole or not at all: what was there stays until the new one is complete."""

import errno
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from io import FileIO
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryDirectory, TemporaryFile

#: How the name of a file ends that a kill left unfinished; no file is written for so long, in s.
UNFINISHED, LEFT_S = ".new", 3600.0
#: Bytes of the random part of a name, so that nobody else has it.
RANDOM_BYTES = 8


def require_place(path: Path) -> None:
    """Refuse a place where no file can be written, before any work is done; what kills left there goes.

    Raises:
        OSError: ``path`` is a folder, or no file can be written there.
    """
    path = Path(os.path.realpath(path))
    if path.is_dir() or path.is_symlink():  # a link to itself
        raise _error(errno.EISDIR if path.is_dir() else errno.ELOOP, path)
    if path.exists() and not os.access(path, os.W_OK):  # a file that may not be written may not be replaced
        raise _error(errno.EACCES, path)
    if path.is_file() or not path.exists():
        for left in path.parent.glob(f".{escape(path.name)}.{'[0-9a-f]' * 2 * RANDOM_BYTES}{UNFINISHED}"):
            with suppress(FileNotFoundError):
                if time.time() - left.stat().st_mtime > LEFT_S:
                    left.unlink()
        new = _beside(path)
        new.touch(exist_ok=False)
        new.unlink()


def require_folder(path: Path) -> None:
    """Refuse a place that is no folder and cannot be made one, or in which nothing can be written.

    Raises:
        OSError: it is so.
    """
    if os.path.lexists(path) and not path.is_dir():  # a file, or a link to nowhere
        raise _error(errno.ENOTDIR, path)
    there = next(place for place in (path.absolute(), *path.absolute().parents) if os.path.lexists(place))
    with TemporaryFile(dir=there):
        pass


@contextmanager
def whole_file(path: Path) -> Iterator[FileIO]:
    """Open a file that takes the place of ``path`` when the block ends, and vanishes when the block fails.

    It is unbuffered (see ``write_through``). A device or pipe has nothing to lose and is written directly.

    Raises:
        OSError: ``path`` is a folder, or no file can be written there.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        with path.open("wb", buffering=0) as file:
            yield file
        return
    new = _beside(path)
    try:
        with new.open("xb", buffering=0) as file:
            yield file
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that takes the place of ``path`` once it is on the disk, and vanishes if it fails."""
    with whole_file(path) as file:
        write_through(file, content)


def write_through(file: FileIO, content: bytes) -> None:
    """Write to an unbuffered file, all of it and, unless it is a device or pipe, down to the disk."""
    left = memoryview(content)
    while left:
        left = left[file.write(left) :]
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        os.fsync(file.fileno())


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Give an empty folder that takes the place of ``path`` when the block ends, and vanishes when it fails.

    Raises:
        OSError: nothing can be written beside ``path``.
    """
    path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as beside:
        new, old = Path(beside, "new"), Path(beside, "old")
        new.mkdir()
        yield new
        if path.exists():
            path.rename(old)
        try:
            new.rename(path)
        except OSError:
            if old.exists():
                old.rename(path)
            raise


def _beside(path: Path) -> Path:
    """Return a name for what is to take the place of a file, which nobody else has."""
    return path.with_name(f".{path.name}.{token_hex(RANDOM_BYTES)}{UNFINISHED}")


def _error(number: int, path: Path) -> OSError:
    return OSError(number, os.strerror(number), str(path))

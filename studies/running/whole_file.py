"""A file written whole or not at all: what was there stays until the new one is complete."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import TextIO

#: How the name of a file ends that a kill left unfinished.
UNFINISHED = ".new"


@contextmanager
def whole_file(path: Path) -> Iterator[TextIO]:
    """Open a file that takes the place of ``path`` when the block ends, and vanishes when the block fails.

    It is created beside ``path`` at once, so a place that cannot be written is known before any work is
    done. A device or pipe has nothing to lose and is written directly.

    Raises:
        OSError: ``path`` is a folder, or no file can be written there.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        with path.open("w", encoding="utf-8", newline="") as file:
            yield file
        return
    if path.exists():
        path.open("a").close()  # a file that may not be written may not be replaced
    new = path.with_name(f".{path.name}.{os.getpid()}")
    with _taking_the_place(new, path), new.open("x", encoding="utf-8", newline="") as file:
        yield file


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that takes the place of ``path`` once it is on the disk, and vanishes if it fails."""
    new = path.with_name(f"{path.name}{UNFINISHED}")
    with _taking_the_place(new, path), new.open("wb", buffering=0) as file:
        write_through(file, content)


@contextmanager
def _taking_the_place(new: Path, path: Path) -> Iterator[None]:
    """Let a file that the block writes take the place of ``path``, or vanish when the block fails."""
    try:
        yield
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def write_through(file: FileIO, content: bytes) -> None:
    """Write to an unbuffered file, all of it and down to the disk."""
    left = memoryview(content)
    while left:
        left = left[file.write(left) :]
    os.fsync(file.fileno())

"""A file written whole or not at all: what was there stays until the new one is complete."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO


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
    try:
        with new.open("x", encoding="utf-8", newline="") as file:
            yield file
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)

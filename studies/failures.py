"""What a user is told: failures in one line, and notes of work that takes long.

Notes are log records of ``crankslider``: the command prints them, ``--quiet`` keeps them back.
"""

import logging
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from engine_models.scene.bad_input import BadInput as BadInput

log = logging.getLogger("crankslider")
log.setLevel(logging.INFO)


class Failed(Exception):
    """The work broke down. The message says when and why."""


def progress_console() -> Any:
    """Return the rich console on which progress is shown: stderr, silent where notes are."""
    from rich.console import Console  # which most runs are over without

    return Console(stderr=True, quiet=not log.isEnabledFor(logging.INFO))


@contextmanager
def writing(argument: str, place: Path) -> Iterator[None]:
    """Turn an OSError into a BadInput that names the argument with the place that cannot be written."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"{argument}: expected a place that can be written, got {place} ({reason})") from None


def bug(error: BaseException) -> str:
    """Return in one line what went wrong where: the file with its folder, since many files share a name.

    A library that cannot be loaded, as Exudyn without the system's libGL, is no bug.
    """
    if isinstance(error, ImportError):
        return f"expected a library that can be loaded, got {' '.join(str(error).split())}"
    place = traceback.extract_tb(error.__traceback__)[-1]
    file = "/".join(Path(place.filename).parts[-2:])
    return f"bug at {file}:{place.lineno}: {type(error).__name__}: {error}"

"""Input of the commands that run cases: studies, engines, and the folder of results."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from engine_models.engines import join
from engine_models.kernels import FolderRefused, writable_folder
from engine_models.scene.plain_words import meant, one_of, shown
from studies.command.options import read_engine
from studies.failures import BadInput, terminated_as_interrupted, writing
from studies.registry import STUDIES
from studies.whole_file import require_folder


def joined(engines: Sequence[str]) -> None:
    """Add engines to the studies, also those of the user.

    Raises:
        BadInput: one is unknown.
    """
    for name in engines:
        read_engine(name, {})
        join(name)


def require_studies(names: Sequence[str]) -> None:
    """Raise BadInput if a name is not that of a study."""
    for name in names:
        if name not in STUDIES:
            expected = one_of(list(STUDIES))
            raise BadInput(f"STUDY: expected {expected}, got {shown(name)}{meant(name, STUDIES)}")


@contextmanager
def running_in(out: Path) -> Iterator[None]:
    """Run cases in the block, with results in ``out``.

    Raises:
        BadInput: a file there, or in the folder of compiled code, is damaged or cannot be used.
    """
    try:
        with writable_folder(), writing("--out", out), terminated_as_interrupted():
            require_folder(out)
            yield
    except FolderRefused as reason:
        raise BadInput(str(reason)) from None

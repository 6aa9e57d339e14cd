"""What commands that run cases have in common: engines that join, and what may stop them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from engine_models.engines import join
from engine_models.reference.kernels import FolderRefused, writable_folder
from studies.command.options import read_engine
from studies.failures import BadInput, terminated_as_interrupted, writing
from studies.running.finished_cases import DamagedRows
from studies.running.folder_lock import FolderHeld


def joined(engines: Sequence[str]) -> None:
    """Let engines take part, those from outside as well.

    Raises:
        BadInput: one is unknown.
    """
    for name in engines:
        read_engine(name, {})
        join(name)


@contextmanager
def running_in(out: Path) -> Iterator[None]:
    """Run cases in the block, with results in ``out``.

    Raises:
        BadInput: something there, or in the folder of kernels, is not as it has to be.
    """
    try:
        with writable_folder(), writing("--out", out), terminated_as_interrupted():
            yield
    except FolderRefused as reason:
        raise BadInput(str(reason)) from None
    except (FolderHeld, DamagedRows) as reason:
        raise BadInput(f"--out: expected {reason}") from None

"""Input of the commands that run cases: studies, engines, scenes, and the folder of results."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from engine_models.engines import join
from engine_models.kernels import KernelsRefused, writable_folder
from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import meant, one_of, shown
from studies.command.options import read_engine, read_scene
from studies.running.failures import BadInput, note, terminated_as_interrupted, writing
from studies.running.finished_cases import DamagedRows
from studies.running.folder_lock import FolderHeld
from studies.running.given_scenes import cases_of, require_names
from studies.running.outcome import load_study
from studies.running.registry import STUDIES
from studies.running.whole_file import require_folder


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


def given_scenes(names: Sequence[str]) -> list[AnyScene]:
    """Return the scenes on which studies are to run.

    Raises:
        BadInput: there is no such scene, or its name is not unique or cannot be a file name.
    """
    try:
        scenes = [read_scene(name) for name in names]
    except BadInput as reason:
        raise BadInput(str(reason).replace("SCENE:", "--scene:", 1)) from None
    require_names(scenes)
    return scenes


def studies_of(scenes: Sequence[AnyScene], full: bool) -> list[str]:
    """Return the studies that accept all scenes; a note names the others, with the reason."""
    names = []
    for name in STUDIES:
        try:
            cases_of(name, load_study(name), full, scenes)
        except BadInput as reason:
            note(f"study {name} is left out: {reason}")
        else:
            names.append(name)
    return names


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
    except KernelsRefused as reason:
        raise BadInput(str(reason)) from None
    except (FolderHeld, DamagedRows) as reason:
        raise BadInput(f"--out: expected {reason}") from None

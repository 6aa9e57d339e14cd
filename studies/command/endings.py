"""File formats by the ending of the name."""

from collections.abc import Iterable
from pathlib import Path

from engine_models.scene.plain_words import one_of, shown
from studies.running.failures import BadInput

#: Endings of figures and of animations.
PICTURES, FILMS = (".png", ".svg", ".pdf"), (".html", ".gif", ".mp4")


def ending_of(option: str, path: Path, known: Iterable[str]) -> str:
    """Return the ending of a file's name in lower case.

    Raises:
        BadInput: it is not among ``known``.
    """
    ending = path.suffix.lower()
    if ending not in known:
        expected = f"a file that ends in {one_of([each for each in known if each])}"
        raise BadInput(f"{option}: expected {expected}, got {shown(str(path))}")
    return ending


def film_ending(path: Path) -> str:
    """Return the ending of an animation's file.

    Raises:
        BadInput: it is not one of an animation, or it is .mp4 without ffmpeg.
    """
    from reports.run.film import can_write

    ending = ending_of("--animate", path, FILMS)
    if not can_write(ending):
        expected = "a file that ends in .html or .gif where ffmpeg is not installed"
        raise BadInput(f"--animate: expected {expected}, got {shown(str(path))}")
    return ending

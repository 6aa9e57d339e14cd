"""What a file will be by the ending of its name."""

from collections.abc import Iterable
from pathlib import Path

from engine_models.scene.plain_words import one_of, shown
from studies.running.failures import BadInput

#: Endings of pictures and of films.
PICTURES, FILMS = (".png", ".svg", ".pdf"), (".html", ".gif", ".mp4")


def ending_of(option: str, path: Path, known: Iterable[str]) -> str:
    """Return the ending of a file's name in lower case.

    Raises:
        BadInput: it is none that is known.
    """
    ending = path.suffix.lower()
    if ending not in known:
        expected = f"a file that ends in {one_of([each for each in known if each])}"
        raise BadInput(f"{option}: expected {expected}, got {shown(str(path))}")
    return ending


def film_ending(path: Path) -> str:
    """Return the ending of a film's file.

    Raises:
        BadInput: it is none of a film, or it is .mp4 and there is no ffmpeg.
    """
    from reports.run.film import can_write

    ending = ending_of("--animate", path, FILMS)
    if not can_write(ending):
        expected = "a file that ends in .html or .gif where ffmpeg is not installed"
        raise BadInput(f"--animate: expected {expected}, got {shown(str(path))}")
    return ending

"""The scenes that tests simulate beside the library's: few and short, with every branch of the code."""

from functools import cache
from pathlib import Path

from engine_models.scene.file import load
from engine_models.scene.scene import Scene

FOLDER = Path(__file__).parent
NAMES = tuple(sorted(file.stem for file in FOLDER.glob("*.toml")))


@cache
def scene(name: str) -> Scene:
    """Return the scene of a file here."""
    return load(FOLDER / f"{name}.toml")

"""Scenes of mechanisms other than a plain crank-slider, read from the files beside this one."""

from collections.abc import Callable, Mapping
from pathlib import Path

from engine_models.scene.file import load
from engine_models.scene.general import GeneralScene
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene


def _of(file: Path) -> Callable[[], Scene | GeneralScene]:
    """Return what makes the scene of a file, described by the file's first line."""

    def make() -> Scene | GeneralScene:
        return load(file)

    with file.open(encoding="utf-8") as text:
        make.__doc__ = text.readline().removeprefix("#").strip()
    return make


#: The mechanisms by name.
MECHANISMS: Mapping[str, Callable[[], Scene | GeneralScene]] = {
    file.stem: _of(file) for file in sorted(Path(__file__).parent.glob("*.toml"))
}
#: What ``crankslider`` knows by name.
ALL_SCENES: Mapping[str, Callable[[], Scene | GeneralScene]] = {**SCENES, **MECHANISMS}

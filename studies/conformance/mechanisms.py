"""The scenes on which every engine is held to its claims: those of the library, each by its name."""

from functools import cache

from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.parts import AnyScene

#: Ends in s of the beginnings of mechanisms, which take some thousand steps: Andrews' has to come to speed.
ENDS_S = {
    "offset-crank-slider": 0.01,
    "four-bar": 0.05,
    "four-bar-clearance": 0.006,
    "andrews-squeezer": 0.006,
    "scotch-yoke": 0.03,
    "quick-return": 0.05,
    "v-twin": 0.02,
}
NAMES = tuple(ALL_SCENES)


@cache
def scene_of(name: str) -> AnyScene:
    """Return a scene of the library, or the beginning of a mechanism."""
    scene = ALL_SCENES[name]()
    return scene.replace("end_time_s", ENDS_S[name]) if name in ENDS_S else scene

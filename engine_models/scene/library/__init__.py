"""The library's scenes by name, each a TOML file beside this one that its first line describes.

Set R is the literature's standard case, set F its free counterpart. A file with a ``base`` has the entries of
that scene but for its own. The rigid scenes are those with clearance between walls that do not give.
"""

from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

from engine_models.scene.file import entries
from engine_models.scene.format import Clearance, Friction
from engine_models.scene.scene import Scene

TEXTS = {file.stem: file.read_text(encoding="utf-8") for file in sorted(Path(__file__).parent.glob("*.toml"))}
Makers = Mapping[str, Callable[[], Scene]]
IDEAL = ("free", "driven", "torque", "fluctuating", "compressor")
LOOSE = (
    *("driven-0.5mm", "driven-0.1mm", "driven-0.02mm", "driven-damped", "driven-A", "driven-AB"),
    *("free-0.5mm", "free-OAB", "pendulum", "start-up", "compressor"),
)
#: The literature's bearing: steel on steel, 10 mm, restitution 0.9.
BEARING_RADIUS_M, STEEL = 0.01, {"young_modulus_Pa": 207e9, "poisson_ratio": 0.3}


def _entries(name: str) -> dict[str, Any]:
    """Return the entries of a scene's file, and those of its base."""
    if name.startswith("rigid"):
        own = _entries(name.replace("rigid", "clearance"))
        for joint, room in own["clearance"].items():
            own["clearance"][joint] = {key: room[key] for key in room if key not in STEEL} | {"law": "rigid"}
        return {**own, "name": name}
    own = entries(TEXTS[name])
    return {**(_entries(own.pop("base")) if "base" in own else {}), "name": name, **own}


def _makers(*names: str) -> Makers:
    """Return what makes each scene, described by the first line of its file."""
    makers = {name: cache(partial(lambda name: Scene.checked(_entries(name)), name)) for name in names}
    for name, make in makers.items():
        about = TEXTS[name.replace("rigid", "clearance")].partition("\n")[0].removeprefix("# ").rstrip(".")
        make.__doc__ = f"{about}; rigid contact." if name.startswith("rigid") else f"{about}."
    return makers


IDEAL_SCENES, CLEARANCE_SCENES, RIGID_SCENES = (
    _makers(*(f"{kind}-{name}" for name in names))
    for kind, names in (("ideal", IDEAL), ("clearance", LOOSE), ("rigid", LOOSE))
)
SCENES: Makers = {**IDEAL_SCENES, **CLEARANCE_SCENES, **RIGID_SCENES}
#: Scenes of mechanisms other than a plain crank-slider or pendulum.
MECHANISMS = _makers(*(name for name in TEXTS if name not in SCENES))
ALL_SCENES: Makers = {**SCENES, **MECHANISMS}
#: Scenes that tests and studies begin with.
ideal_free, ideal_driven, ideal_torque, _, ideal_compressor = IDEAL_SCENES.values()


def clearance(
    c_m: float, law: str = "lankarani-nikravesh", e: float = 0.9, friction: Friction | None = None
) -> Clearance:
    """Return a radial clearance with Hertz's stiffness of steel, and a coefficient of restitution."""
    own = {"radial_clearance_m": c_m, "law": law, "restitution": e, "friction": friction}
    return Clearance.checked(own | STEEL | {"bearing_radius_m": BEARING_RADIUS_M})

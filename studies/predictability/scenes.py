"""Scenes of the predictability study: those of the library, two of its relatives, and families of them."""

import math

from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES, clearance, ideal_driven
from engine_models.scene.scene import Clearance, Clearances, Friction, Scene


def clearance_driven_lossy() -> Scene:
    """Set R with 0.5 mm at the rod-slider pin and a restitution of 0.5 (Hu-Guo): chaotic, but slowly."""
    return _at_slider("clearance-driven-lossy", clearance(5e-4, "hu-guo", 0.5))


def clearance_driven_rubbing() -> Scene:
    """Set R with 0.5 mm at the rod-slider pin and friction 0.03."""
    friction = Friction(law="tanh", coefficient=0.03, regularisation_speed_m_s=0.01)
    return _at_slider("clearance-driven-rubbing", clearance(5e-4, friction=friction))


def _at_slider(name: str, room: Clearance) -> Scene:
    return ideal_driven().model_copy(update={"name": name, "clearance": Clearances(B=room)})


SCENES = {
    **CLEARANCE_SCENES,
    **RIGID_SCENES,
    "clearance-driven-lossy": clearance_driven_lossy,
    "clearance-driven-rubbing": clearance_driven_rubbing,
}

#: Scenes whose horizon is sought and until when in s: quick, ...
HORIZONS_S = (
    ("clearance-driven-0.5mm", 0.06),
    ("clearance-driven-damped", 0.072),
    ("clearance-driven-AB", 0.036),
)
#: ... and what the full set adds. What settles is followed for 39 revolutions, rigid contact for as long as
#: the reference does in a minute.
MORE_HORIZONS_S = (
    ("clearance-driven-0.1mm", 0.072),
    ("clearance-driven-0.02mm", 0.072),
    ("clearance-free-0.5mm", 0.2),
    ("clearance-driven-A", 0.048),
    ("clearance-driven-lossy", 0.12),
    ("clearance-free-OAB", 0.15),
    ("clearance-pendulum", 0.3),
    ("clearance-driven-0.02mm", 0.468),
    ("clearance-driven-damped", 0.468),
    ("clearance-driven-rubbing", 0.18),
    ("clearance-pendulum", 3.0),
    ("rigid-driven-0.5mm", 0.048),
    ("rigid-driven-0.1mm", 0.048),
    ("rigid-driven-A", 0.036),
    ("rigid-free-0.5mm", 0.1),
)

#: Scenes whose exponent is measured: driven ones, since a free one runs down and has no rate to converge to.
EXPONENTS = ("clearance-driven-0.5mm",)
#: What the full set adds.
MORE_EXPONENTS = (
    "clearance-driven-0.1mm",
    "clearance-driven-0.02mm",
    "clearance-driven-damped",
    "clearance-driven-A",
    "clearance-driven-AB",
    "clearance-driven-lossy",
    "clearance-driven-rubbing",
    "rigid-driven-0.5mm",
)


def period_s(scene: Scene) -> float:
    """Return the time of a revolution of a crank at constant speed.

    Raises:
        ValueError: the crank is not driven at constant speed, or stands still.
    """
    if scene.drive.kind != "constant-speed" or scene.start.crank_speed_rad_s == 0:
        raise ValueError(f"scene {scene.name}: expected a crank that turns at constant speed")
    return 2 * math.pi / abs(scene.start.crank_speed_rad_s)


def following(scene: Scene, revolutions: int) -> Scene:
    """Return a driven scene that ends after some revolutions."""
    return scene.model_copy(update={"end_time_s": revolutions * period_s(scene)})


def tighter(scene: Scene) -> Scene:
    """Return a scene, of the same name, whose clearances are a tenth smaller."""
    rooms = {joint: getattr(scene.clearance, joint) for joint in scene.joints_with_clearance}
    smaller = {
        joint: room.model_copy(update={"radial_clearance_m": 0.9 * room.radial_clearance_m})
        for joint, room in rooms.items()
    }
    return scene.model_copy(update={"clearance": scene.clearance.model_copy(update=smaller)})


def set_r(radial_clearance_m: float) -> Scene:
    """Return set R with a clearance at the rod-slider pin."""
    return _at_slider(f"set R with {radial_clearance_m * 1e3:g} mm", clearance(radial_clearance_m))


def turning(scene: Scene, speed_rad_s: float) -> Scene:
    """Return a driven scene with another speed of the crank, which its name tells in rev/min."""
    start = scene.start.model_copy(update={"crank_speed_rad_s": speed_rad_s})
    name = f"{scene.name} at {speed_rad_s * 60 / (2 * math.pi):.0f} rpm"
    return scene.model_copy(update={"name": name, "start": start})

"""The scene that native contacts solve in a law's place: rigid walls, the same restitution and friction."""

from engine_models.engine import UnsupportedScene
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene


def rigid_twin(scene: Scene) -> Scene:
    """Return the scene with rigid contact in every joint with clearance: same restitution, same friction.

    Hertz's law and the linear one lose nothing, so theirs is 1. Pymunk's friction is Coulomb's, at any
    sliding speed: the scene's regularised one is the nearest that a scene can say, with the same coefficient.

    Raises:
        UnsupportedScene: Kelvin-Voigt's restitution depends on the masses.
    """
    return scene.replace({f"clearance.{name}": _rigid(name, room) for name, room in scene.clearances.items()})


def _rigid(name: str, clearance: Clearance) -> Clearance:
    if clearance.law == "rigid":
        return clearance
    if clearance.law == "kelvin-voigt":
        raise UnsupportedScene(
            f"pymunk with contact = rigid needs a restitution, kelvin-voigt names none (joint {name})"
        )
    return Clearance(
        radial_clearance_m=clearance.radial_clearance_m,
        bearing_radius_m=clearance.bearing_radius_m,
        law="rigid",
        restitution=1.0 if clearance.restitution is None else clearance.restitution,
        friction=clearance.friction,
        bearing=clearance.bearing,
    )

"""The scene that Pymunk's native contact solves in place of one with compliant laws."""

from engine_models.engine import UnsupportedScene
from engine_models.scene.scene import Clearance, Clearances, Scene


def rigid_twin(scene: Scene) -> Scene:
    """Return the scene with rigid contact in every joint with clearance: same restitution, same friction.

    Hertz's law and the linear one lose nothing, so theirs is 1. Pymunk's friction is Coulomb's, at any
    sliding speed: the scene's regularised one is the nearest that a scene can say, with the same coefficient.

    Raises:
        UnsupportedScene: Kelvin-Voigt's restitution depends on the masses.
    """
    joints = {name: _rigid(name, getattr(scene.clearance, name)) for name in scene.joints_with_clearance}
    return scene.model_copy(update={"clearance": Clearances(**joints)}) if joints else scene


def _rigid(name: str, room: Clearance) -> Clearance:
    if room.law == "rigid":
        return room
    if room.law == "kelvin-voigt":
        raise UnsupportedScene(
            f"pymunk with contact = rigid needs a restitution, kelvin-voigt names none (joint {name})"
        )
    return Clearance(
        radial_clearance_m=room.radial_clearance_m,
        bearing_radius_m=room.bearing_radius_m,
        law="rigid",
        restitution=1.0 if room.restitution is None else room.restitution,
        friction=room.friction,
    )

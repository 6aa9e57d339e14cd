"""What kind of scene a study is about: a scene of the user's is of that kind, or refused in a line."""

from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import BadInput
from engine_models.scene.scene import Scene


def require(study: str, holds: bool, expected: str, scene: AnyScene) -> None:
    """Raise BadInput where a scene is not what a study ``expected``."""
    if not holds:
        raise BadInput(f"--scene {scene.name}: expected {expected} for the study {study}, got {kind(scene)}")


def kind(scene: AnyScene) -> str:
    """Return in words what a scene is."""
    rooms = [f"{room.law} clearance at {joint}" for joint, room in scene.clearances.items()]
    what = "another mechanism"
    if isinstance(scene, Scene) and scene.is_plain:
        what = "a crank-slider" if scene.is_crank_slider else "a pendulum"
    drive = f"drive.kind = '{scene.driven_by.kind}'"
    return f"{what} with {' and '.join([*rooms, drive] if rooms else ['ideal joints', drive])}"


def turns_steadily(scene: AnyScene) -> bool:
    """Return whether it is a plain crank-slider whose crank turns at constant speed, not zero."""
    if not (isinstance(scene, Scene) and scene.is_plain):
        return False
    return scene.drive.kind == "constant-speed" and scene.start.crank_speed_rad_s != 0

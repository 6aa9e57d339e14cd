"""What kind of scene a study is about: a scene of the user's is of that kind, or refused in a line."""

from engine_models.scene.plain_words import BadInput
from engine_models.scene.scene import Scene


def require(study: str, holds: bool, expected: str, scene: Scene) -> None:
    """Raise BadInput where a scene is not what a study ``expected``."""
    if not holds:
        raise BadInput(f"--scene {scene.name}: expected {expected} for the study {study}, got {kind(scene)}")


def kind(scene: Scene) -> str:
    """Return in words what a scene is."""
    rooms = [
        f"{getattr(scene.clearance, joint).law} clearance at {joint}" for joint in scene.joints_with_clearance
    ]
    what = "a crank-slider" if scene.is_crank_slider else "a pendulum"
    drive = f"drive.kind = '{scene.drive.kind}'"
    return f"{what} with {' and '.join([*rooms, drive] if rooms else ['ideal joints', drive])}"


def has_closed_form(scene: Scene) -> bool:
    """Return whether all follows from the crank's angle: ideal joints, and a rod longer than the crank."""
    there = scene.rod is not None and scene.rod.length_m > scene.crank.length_m
    return there and not scene.joints_with_clearance


def turns_steadily(scene: Scene) -> bool:
    """Return whether the crank turns at constant speed, not zero."""
    return scene.drive.kind == "constant-speed" and scene.start.crank_speed_rad_s != 0

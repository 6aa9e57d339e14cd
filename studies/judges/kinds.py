"""What kind of scene a study is about."""

from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene


def turns_steadily(scene: AnyScene) -> bool:
    """Return whether it is a plain crank-slider whose crank turns at constant speed, not zero."""
    if not (isinstance(scene, Scene) and scene.is_plain):
        return False
    return scene.drive.kind == "constant-speed" and scene.start.crank_speed_rad_s != 0

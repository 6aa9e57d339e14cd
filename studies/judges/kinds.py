"""What kind of scene a study is about."""

from engine_models.scene.scene import Scene


def turns_steadily(scene: Scene) -> bool:
    """Return whether it is a crank-slider whose crank turns at constant speed, not zero."""
    return (
        scene.is_short
        and scene.drive.body == "crank"
        and scene.drive.kind == "constant-speed"
        and scene.placed.v[2] != 0
    )

"""Scenes begun at another time of theirs."""

from engine_models.engine import FloatArray
from engine_models.scene.format import BodyState
from engine_models.scene.scene import Scene


def started_from(
    scene: Scene,
    position: FloatArray,
    velocity: FloatArray,
    time_s: float = 0.0,
    end_time_s: float | None = None,
) -> Scene:
    """Return the scene begun at the positions and velocities, each (bodies, 3), of a time of its own.

    It is as long as before, or ``end_time_s``.
    """
    keys, bodies = BodyState.model_fields, zip(position.tolist(), velocity.tolist(), strict=True)
    states = [dict(zip(keys, [*x, *v], strict=True)) for x, v in bodies]
    start: dict[str, object] = dict(zip(scene.mechanism.names, states, strict=True))
    own_speed = not scene.mechanism.drive.prescribes or scene.drive.kind == "table"  # others' is the drive's
    start["time_s"] = scene.start.time_s + time_s
    if scene.is_short:
        start["crank_angle_rad"] = float(position[0, 2])
        if own_speed:
            start |= {"crank_speed_rad_s": float(velocity[0, 2]), "speed_m_s": None}
        start = {**scene.as_written()["start"], **start}
    elif not own_speed:
        start |= {key: dict(getattr(scene.start, key)) for key in ("speed_rad_s", "speed_m_s")}
    return scene.replace({"start": start, "end_time_s": end_time_s or scene.end_time_s})

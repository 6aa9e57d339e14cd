"""Where the bodies are, and how fast, when the ideal joints hold at a given crank angle and speed."""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.joints import CRANK, ROD, SLIDER
from engine_models.scene.format import BodyState
from engine_models.scene.scene import Scene
from engine_models.scene.start import along_axis, held_at_start


def start_state(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, (bodies, 3) each: those given, or the assembly's."""
    return np.array(scene.placed.q).reshape(-1, 3), np.array(scene.placed.v).reshape(-1, 3)


def start_angle(scene: Scene) -> tuple[str, float]:
    """Return the path of the field that tells the turning body's angle at the start, and the angle in rad.

    Raises:
        ValueError: the start tells no such angle, or does not hold it.
    """
    if scene.turning_body is None:
        raise ValueError("expected a turning body, got none")
    name = scene.mechanism.names[scene.turning_body]
    path = scene.path(f"start.angle_rad.{name}")
    if name not in scene.start.angle_rad or name not in held_at_start(scene)[0]:
        raise ValueError(f"expected a start that tells {path} and holds it, got another")
    return path, scene.start.angle_rad[name]


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
    own_speed = not scene.speed_is_prescribed or scene.drive.kind == "table"  # others' is the drive's
    if scene.speed_is_prescribed or not scene.is_plain:  # tables of loads go by the clock too
        start["time_s"] = scene.clock_s + time_s
    if scene.is_short:
        start["crank_angle_rad"] = float(position[CRANK, 2])
        if own_speed:
            start |= {"crank_speed_rad_s": float(velocity[CRANK, 2]), "speed_m_s": None}
        start = {**scene.as_written()["start"], **start}
    elif not own_speed:
        start |= {key: dict(getattr(scene.start, key)) for key in ("speed_rad_s", "speed_m_s")}
    return scene.replace({"start": start, "end_time_s": end_time_s or scene.end_time_s})


def assembled_apart(
    scene: Scene, angle_rad: float, speed_rad_s: float, gaps: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the state of a crank-slider, whose joints O, A, B are some of them apart.

    ``gaps`` (2, 2) are a joint's gap from bearing to pin in m and its rate in m/s; it is none in others.
    """
    crank, rod, _ = scene.crank_slider()
    at_O, at_A, at_B = (gaps.get(joint, np.zeros((2, 2))) for joint in scene.joints)
    state = np.zeros((2, 3, 3))
    state[:, CRANK, :2] = at_O + along_axis(crank.centre_of_mass_m, angle_rad, speed_rad_s)
    state[:, CRANK, 2] = angle_rad, speed_rad_s
    pin = at_O + along_axis(crank.length_m, angle_rad, speed_rad_s) + at_A
    height, rise = pin[:, 1] + at_B[:, 1]
    phi = np.arcsin(-height / rod.length_m)
    phi_rate = -rise / (rod.length_m * np.cos(phi))
    state[:, ROD, :2] = pin + along_axis(rod.centre_of_mass_m, phi, phi_rate)
    state[:, ROD, 2] = phi, phi_rate
    state[:, SLIDER, 0] = (pin + along_axis(rod.length_m, phi, phi_rate) + at_B)[:, 0]
    return state[0], state[1]

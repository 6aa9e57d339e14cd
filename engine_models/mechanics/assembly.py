"""Where the bodies are, and how fast, when the ideal joints hold at a given crank angle and speed."""

from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, ROD, SLIDER
from engine_models.scene.general import held_at_start, placed_start
from engine_models.scene.mechanism import state_of
from engine_models.scene.parts import AnyScene, GeneralParts
from engine_models.scene.scene import BodyState, Scene

T = TypeVar("T", bound=AnyScene)


def start_state(scene: AnyScene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, (bodies, 3) each: those given, or the assembly's."""
    if isinstance(scene, GeneralParts):
        return _placed(scene)
    assert isinstance(scene, Scene)
    if not (scene.is_plain or scene.start.states):
        return _placed(scene.general)
    if not scene.start.states:
        motion = crank_motion(scene)
        speed = scene.start.crank_speed_rad_s if motion is None else motion.start_speed_rad_s
        return assembled(scene, scene.start.crank_angle_rad, speed)
    values = np.array([list(state.model_dump().values()) for state in scene.start.states])
    return values[:, :3], values[:, 3:]


def _placed(scene: GeneralParts) -> tuple[FloatArray, FloatArray]:
    """Return the start of a scene in the general form."""
    start = placed_start(scene)
    if start is not None:
        return np.array(start.q).reshape(-1, 3), np.array(start.v).reshape(-1, 3)
    q, v = state_of(scene)
    return q.reshape(-1, 3), v.reshape(-1, 3)


def start_angle(scene: AnyScene) -> tuple[str, float]:
    """Return the path of the field that tells the turning body's angle at the start, and the angle in rad.

    Raises:
        ValueError: the start tells no such angle, or does not hold it.
    """
    if isinstance(scene, Scene):
        if scene.start.states:
            raise ValueError("expected a start by crank angle, got the state of every body")
        return "start.crank_angle_rad", scene.start.crank_angle_rad
    assert isinstance(scene, GeneralParts)
    if scene.turning_body is None:
        raise ValueError("expected a turning body, got none")
    name = scene.mechanism.names[scene.turning_body]
    if name not in scene.start.angle_rad or name not in held_at_start(scene)[0]:
        raise ValueError(f"expected a start that tells start.angle_rad.{name} and holds it, got another")
    return f"start.angle_rad.{name}", scene.start.angle_rad[name]


def started_from(
    scene: T,
    position: FloatArray,
    velocity: FloatArray,
    time_s: float = 0.0,
    end_time_s: float | None = None,
) -> T:
    """Return the scene begun at the positions and velocities, each (bodies, 3), of a time of its own.

    It is as long as before, or ``end_time_s``.
    """
    keys, bodies = BodyState.model_fields, zip(position.tolist(), velocity.tolist(), strict=True)
    states = [dict(zip(keys, [*x, *v], strict=True)) for x, v in bodies]
    start: dict[str, object] = dict(zip(scene.mechanism.names, states, strict=True))
    own_speed = not scene.speed_is_prescribed or scene.driven_by.kind == "table"  # others' is the drive's
    if scene.speed_is_prescribed or not scene.is_plain:  # tables of loads go by the clock too
        start["time_s"] = scene.clock_s + time_s
    if isinstance(scene, Scene):
        start["crank_angle_rad"] = float(position[CRANK, 2])
        if own_speed:
            start |= {"crank_speed_rad_s": float(velocity[CRANK, 2]), "speed_m_s": None}
        start = {**dict(scene.start), **start}
    elif isinstance(scene, GeneralParts) and not own_speed:
        start |= {key: dict(getattr(scene.start, key)) for key in ("speed_rad_s", "speed_m_s")}
    return scene.replace({"start": start, "end_time_s": end_time_s or scene.end_time_s})


def assembled(scene: Scene, angle_rad: float, speed_rad_s: float) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities, each (3, 3): crank, rod, slider by (x, y, phi) of the centre of mass.

    Those of a pendulum are (1, 3).
    The rod is on the side of its acute angle: the slider lies to the right of pin A.
    """
    theta, omega = angle_rad, speed_rad_s
    state = np.zeros((2, len(scene.bodies), 3))
    state[:, CRANK, :2] = _along(scene.crank.centre_of_mass_m, theta, omega)
    state[:, CRANK, 2] = theta, omega
    if scene.is_crank_slider:
        crank, rod, _ = scene.crank_slider()
        r, length = crank.length_m, rod.length_m
        phi = np.arcsin(-r / length * np.sin(theta))
        phi_rate = -r * np.cos(theta) / (length * np.cos(phi)) * omega
        pin = _along(r, theta, omega)
        state[:, ROD, :2] = pin + _along(rod.centre_of_mass_m, phi, phi_rate)
        state[:, ROD, 2] = phi, phi_rate
        state[:, SLIDER, 0] = (pin + _along(length, phi, phi_rate))[:, 0]
    return state[0], state[1]


def assembled_apart(
    scene: Scene, angle_rad: float, speed_rad_s: float, gaps: Mapping[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the state of a crank-slider, as ``assembled`` does, whose joints O, A, B are some of them apart.

    ``gaps`` (2, 2) are a joint's gap from bearing to pin in m and its rate in m/s; it is none in others.
    """
    crank, rod, _ = scene.crank_slider()
    at_O, at_A, at_B = (gaps.get(joint, np.zeros((2, 2))) for joint in scene.joints)
    state = np.zeros((2, 3, 3))
    state[:, CRANK, :2] = at_O + _along(crank.centre_of_mass_m, angle_rad, speed_rad_s)
    state[:, CRANK, 2] = angle_rad, speed_rad_s
    pin = at_O + _along(crank.length_m, angle_rad, speed_rad_s) + at_A
    height, rise = pin[:, 1] + at_B[:, 1]
    phi = np.arcsin(-height / rod.length_m)
    phi_rate = -rise / (rod.length_m * np.cos(phi))
    state[:, ROD, :2] = pin + _along(rod.centre_of_mass_m, phi, phi_rate)
    state[:, ROD, 2] = phi, phi_rate
    state[:, SLIDER, 0] = (pin + _along(rod.length_m, phi, phi_rate) + at_B)[:, 0]
    return state[0], state[1]


def _along(distance_m: float, angle_rad: float, rate_rad_s: float) -> FloatArray:
    """Return the vector of a distance along a turning axis, and its derivative, (2, 2)."""
    x, y = np.cos(angle_rad), np.sin(angle_rad)
    return np.array(
        [[distance_m * x, distance_m * y], [-distance_m * rate_rad_s * y, distance_m * rate_rad_s * x]]
    )

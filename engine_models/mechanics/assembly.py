"""Where the bodies are, and how fast, when the ideal joints hold at a given crank angle and speed."""

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene.scene import BodyState, Scene


def start_state(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, as ``assembled`` does: those given, or the assembly's."""
    if not scene.start.states:
        return assembled(scene, scene.start.crank_angle_rad, scene.start.crank_speed_rad_s)
    values = np.array([list(state.model_dump().values()) for state in scene.start.states])
    return values[:, :3], values[:, 3:]


def started_from(scene: Scene, position: FloatArray, velocity: FloatArray) -> Scene:
    """Return the scene begun at other positions and velocities, each (bodies, 3)."""
    names = ("crank", "rod", "slider")
    states = {
        name: BodyState(
            **dict(zip(BodyState.model_fields, [float(number) for number in (*x, *v)], strict=True))
        )
        for name, x, v in zip(names, position, velocity, strict=False)
    }
    start = scene.start.model_copy(update={"crank_angle_rad": float(position[0, 2]), **states})
    if scene.drive.kind != "constant-speed":
        start = start.model_copy(update={"crank_speed_rad_s": float(velocity[0, 2])})
    return scene.model_copy(update={"start": start})


def assembled(scene: Scene, angle_rad: float, speed_rad_s: float) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities, each (3, 3): crank, rod, slider by (x, y, phi) of the centre of mass.

    Those of a pendulum are (1, 3).
    The rod is on the side of its acute angle: the slider lies to the right of pin A.
    """
    theta, omega = angle_rad, speed_rad_s

    def along(distance: float, angle: float) -> FloatArray:
        return distance * np.array([np.cos(angle), np.sin(angle)])

    def rate(distance: float, angle: float, angle_rate: float) -> FloatArray:
        return distance * angle_rate * np.array([-np.sin(angle), np.cos(angle)])

    s = scene.crank.centre_of_mass_m
    if not scene.is_crank_slider:
        return np.array([[*along(s, theta), theta]]), np.array([[*rate(s, theta, omega), omega]])
    crank, rod, _ = scene.crank_slider()
    r, length, d = crank.length_m, rod.length_m, rod.centre_of_mass_m
    phi = np.arcsin(-r / length * np.sin(theta))
    phi_rate = -r * np.cos(theta) / (length * np.cos(phi)) * omega
    pin, pin_rate = along(r, theta), rate(r, theta, omega)
    slider, slider_rate = pin + along(length, phi), pin_rate + rate(length, phi, phi_rate)
    position = np.array([[*along(s, theta), theta], [*(pin + along(d, phi)), phi], [slider[0], 0.0, 0.0]])
    velocity = np.array(
        [
            [*rate(s, theta, omega), omega],
            [*(pin_rate + rate(d, phi, phi_rate)), phi_rate],
            [slider_rate[0], 0.0, 0.0],
        ]
    )
    return position, velocity

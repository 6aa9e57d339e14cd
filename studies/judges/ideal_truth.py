"""The independent truth for ideal scenes: one coordinate, Eksergian's equation, closed-form reactions.

With the crank angle theta as the only coordinate every body coordinate is a function X(theta), so the
motion is  J(theta) theta'' + J'(theta) theta'^2 / 2 = Q - V'(theta)  (Eksergian 1930), and the forces follow
by Newton's law body by body, slider first. Nothing here is shared with the solvers under test.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from engine_models.engine import FloatArray, Trajectory
from engine_models.scene.scene import Scene

RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 1e-13, 1e-17
#: Least number of pieces that a run is cut into, for the truth and for its repeats: from 200 on the energy
#: integral of the library's ideal scenes holds to 5e-14, which is round-off.
PIECES, REPEAT_PIECES = 400, (500, 640)

#: Nine coordinates or their derivatives, each a number or an array: crank, rod, slider by (x, y, phi).
Rows = tuple[Any, ...]


def configuration(scene: Scene, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return X, dX/dtheta and d2X/dtheta2, each (n, 3, 3): crank, rod, slider by (x, y, phi)."""
    X, X_1, X_2 = (
        np.stack(np.broadcast_arrays(theta, *rows)[1:], axis=-1).reshape(*theta.shape, 3, 3)
        for rows in _coordinates(scene, theta, np)
    )
    return X, X_1, X_2


def slider_position_m(scene: Scene, theta: FloatArray) -> FloatArray:
    """Return where the slider is, (n,) in m, with ideal joints at crank angles (n,) in rad."""
    return np.asarray(_coordinates(scene, theta, np)[0][6])


def _coordinates(scene: Scene, theta: Any, of: Any) -> tuple[Rows, Rows, Rows]:
    """Return the nine rows of ``configuration`` with the functions of ``of``: numpy, or math for a number."""
    crank, rod, _ = scene.crank_slider()
    r, length = crank.length_m, rod.length_m
    s, d = crank.centre_of_mass_m, rod.centre_of_mass_m
    cos, sin = of.cos(theta), of.sin(theta)
    # Loop closure r sin(theta) + L sin(phi) = 0, differentiated twice.
    sin_phi = -r / length * sin
    cos_phi = of.sqrt(1 - sin_phi**2)
    phi_1 = -r / length * cos / cos_phi
    phi_2 = (r / length * sin + sin_phi * phi_1**2) / cos_phi
    rod_x_1, rod_y_1 = -sin_phi * phi_1, cos_phi * phi_1
    rod_x_2 = -cos_phi * phi_1**2 - sin_phi * phi_2
    rod_y_2 = -sin_phi * phi_1**2 + cos_phi * phi_2
    return (
        (
            *(s * cos, s * sin, theta),
            *(r * cos + d * cos_phi, r * sin + d * sin_phi, of.asin(sin_phi)),
            *(r * cos + length * cos_phi, 0.0, 0.0),
        ),
        (
            *(-s * sin, s * cos, 1.0),
            *(-r * sin + d * rod_x_1, r * cos + d * rod_y_1, phi_1),
            *(-r * sin + length * rod_x_1, 0.0, 0.0),
        ),
        (
            *(-s * cos, -s * sin, 0.0),
            *(-r * cos + d * rod_x_2, -r * sin + d * rod_y_2, phi_2),
            *(-r * cos + length * rod_x_2, 0.0, 0.0),
        ),
    )


def _masses(scene: Scene) -> FloatArray:
    """Return the diagonal of the mass matrix by body and coordinate, (3, 3)."""
    return np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in scene.bodies])


def crank_acceleration(scene: Scene, of: Any = np) -> Callable[[Any, Any], Any]:
    """Return theta'' in rad/s^2 as a function of theta and theta' by Eksergian's equation.

    Of arrays (n,), or with ``math`` for ``of`` of numbers, ten times as fast. It is zero under a
    constant-speed drive.
    """
    if scene.drive.kind == "constant-speed":
        return lambda theta, _: 0.0 * theta
    m, g = _masses(scene).ravel().tolist(), scene.gravity_m_s2
    Q = scene.drive.torque_N_m if scene.drive.kind == "torque" else 0.0

    def acceleration(theta: Any, speed: Any) -> Any:
        _, X_1, X_2 = _coordinates(scene, theta, of)
        J = sum(mass * x * x for mass, x in zip(m, X_1, strict=True))
        J_1 = 2 * sum(mass * x * y for mass, x, y in zip(m, X_1, X_2, strict=True))
        V_1 = g * sum(mass * y for mass, y in zip(m[1::3], X_1[1::3], strict=True))
        return (Q - V_1 - J_1 * speed**2 / 2) / J

    return acceleration


def _crank_motion(scene: Scene, time_s: FloatArray, pieces: int) -> tuple[FloatArray, FloatArray]:
    """Return theta and theta' (n,) at the times; every sample ends an integration, none is interpolated."""
    start = scene.start
    if scene.drive.kind == "constant-speed":
        speed = np.full_like(time_s, start.crank_speed_rad_s)
        return start.crank_angle_rad + start.crank_speed_rad_s * time_s, speed

    acceleration = crank_acceleration(scene, math)
    per_sample = -(-pieces // (len(time_s) - 1))
    cuts = np.linspace(time_s[0], time_s[-1], per_sample * (len(time_s) - 1) + 1)
    states, lost = [np.array([start.crank_angle_rad, start.crank_speed_rad_s])], np.zeros(2)
    for begin, end in pairwise(cuts):
        # Only the deviation from uniform turning is integrated, and the rounding of each sum is carried on
        # (Kahan 1965): round-off does not build up with the number of turns.
        theta, speed = states[-1].tolist()

        def derivative(
            elapsed: float, y: FloatArray, theta: float = theta, speed: float = speed
        ) -> list[float]:
            deviation, rate = y.tolist()
            return [rate, acceleration(theta + speed * elapsed + deviation, speed + rate)]

        run = solve_ivp(
            derivative, (0, end - begin), [0, 0], "DOP853", rtol=RELATIVE_TOLERANCE, atol=ABSOLUTE_TOLERANCE
        )
        change = run.y[:, -1] + [speed * (end - begin), 0] + lost
        states.append(states[-1] + change)
        lost = change - (states[-1] - states[-2])
    angles, speeds = np.array(states[::per_sample]).T
    return angles, speeds


def _reactions(
    scene: Scene, X: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return joint forces (n, 3, 2), guide force (n,) and driver torque (n,), slider first."""
    inertial = _masses(scene) * acceleration
    inertial[..., 1] += _masses(scene)[:, 0] * scene.gravity_m_s2  # every force but the joints' moved left
    crank, rod, slider = (inertial[:, i] for i in range(3))
    _, link, _ = scene.crank_slider()
    length, d = link.length_m, link.centre_of_mass_m
    s = scene.crank.centre_of_mass_m
    cos, sin = np.cos(X[:, 1, 2]), np.sin(X[:, 1, 2])
    B_x = slider[:, 0]
    A_x = rod[:, 0] + B_x
    # Moments on the rod about its pin A: I phi'' + r x (m a) = r_B x (-F_B).
    moment = rod[:, 2] + d * (cos * rod[:, 1] - sin * rod[:, 0])
    B_y = (length * sin * B_x - moment) / (length * cos)
    A_y = rod[:, 1] + B_y
    O_x, O_y = crank[:, 0] + A_x, crank[:, 1] + A_y
    cos, sin = np.cos(X[:, 0, 2]), np.sin(X[:, 0, 2])
    torque = crank[:, 2] + s * (cos * crank[:, 1] - sin * crank[:, 0])
    torque = torque + scene.crank.length_m * (cos * A_y - sin * A_x)
    joint_force = np.stack([O_x, O_y, A_x, A_y, B_x, B_y], axis=-1).reshape(-1, 3, 2)
    return joint_force, slider[:, 1] - B_y, torque


@lru_cache(maxsize=64)
def exact(scene: Scene, samples: int, pieces: int = PIECES) -> Trajectory:
    """Return the true trajectory of an ideal scene at ``samples + 1`` equally spaced times.

    ``pieces`` is the least number of pieces in which the motion is integrated.

    Raises:
        ValueError: the scene has a joint with clearance, or a rod that is too short for a full turn.
    """
    crank, rod, _ = scene.crank_slider()
    if rod.length_m < crank.length_m:
        raise ValueError(f"no truth for a rod shorter than the crank: {rod.length_m} m, {crank.length_m} m")
    if scene.joints_with_clearance:
        raise ValueError(f"no minimal-coordinate truth for clearance at {scene.joints_with_clearance}")
    time = np.linspace(0.0, scene.end_time_s, samples + 1)
    theta, speed = _crank_motion(scene, time, pieces)
    X, X_1, X_2 = configuration(scene, theta)
    velocity = X_1 * speed[:, None, None]
    theta_2 = crank_acceleration(scene)(theta, speed)
    acceleration = X_1 * theta_2[:, None, None] + X_2 * (speed**2)[:, None, None]
    joint_force, guide_force, torque = _reactions(scene, X, acceleration)
    work = None
    if scene.drive.kind == "torque":
        work = scene.drive.torque_N_m * (theta - theta[0])
    elif scene.drive.kind == "constant-speed":
        m, g = _masses(scene), scene.gravity_m_s2
        energy = np.sum(m * velocity**2, axis=(1, 2)) / 2 + g * np.sum(m[:, 0] * X[:, :, 1], axis=1)
        work = energy - energy[0]
    return Trajectory(
        time_s=time,
        position=X,
        velocity=velocity,
        joint_force_N=joint_force,
        guide_normal_force_N=guide_force,
        driver_torque_N_m=None if work is None else torque,
        driver_work_J=work,
        step_s=scene.end_time_s / samples,
        steps=samples,
        solve_time_s=0.0,
    )


def exact_repeats(scene: Scene, samples: int) -> list[Trajectory]:
    """Return the same truth from integrations cut otherwise: its distance from them is its uncertainty."""
    return [exact(scene, samples, pieces) for pieces in REPEAT_PIECES]

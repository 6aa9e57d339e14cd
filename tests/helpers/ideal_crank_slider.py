"""The ideal crank-slider in one coordinate: Eksergian's equation, reactions body by body.

With the crank angle theta as the only coordinate every body coordinate is a function X(theta), so the
motion is  J(theta) theta'' + J'(theta) theta'^2 / 2 = Q - V'(theta)  (Eksergian 1930), and the forces follow
by Newton's law body by body, slider first. Q is the drive's torque and the slider's load times dx/dtheta.
Bodies are crank, rod, slider by (x, y, phi). Nothing here is shared with what it tests.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from engine_models.engine import FloatArray, Trajectory
from engine_models.scene.scene import Scene
from tests.helpers.crank_sliders import crank_slider

TURN = 2 * np.pi
#: Of SciPy's DOP853, and the fewest pieces that a run is cut into.
RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE, PIECES = 1e-13, 1e-17, 800
#: S(x) of a ramp, its share of the change of speed at x = t/T.
SMOOTH_STEP = Polynomial([0, 0, 0, 10, -15, 6])
#: Which of the nine coordinates is the slider's position.
SLIDER_X = 6

#: Nine coordinates or their derivatives, each a number or an array: crank, rod, slider by (x, y, phi).
Rows = tuple[Any, ...]
#: A force in N as a function of theta, x and x', arrays (n,) or numbers.
Force = Callable[[Any, Any, Any], Any]


def configuration(scene: Scene, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return X, dX/dtheta and d2X/dtheta2 at angles (n,), each (n, 3, 3): bodies by (x, y, phi)."""
    X, X_1, X_2 = (
        np.stack(np.broadcast_arrays(theta, *rows)[1:], axis=-1).reshape(*theta.shape, 3, 3)
        for rows in _coordinates(scene, theta, np)
    )
    return X, X_1, X_2


def _coordinates(scene: Scene, theta: Any, of: Any) -> tuple[Rows, Rows, Rows]:
    """Return the nine rows of ``configuration`` with the functions of ``of``: numpy, or math for a number."""
    crank, rod, _ = crank_slider(scene)
    r, length = crank.length_m, rod.length_m
    s, d = crank.centre_of_mass_m, rod.centre_of_mass_m
    cos, sin = of.cos(theta), of.sin(theta)
    # Loop closure r sin(theta) + L sin(phi) = 0, differentiated twice. Nothing cancels where a rod is hardly
    # longer than the crank: 1 -+ sin(phi) are sums, with 1 -+ sin(theta) = 2 sin(pi/4 -+ theta/2)^2.
    part, longer = r / length, (length - r) / length
    sin_phi = -part * sin
    sums = (longer + 2 * part * of.sin(of.pi / 4 + side * theta / 2) ** 2 for side in (1, -1))
    cos_phi = of.sqrt(math.prod(sums))
    phi_1 = -part * cos / cos_phi
    phi_2 = part * sin * longer * (1 + part) / cos_phi**3
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


def masses(scene: Scene) -> FloatArray:
    """Return the diagonal of the mass matrix by body and coordinate, (3, 3)."""
    return np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in scene.mechanism.bodies])


def crank_acceleration(scene: Scene, of: Any = np) -> Callable[[Any, Any], Any]:
    """Return theta'' in rad/s^2 of a crank left free as a function of theta and theta'.

    Of arrays (n,), or with ``math`` for ``of`` of numbers, ten times as fast.
    """
    m, g = masses(scene).ravel().tolist(), -scene.mechanism.gravity_m_s2[1]
    torque, parts = drive_torque(scene), list(load_parts(scene).values())

    def acceleration(theta: Any, speed: Any) -> Any:
        X, X_1, X_2 = _coordinates(scene, theta, of)
        J = sum(mass * x * x for mass, x in zip(m, X_1, strict=True))
        J_1 = 2 * sum(mass * x * y for mass, x, y in zip(m, X_1, X_2, strict=True))
        V_1 = g * sum(mass * y for mass, y in zip(m[1::3], X_1[1::3], strict=True))
        x, slope = X[SLIDER_X], X_1[SLIDER_X]
        Q = torque(speed) + sum(part(theta, x, slope * speed) for part in parts) * slope
        return (Q - V_1 - J_1 * speed**2 / 2) / J

    return acceleration


def drive_torque(scene: Scene) -> Callable[[Any], Any]:
    """Return the torque in N m of a drive that does not prescribe the speed, as a function of the speed."""
    drive = scene.drive
    if drive.kind == "motor":
        stall, no_load = drive.stall_torque_N_m, drive.no_load_speed_rad_s
        return lambda speed: stall * (1 - speed / no_load)
    torque = drive.torque_N_m if drive.kind == "torque" else 0.0
    return lambda _: torque


def load_parts(scene: Scene) -> dict[str, Force]:
    """Return the parts of the slider's load by their names."""
    load, parts = scene.short.load.get("slider"), dict[str, Force]()
    if load is None:
        return parts
    push, damping, stiffness, free = load.force_N, load.viscous_N_s_m, load.spring_N_m, load.free_position_m
    if push:
        parts["force"] = lambda theta, x, speed: push  # noqa: ARG005
    if damping:
        parts["viscous"] = lambda theta, x, speed: -damping * speed  # noqa: ARG005
    if stiffness and free is not None:
        parts["spring"] = lambda theta, x, speed: -stiffness * (x - free)  # noqa: ARG005
    if load.gas is not None:
        first = load.gas.crank_angle_rad[0]
        angle = (*load.gas.crank_angle_rad[:-1], first + TURN)
        force = (*load.gas.force_N[:-1], load.gas.force_N[0])
        spline = CubicSpline(angle, force, bc_type="periodic")
        if load.gas.interpolation == "linear":
            spline = lambda theta: np.interp(theta, angle, force)  # noqa: E731
        parts["gas"] = lambda theta, x, speed: spline(first + np.remainder(theta - first, TURN))  # noqa: ARG005
    return parts


#: What a drive prescribes at times (n,) since the run began: the angle turned since, speed, acceleration.
Prescribed = Callable[[Any], tuple[Any, Any, Any]]


def prescribed_motion(scene: Scene) -> tuple[Prescribed, Sequence[float]]:
    """Return the motion that a drive prescribes, and the times at which a higher derivative of it jumps."""
    first, begin = scene.short.start.crank_speed_rad_s, scene.start.time_s
    drive: Any = scene.drive
    if drive.kind == "ramp":
        T, change, x_0 = (
            drive.ramp_time_s,
            drive.final_speed_rad_s - first,
            min(begin / drive.ramp_time_s, 1.0),
        )
        # Expanded about the start, so that nothing cancels: the integral of S from x_0 to x_0 + h.
        turning = SMOOTH_STEP(Polynomial([x_0, 1])).integ()

        def ramp(t: Any) -> tuple[Any, Any, Any]:
            h = np.minimum(t / T, 1 - x_0)
            x = x_0 + h
            turned = first * t + change * T * (turning(h) + (t / T - h))
            return turned, first + change * SMOOTH_STEP(x), 30 * change / T * (x * (1 - x)) ** 2

        return ramp, (T - begin,)
    if drive.kind == "fluctuating":
        rate, swing = TURN * drive.frequency_Hz, drive.amplitude_rad_s
        phase = drive.phase_rad + rate * begin

        def fluctuate(t: Any) -> tuple[Any, Any, Any]:
            turned = first * t + 2 * swing / rate * np.sin(rate * t / 2) * np.sin(phase + rate * t / 2)
            at = phase + rate * t
            return turned, first + swing * np.sin(at), swing * rate * np.cos(at)

        return fluctuate, ()
    if drive.kind == "table" and drive.interpolation != "linear":
        times, angles = drive.time_s, drive.angle_rad
        ends = drive.end_slopes or [
            0.0 if angles[end] == angles[beside] else None for end, beside in ((0, 1), (-1, -2))
        ]
        spline = CubicSpline(
            times, angles, bc_type=tuple("not-a-knot" if end is None else (1, end) for end in ends)
        )

        def tabled(t: Any) -> tuple[Any, Any, Any]:
            return spline(begin + t) - spline(begin), spline(begin + t, 1), spline(begin + t, 2)

        return tabled, [time - begin for time in times]
    if drive.kind == "table":
        first = (drive.angle_rad[-1] - drive.angle_rad[0]) / (drive.time_s[-1] - drive.time_s[0])
    return lambda t: (first * t, first + 0.0 * t, 0.0 * t), ()


def _motion(scene: Scene, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray]]:
    """Return angle, speed and acceleration of the crank at times (n,), and works of loads and of a motor.

    Every sample and every knot ends an integration, none is interpolated. Only the deviation from uniform
    turning is integrated, and the rounding of each sum is carried on (Kahan 1965), so that round-off does not
    build up with the number of turns.
    """
    start, parts = scene.short.start, list(load_parts(scene).values())
    motor = drive_torque(scene) if scene.drive.kind == "motor" else None
    sums = len(parts) + (motor is not None)
    prescribed, knots = prescribed_motion(scene) if scene.mechanism.drive.prescribes else (None, ())
    free = crank_acceleration(scene, math)

    def along(theta: float, speed: float) -> list[float]:
        X, X_1, _ = _coordinates(scene, theta, math)
        x, rate = X[SLIDER_X], X_1[SLIDER_X] * speed
        powers = [float(part(theta, x, rate)) * rate for part in parts]
        return powers if motor is None else [*powers, motor(speed) * speed]

    def piece(state: FloatArray, begin: float, length: float) -> FloatArray:
        """Return the change of a state beyond that of uniform turning."""
        theta, speed = state[:2].tolist()

        def rates(elapsed: float, y: FloatArray) -> list[float]:
            if prescribed is not None:
                turned, now, _ = prescribed(begin + elapsed)
                return [0.0, 0.0, *along(start.crank_angle_rad + float(turned), float(now))]
            angle, now = theta + speed * elapsed + y[0], speed + y[1]
            return [y[1], float(free(angle, now)), *along(angle, now)]

        zeros, to = [0.0] * (2 + sums), {"rtol": RELATIVE_TOLERANCE, "atol": ABSOLUTE_TOLERANCE}
        return np.asarray(solve_ivp(rates, (0.0, length), zeros, "DOP853", **to).y[:, -1])

    state = np.array([start.crank_angle_rad, start.crank_speed_rad_s, *[0.0] * sums])
    states, lost = {0.0: state}, np.zeros(2 + sums)
    inside = [knot for knot in knots if 0 < knot < time_s[-1]]
    fine = np.linspace(0.0, time_s[-1], -(-PIECES // (len(time_s) - 1)) * (len(time_s) - 1) + 1)
    cuts = np.unique(np.concatenate([fine, time_s, inside])) if sums or prescribed is None else time_s
    for begin, end in pairwise(cuts.tolist()):
        if prescribed is not None:
            turned, state[1], _ = prescribed(begin)
            state[0], lost[:2] = start.crank_angle_rad + float(turned), 0.0
        uniform = np.array([0.0 if prescribed else state[1] * (end - begin), *[0.0] * (1 + sums)])
        change = piece(state, begin, end - begin) + uniform + lost
        lost = change - ((state + change) - state)
        state = state + change
        states[end] = state.copy()
    angle, speed, *works = np.array([states[t] for t in time_s.tolist()]).T
    if prescribed is not None:
        turned, speed, acceleration = prescribed(time_s)
        return start.crank_angle_rad + turned, np.asarray(speed), np.asarray(acceleration), works
    return angle, speed, crank_acceleration(scene)(angle, speed), works


@lru_cache(maxsize=64)
def exact(scene: Scene, samples: int) -> Trajectory:
    """Return the motion of ideal joints with a rod longer than the crank at equally spaced times."""
    assert scene.short.rod is not None
    assert scene.short.rod.length_m > scene.short.crank.length_m
    assert not scene.clearances
    time = np.linspace(0.0, scene.end_time_s, samples + 1)
    theta, speed, theta_2, sums = _motion(scene, time)
    X, X_1, X_2 = configuration(scene, theta)
    velocity = X_1 * speed[:, None, None]
    acceleration = X_1 * theta_2[:, None, None] + X_2 * (speed**2)[:, None, None]
    parts = load_parts(scene)
    works = dict(zip(parts, sums, strict=False))
    load_N = sum(part(theta, X[:, 2, 0], velocity[:, 2, 0]) for part in parts.values()) + 0.0 * theta
    joint_force, guide_force, torque = _reactions(scene, X, acceleration, load_N)
    work = None
    if scene.drive.kind == "torque":
        work = scene.drive.torque_N_m * (theta - theta[0])
    elif scene.drive.kind == "motor":
        work, torque = sums[-1], drive_torque(scene)(speed)
    elif scene.mechanism.drive.prescribes:
        m, g = masses(scene), -scene.mechanism.gravity_m_s2[1]
        energy = np.sum(m * velocity**2, axis=(1, 2)) / 2 + g * np.sum(m[:, 0] * X[:, :, 1], axis=1)
        work = energy - energy[0] - sum(works.values())
    return Trajectory(
        time_s=time,
        position=X,
        velocity=velocity,
        joint_force_N={pin.name: joint_force[:, k] for k, pin in enumerate(scene.mechanism.pins)},
        guide_force_N={"guide": guide_force},
        guide_moment_N_m={"guide": np.zeros(len(time))},
        driver_torque_N_m=None if work is None else torque,
        driver_work_J=work,
        load_work_J=works,
        step_s=scene.end_time_s / samples,
        steps=samples,
        solve_time_s=0.0,
    )


def _reactions(
    scene: Scene, X: FloatArray, acceleration: FloatArray, load_N: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return joint forces (n, 3, 2), guide force (n,) and driver torque (n,), slider first."""
    inertial = masses(scene) * acceleration
    inertial[..., 1] += (
        masses(scene)[:, 0] * -scene.mechanism.gravity_m_s2[1]
    )  # every force but the joints' moved left
    inertial[:, 2, 0] -= load_N
    crank, rod, slider = (inertial[:, i] for i in range(3))
    _, link, _ = crank_slider(scene)
    length, d = link.length_m, link.centre_of_mass_m
    s = scene.short.crank.centre_of_mass_m
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
    torque = torque + scene.short.crank.length_m * (cos * A_y - sin * A_x)
    joint_force = np.stack([O_x, O_y, A_x, A_y, B_x, B_y], axis=-1).reshape(-1, 3, 2)
    return joint_force, slider[:, 1] - B_y, torque

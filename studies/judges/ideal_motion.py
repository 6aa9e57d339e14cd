"""The motion of ideal scenes in one coordinate, the crank's angle: kinematics and Eksergian's equation.

Bodies are crank, rod, slider by (x, y, phi). Nothing here is shared with the solvers under test.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.scene.scene import Scene
from studies.judges.ideal_drive import drive_torque, prescribed_motion
from studies.judges.ideal_load import NODES, WEIGHTS, gas_knots_rad, is_viscous, slider_force

RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 1e-13, 1e-17
#: More a piece, and a rod that is hardly longer than the crank folds in less than round-off lets one follow.
MOST_EVALUATIONS = 100_000
#: Most that crank angle and phase of a fluctuation together turn in one piece of a quadrature in time.
LONGEST_PIECE_RAD = 0.1
#: Which of the nine coordinates is the slider's position.
SLIDER_X = 6

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
    return np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in scene.bodies])


def crank_acceleration(scene: Scene, of: Any = np) -> Callable[[Any, Any], Any]:
    """Return theta'' in rad/s^2 as a function of theta and theta' by Eksergian's equation.

    Of arrays (n,), or with ``math`` for ``of`` of numbers, ten times as fast. It is zero under a
    constant-speed drive.

    Raises:
        ValueError: the drive prescribes a speed that changes, which is a function of time.
    """
    if scene.drive.kind == "constant-speed":
        return lambda theta, _: 0.0 * theta
    if scene.speed_is_prescribed:
        raise ValueError(f"drive.kind: expected one that leaves the crank free, got {scene.drive.kind}")
    m, g = masses(scene).ravel().tolist(), scene.weight_m_s2
    torque, load = drive_torque(scene), slider_force(scene)

    def acceleration(theta: Any, speed: Any) -> Any:
        X, X_1, X_2 = _coordinates(scene, theta, of)
        J = sum(mass * x * x for mass, x in zip(m, X_1, strict=True))
        J_1 = 2 * sum(mass * x * y for mass, x, y in zip(m, X_1, X_2, strict=True))
        V_1 = g * sum(mass * y for mass, y in zip(m[1::3], X_1[1::3], strict=True))
        Q = torque(speed)
        if load is not None:
            Q = Q + load(theta, X[SLIDER_X], X_1[SLIDER_X] * speed) * X_1[SLIDER_X]
        return (Q - V_1 - J_1 * speed**2 / 2) / J

    return acceleration


@dataclass(frozen=True)
class Motion:
    """The crank's angle, speed and acceleration, (n,) each, and what was integrated along with them.

    ``squares`` is the integral of x'^2 over time, None without viscous load, and ``motor_work_J`` that of a
    motor's power, None without one.
    """

    theta: FloatArray
    speed: FloatArray
    theta_2: FloatArray
    squares: FloatArray | None = None
    motor_work_J: FloatArray | None = None


def crank_motion(scene: Scene, time_s: FloatArray, pieces: int) -> Motion:
    """Return the crank's motion at times (n,) in s, integrated in so many pieces at least."""
    return (_prescribed if scene.speed_is_prescribed else _integrated)(scene, time_s, pieces)


def _prescribed(scene: Scene, time_s: FloatArray, pieces: int) -> Motion:
    """Return the motion that the drive prescribes; x'^2 is integrated by Gauss-Legendre between its knots."""
    motion, angle = prescribed_motion(scene), scene.start.crank_angle_rad
    theta, speed = angle + motion.turned_rad(time_s), motion.speed_rad_s(time_s)
    theta_2 = motion.acceleration_rad_s2(time_s)
    if not is_viscous(scene):
        return Motion(theta, speed, theta_2)
    # As many pieces as keep the crank from turning, and its speed from swinging, far in any of them.
    fastest = np.abs(motion.speed_rad_s(np.linspace(0.0, time_s[-1], pieces + 1))).max()
    swings = 2 * np.pi * getattr(scene.drive, "frequency_Hz", 0.0)
    pieces = max(pieces, math.ceil((fastest + swings) * time_s[-1] / LONGEST_PIECE_RAD))
    cuts = np.linspace(0.0, time_s[-1], pieces + 1)
    edges = np.unique(np.concatenate([cuts, time_s, motion.knots_s]))
    half = np.diff(edges)[:, None] / 2
    at = edges[:-1, None] + half * (1 + NODES)
    slope = np.asarray(slider_slope(scene)(angle + motion.turned_rad(at)))
    integrals = np.sum(half * WEIGHTS * (slope * motion.speed_rad_s(at)) ** 2, axis=1)
    total = _running_sum(integrals)[np.searchsorted(edges, time_s)]
    return Motion(theta, speed, theta_2, squares=total)


def _running_sum(terms: FloatArray) -> FloatArray:
    """Return the sums (n + 1,) of the first 0, 1, ... n terms; their rounding is carried on (Kahan 1965)."""
    sums, lost = [0.0], 0.0
    for term in terms.tolist():
        change = term + lost
        sums.append(sums[-1] + change)
        lost = change - (sums[-1] - sums[-2])
    return np.array(sums)


def slider_slope(scene: Scene, of: Any = np) -> Callable[[Any], Any]:
    """Return the slider's dx/dtheta in m as a function of theta."""
    return lambda theta: _coordinates(scene, theta, of)[1][SLIDER_X]


def _integrands(scene: Scene) -> dict[str, Callable[[float, float], float]]:
    """Return what is integrated over time along with a free crank, functions of theta and theta'."""
    found: dict[str, Callable[[float, float], float]] = {}
    if is_viscous(scene):
        slope = slider_slope(scene, math)
        found["squares"] = lambda theta, speed: (slope(theta) * speed) ** 2
    if scene.drive.kind == "motor":
        torque = drive_torque(scene)
        found["motor_work_J"] = lambda _, speed: torque(speed) * speed
    return found


def _integrated(scene: Scene, time_s: FloatArray, pieces: int) -> Motion:
    """Return the motion of a crank left free; every sample ends an integration, none is interpolated."""
    start, integrands = scene.start, _integrands(scene)
    per_sample = -(-pieces // (len(time_s) - 1))
    cuts = np.linspace(time_s[0], time_s[-1], per_sample * (len(time_s) - 1) + 1)
    zeros = [0.0] * len(integrands)
    states = [np.array([start.crank_angle_rad, start.crank_speed_rad_s, *zeros])]
    piece, lost = _piece(scene, integrands), np.zeros(len(states[0]))
    for begin, end in pairwise(cuts):
        state, now = states[-1], begin
        while now < end:
            # Only the deviation from uniform turning is integrated, and the rounding of each sum is carried
            # on (Kahan 1965): round-off does not build up with the number of turns.
            theta, speed, *_ = state.tolist()
            deviation, then = piece(theta, speed, now, end)
            change = deviation + np.array([speed * (then - now), 0, *zeros]) + lost
            lost = change - ((state + change) - state)
            state, now = state + change, then
        states.append(state)
    angles, speeds, *sums = np.array(states[::per_sample]).T
    theta_2 = crank_acceleration(scene)(angles, speeds)
    return Motion(angles, speeds, theta_2, **dict(zip(integrands, sums, strict=True)))


def _piece(
    scene: Scene, integrands: Mapping[str, Callable[[float, float], float]]
) -> Callable[[float, float, float, float], tuple[FloatArray, float]]:
    """Return a function of theta, theta' and two times, in between which it integrates.

    It returns the deviations of theta and theta' from uniform turning, with the integrals after them, and the
    time at which it ended: the later one, or that at which the crank came to a knot of the gas's table, where
    the force's third derivative jumps, or of straight lines its first.
    """
    from scipy.integrate import solve_ivp  # it takes a moment, and uniform turning does without

    acceleration = crank_acceleration(scene, math)
    zeros = [0.0] * (2 + len(integrands))

    def run(theta: float, speed: float, begin: float, duration: float, events: Any = None) -> Any:
        left = iter(range(MOST_EVALUATIONS))

        def derivative(elapsed: float, y: FloatArray) -> list[float]:
            if next(left, None) is None:
                raise SimulationFailed(f"{MOST_EVALUATIONS} evaluations do not get past t = {begin:.6g} s")
            deviation, rate, *_ = y.tolist()
            angle, now = theta + speed * elapsed + deviation, speed + rate
            return [rate, acceleration(angle, now), *(of(angle, now) for of in integrands.values())]

        try:
            return solve_ivp(
                derivative,
                (0, duration),
                zeros,
                "DOP853",
                events=events,
                rtol=RELATIVE_TOLERANCE,
                atol=ABSOLUTE_TOLERANCE,
            )
        except (OverflowError, ValueError):  # Python's own numbers raise where NumPy's become infinite
            raise SimulationFailed(f"the motion overflows after t = {begin:.6g} s") from None

    def piece(theta: float, speed: float, begin: float, end: float) -> tuple[FloatArray, float]:
        knots = gas_knots_rad(scene, theta)
        if knots is None:
            return run(theta, speed, begin, end - begin).y[:, -1], end
        below, above = knots

        def left(elapsed: float, y: FloatArray) -> float:
            angle = theta + speed * elapsed + y[0]
            return float((angle - below) * (above - angle))

        left.terminal = True  # type: ignore[attr-defined]
        tried = run(theta, speed, begin, end - begin, left)
        if tried.status == 1 and begin < begin + tried.t[-1] < end:
            # Once more up to there: the state at an event is an interpolated one.
            end = begin + float(tried.t[-1])
            tried = run(theta, speed, begin, end - begin)
        return tried.y[:, -1], end

    return piece

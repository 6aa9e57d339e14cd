"""Loads: what each puts into {F(q, q', t)} of (2), and its potential energy, if it has one.

A new load is a class with its line in ``forces_of``, and in ``potential_J`` or ``integrated``. A force along
a line acts on its point of body j, and turns with the line: with u along it, s = u.(p_j - p_i), F is F u on
body j at p_j, and on body i, at the place of p_j, -F u.
"""

from dataclasses import dataclass

import numpy as np

from reference_solver.mechanism.data import GROUND, Ends, Line, Point, Spring
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.mechanism.points import MovingPoint, State, ends_of
from reference_solver.tape import Array, FloatArray, Scalar, array, sqrt

#: Generalised forces (3,) by body.
Forces = dict[int, Array]


@dataclass(frozen=True)
class Torque:
    """A constant torque on a body, counter-clockwise positive."""

    body: int
    torque_N_m: float


@dataclass(frozen=True)
class MotorTorque:
    """A torque on a body that falls with its speed: stall torque (1 - speed/no-load speed)."""

    body: int
    stall_torque_N_m: float
    no_load_speed_rad_s: float


@dataclass(frozen=True)
class TurningDamper:
    """A damper of a body's turning: a torque of -c phi'."""

    body: int
    damping_N_m_s: float


@dataclass(frozen=True)
class TorqueByTime:
    """A torque on a body by the time in s since the run's start, of a function without jumps."""

    body: int
    torque_N_m: PiecewiseCubic


@dataclass(frozen=True)
class TorqueBySpeed:
    """A torque on a body by its speed in rad/s, as a motor's table has it.

    No step is cut where the function has a kink: there RK4 and error control lose their order for a step.
    """

    body: int
    torque_N_m: PiecewiseCubic


@dataclass(frozen=True)
class ConstantForce(Line):
    """A constant force along a line."""

    force_N: float


@dataclass(frozen=True)
class ForceByTime(Line):
    """A force along a line by the time in s since the run's start, of a function without jumps."""

    force_N: PiecewiseCubic


@dataclass(frozen=True)
class LineSpring(Line):
    """A spring that pulls the point to s = ``free_position_m``."""

    stiffness_N_m: float
    free_position_m: float


@dataclass(frozen=True)
class LineDamper(Line):
    """A damper of s: viscous friction of a guide."""

    damping_N_s_m: float


@dataclass(frozen=True)
class GasForce(Line):
    """A force along a line that goes by the angle of another body, the crank of a cylinder.

    What it gives in a revolution it does not take back.
    """

    crank: int
    force_N: PiecewiseCubic


OnBody = Torque | MotorTorque | TurningDamper | TorqueByTime | TorqueBySpeed
AlongLine = ConstantForce | ForceByTime | LineSpring | LineDamper | GasForce
Load = OnBody | AlongLine | Spring


def integrated(load: Load) -> bool:
    """Whether work of a load, of a spring that of its damper, is integrated: it has no potential."""
    if isinstance(load, Spring):
        return load.damping_N_s_m != 0
    return not isinstance(load, Torque | ConstantForce | LineSpring)


def forces_of(load: Load, state: State) -> Forces:
    """Return the forces of a load on bodies."""
    match load:
        case Spring():
            return _pulled(load, state)
        case ConstantForce() | ForceByTime() | LineSpring() | LineDamper() | GasForce():
            return _along(load, state, _force(load, state))
    return {load.body: array([0.0, 0.0, _torque(load, state)])}


def _torque(load: OnBody, state: State) -> Scalar:
    speed = state.velocity(load.body)[2]
    match load:
        case MotorTorque():
            return load.stall_torque_N_m * (1.0 - speed / load.no_load_speed_rad_s)
        case TurningDamper():
            return -load.damping_N_m_s * speed
        case TorqueByTime():
            return load.torque_N_m.at(state.t)[0]
        case TorqueBySpeed():
            return load.torque_N_m.at(speed)[0]
    return load.torque_N_m


# s = u.d, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n
# s' = u.d' + phi_i' n.d
def _force(load: AlongLine, state: State) -> Scalar:
    (i, j), u = ends_of(load, state), state.direction(load.body_i, load.angle_rad)
    match load:
        case ForceByTime():
            return load.force_N.at(state.t)[0]
        case LineSpring():
            return -load.stiffness_N_m * (u @ (j.place - i.place) - load.free_position_m)
        case LineDamper():
            across = array([-u[1], u[0]])
            rate = u @ (j.rate - i.rate) + i.spin * (across @ (j.place - i.place))
            return -load.damping_N_s_m * rate
        case GasForce():
            return load.force_N.at(state.position(load.crank)[2])[0]
    return load.force_N


def _along(line: Line, state: State, force: Scalar) -> Forces:
    """Return a force in N along a line on the point of body j, and its reaction at the same place."""
    _, j = ends_of(line, state)
    pull = force * state.direction(line.body_i, line.angle_rad)
    forces = {line.body_j: pull @ j.jacobian}
    if line.body_i != GROUND:
        lever = j.place - state.position(line.body_i)[:2]
        forces[line.body_i] = -array([pull[0], pull[1], lever[0] * pull[1] - lever[1] * pull[0]])
    return forces


def _pulled(spring: Spring, state: State) -> Forces:
    """Return the pull along the line between two points; without free length and damper also at length 0."""
    i, j = ends_of(spring, state)
    d = j.place - i.place
    if not (spring.free_length_m or spring.damping_N_s_m):
        return pair(i, j, -spring.stiffness_N_m * d)
    length = sqrt(d @ d)
    closing = spring.damping_N_s_m * (d @ (j.rate - i.rate))
    tension = spring.stiffness_N_m * (length - spring.free_length_m) + closing / length
    return pair(i, j, (-(tension / length)) * d)


def pair(
    i: MovingPoint, j: MovingPoint, force: Array, twist_i: Scalar = 0.0, twist_j: Scalar = 0.0
) -> Forces:
    """Return a force (2,) on point j, its reaction on point i, and a torque on each body."""
    on_i, on_j = array([0.0, 0.0, twist_i]), array([0.0, 0.0, twist_j])
    return {i.body: on_i - force @ i.jacobian, j.body: on_j + force @ j.jacobian}


def power_of(load: Load, forces: Forces, state: State) -> Scalar:
    """Return the power in W of a load's forces on bodies, as far as it is integrated."""
    if isinstance(load, Spring):
        i, j = ends_of(load, state)
        d = j.place - i.place
        closing = d @ (j.rate - i.rate)
        return -load.damping_N_s_m * (closing * closing / (d @ d))
    return sum(force @ state.velocity(body) for body, force in forces.items())


def potential_J(load: Load, q: FloatArray) -> FloatArray | None:
    """Return the potential energy (s,) at coordinates (s, n); None of loads without one."""
    match load:
        case Torque():
            return np.asarray(-load.torque_N_m * q[:, 3 * load.body + 2])
        case ConstantForce():
            return np.asarray(-load.force_N * _along_m(load, q))
        case LineSpring():
            return np.asarray(load.stiffness_N_m * (_along_m(load, q) - load.free_position_m) ** 2 / 2)
        case Spring():
            return np.asarray(load.stiffness_N_m * (distance_m(load, q) - load.free_length_m) ** 2 / 2)
    return None


def distance_m(ends: Ends, q: FloatArray) -> FloatArray:
    """Return the distance (s,) of a part's ends at coordinates (s, n)."""
    d = place_m(q, ends.body_j, ends.point_j) - place_m(q, ends.body_i, ends.point_i)
    return np.asarray(np.hypot(*d.T))


def _along_m(line: Line, q: FloatArray) -> FloatArray:
    x, y = (place_m(q, line.body_j, line.point_j) - place_m(q, line.body_i, line.point_i)).T
    angle = line.angle_rad + (0.0 if line.body_i == GROUND else q[:, 3 * line.body_i + 2])
    return np.asarray(np.cos(angle) * x + np.sin(angle) * y)


def place_m(q: FloatArray, body: int, point: Point) -> FloatArray:
    """Return where a point of a body is, (s, 2), at coordinates (s, n)."""
    if body == GROUND:
        return np.tile(point, (len(q), 1))
    x, y, angle = q[:, 3 * body : 3 * body + 3].T
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([x + cos * point[0] - sin * point[1], y + sin * point[0] + cos * point[1]])

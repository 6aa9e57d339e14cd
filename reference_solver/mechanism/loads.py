"""Loads: what each puts into {F(q, q', t)} of (2), and its potential energy, if it has one.

A load is where it acts, and a law of its size by s, s' and the time. A ``Torque`` turns a body against
another one, and s is its angle from that. A ``Force`` acts along a line on its point of body j, and turns
with the line: with u along it, s = u.(p_j - p_i), F is F u on body j at p_j, and on body i, at the place of
p_j, -F u.

A new law is a class with its line in ``_size``, and in ``potential_J`` if it has one.
"""

from dataclasses import dataclass

import numpy as np

from reference_solver.mechanism.data import GROUND, Ends, Line, Motor, Spring
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.mechanism.points import MovingPoint, State, ends_of, line_at
from reference_solver.tape import Array, FloatArray, Scalar, array, sqrt

#: Generalised forces (3,) by body.
Forces = dict[int, Array]


@dataclass(frozen=True)
class Constant:
    """A size in N, or of torques in N m."""

    size: float


@dataclass(frozen=True)
class Restoring:
    """A spring to s = ``free``: -k (s - free)."""

    stiffness: float
    free: float


@dataclass(frozen=True)
class Damping:
    """A damper of s, such as viscous friction of a guide: -c s'."""

    damping: float


@dataclass(frozen=True)
class ByTime:
    """A function without jumps of the time in s since the run's start."""

    table: PiecewiseCubic


@dataclass(frozen=True)
class BySpeed:
    """A function of s', as a motor's table has it.

    No step is cut where the function has a kink: there RK4 and error control lose their order for a step.
    """

    table: PiecewiseCubic


@dataclass(frozen=True)
class ByAngle:
    """A function of the angle of another body, the crank of a cylinder.

    What it gives in a revolution it does not take back.
    """

    table: PiecewiseCubic
    crank: int


Law = Constant | Restoring | Damping | Motor | ByTime | BySpeed | ByAngle


@dataclass(frozen=True)
class Torque:
    """A torque on a body, counter-clockwise positive, and the opposite one on what it acts ``against``."""

    body: int
    law: Law
    against: int = GROUND

    def turned(self, state: State) -> tuple[Scalar, Scalar]:
        """Return s and s'."""
        (*_, angle), (*_, speed) = state.position(self.body), state.velocity(self.body)
        return angle - state.position(self.against)[2], speed - state.velocity(self.against)[2]


@dataclass(frozen=True)
class Force(Line):
    """A force along a line."""

    law: Law


Load = Torque | Force | Spring


def integrated(load: Load) -> bool:
    """Whether work of a load, of a spring that of its damper, is integrated: it has no potential."""
    if isinstance(load, Spring):
        return load.damping_N_s_m != 0
    return not isinstance(load.law, Constant | Restoring)


# s = u.d, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n
# s' = u.d' + phi_i' n.d
def forces_of(load: Load, state: State) -> Forces:
    """Return the forces of a load on bodies."""
    if isinstance(load, Spring):
        return _pulled(load, state)
    if isinstance(load, Torque):
        torque = array([0.0, 0.0, size_of(load.law, *load.turned(state), state)])
        return {load.body: torque, load.against: -torque}
    i, j, u, across, d = line_at(load, state)
    pull = size_of(load.law, u @ d, u @ (j.rate - i.rate) + i.spin * (across @ d), state) * u
    forces = {load.body_j: pull @ j.jacobian}
    if load.body_i != GROUND:
        lever = j.place - state.position(load.body_i)[:2]
        forces[load.body_i] = -array([pull[0], pull[1], lever[0] * pull[1] - lever[1] * pull[0]])
    return forces


def size_of(law: Law, s: Scalar, rate: Scalar, state: State) -> Scalar:
    """Return the size of a force or torque at s and s'."""
    match law:
        case Constant(size):
            return size
        case Restoring(stiffness, free):
            return -stiffness * (s - free)
        case Damping(damping):
            return -damping * rate
        case Motor(stall, no_load_speed):
            return stall * (1.0 - rate / no_load_speed)
        case ByTime(table):
            return table.at(state.t)[0]
        case BySpeed(table):
            return table.at(rate)[0]
        case ByAngle(table, crank):
            return table.at(state.position(crank)[2])[0]


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
    if isinstance(load, Spring):
        return np.asarray(load.stiffness_N_m * (distance_m(load, q) - load.free_length_m) ** 2 / 2)
    state = State(q.T, q.T)  # of all samples at once
    if isinstance(load, Torque):
        s, _ = load.turned(state)
    else:
        along = state.direction(load.body_i, load.angle_rad).T
        s = (along * apart_m(load, q)).sum(axis=1)
    match load.law:
        case Constant(size):
            return np.asarray(-size * s)
        case Restoring(stiffness, free):
            return np.asarray(stiffness * (s - free) ** 2 / 2)
    return None


def stored_J(stiffness: Array, exponent: Array, depth_m: Array) -> FloatArray:
    """Return what an elastic force K delta^n stores, K delta^(n+1)/(n+1), at depths; 0 at negative ones."""
    power = exponent + 1
    return np.asarray(stiffness * np.maximum(depth_m, 0.0) ** power / power)


def apart_m(ends: Ends, q: FloatArray) -> FloatArray:
    """Return the vector from a part's one end to the other, (s, 2), at coordinates (s, n)."""
    i, j = ends_of(ends, State(q.T, q.T))  # of all samples at once
    return np.broadcast_to(j.place.T - i.place.T, (len(q), 2))


def distance_m(ends: Ends, q: FloatArray) -> FloatArray:
    """Return the distance (s,) of a part's ends at coordinates (s, n)."""
    return np.asarray(np.hypot(*apart_m(ends, q).T))

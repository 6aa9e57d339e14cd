"""What the loads put into {F(q, q', t)} of (2): one function for each kind, in ``LOADS``.

If only what is ``stored`` is asked for, that is the part that has a potential.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from reference_solver.mechanism.mechanism import (
    AlongLine,
    ConstantForce,
    GasForce,
    LineDamper,
    LineSpring,
    MotorTorque,
    SpringDamper,
    Torque,
)
from reference_solver.mechanism.points import Point, State, ends_of
from reference_solver.tape import Array, Scalar, array, cos, sin, sqrt

#: Generalised forces (3,) by body.
Forces = dict[int, Array]


def torque(load: Torque, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return a constant torque: it has a potential, -T phi."""
    return {load.body: array([0.0, 0.0, load.torque_N_m])}


def motor_torque(load: MotorTorque, state: State, stored: bool) -> Forces:
    """Return a torque that is linear in the speed."""
    speed = state.velocity(load.body)[2]
    return (
        {}
        if stored
        else {load.body: array([0.0, 0.0, load.stall_torque_N_m * (1.0 - speed / load.no_load_speed_rad_s)])}
    )


def constant_force(load: ConstantForce, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return a constant force on a body's centre: it has a potential, -F s."""
    return along(load, load.force_N)


def line_spring(load: LineSpring, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return the pull of a spring along a line."""
    way = direction_of(load) @ state.position(load.body)[:2]
    return along(load, -load.stiffness_N_m * (way - load.free_position_m))


def line_damper(load: LineDamper, state: State, stored: bool) -> Forces:
    """Return the force of a damper along a line."""
    rate = direction_of(load) @ state.velocity(load.body)[:2]
    return {} if stored else along(load, -load.damping_N_s_m * rate)


def gas_force(load: GasForce, state: State, stored: bool) -> Forces:
    """Return a force by the angle of the crank: what it gives in a revolution it does not take back."""
    return {} if stored else along(load, load.force_N.at(state.position(load.crank)[2])[0])


def direction_of(load: AlongLine) -> Array:
    """Return the unit vector (2,) along a load's line."""
    return array([cos(load.angle_rad), sin(load.angle_rad)])


def along(load: AlongLine, force: Scalar) -> Forces:
    """Return a force in N along a load's line, on its body's centre."""
    return {load.body: array([*(force * direction_of(load)), 0.0])}


def spring_damper(load: SpringDamper, state: State, stored: bool) -> Forces:
    """Return the pull along the line between two points; if ``stored``, of the spring alone."""
    i, j = ends_of(load, state)
    d = j.place - i.place
    length = sqrt(d @ d)
    tension = load.stiffness_N_m * (length - load.free_length_m)
    if not stored:
        tension = tension + load.damping_N_s_m * (d @ (j.rate - i.rate)) / length
    return pair(i, j, (-(tension / length)) * d)


def pair(i: Point, j: Point, force: Array, twist_i: Scalar = 0.0, twist_j: Scalar = 0.0) -> Forces:
    """Return a force (2,) on point j, its reaction on point i, and a torque on each body."""
    on_i, on_j = array([0.0, 0.0, twist_i]), array([0.0, 0.0, twist_j])
    return {i.body: on_i - force @ i.jacobian, j.body: on_j + force @ j.jacobian}


#: The function of each kind of load: of it, the state, and whether only what has a potential is asked for.
LOADS: Mapping[type, Callable[[Any, State, bool], Forces]] = MappingProxyType(
    {
        Torque: torque,
        MotorTorque: motor_torque,
        SpringDamper: spring_damper,
        ConstantForce: constant_force,
        LineSpring: line_spring,
        LineDamper: line_damper,
        GasForce: gas_force,
    }
)
#: Kinds whose work is integrated beside the motion: it is no function of where the bodies are.
INTEGRATED = (MotorTorque, LineDamper, GasForce)


def power_of(forces: Forces, state: State) -> Scalar:
    """Return the power in W of forces on bodies."""
    return sum(force @ state.velocity(body) for body, force in forces.items())

"""What the loads put into {F(q, q', t)} of (2): one function for each kind, in ``LOADS``.

If only what is ``stored`` is asked for, that is the part that has a potential.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from reference_solver.mechanism.data import Motor
from reference_solver.mechanism.mechanism import (
    GROUND,
    AlongLine,
    ConstantForce,
    ForceByTime,
    GasForce,
    LineDamper,
    LineSpring,
    Load,
    MotorTorque,
    SpringDamper,
    Torque,
    TorqueBySpeed,
    TorqueByTime,
    TurningDamper,
)
from reference_solver.mechanism.points import Point, State, ends_of
from reference_solver.tape import Array, Scalar, array, sqrt

#: Generalised forces (3,) by body.
Forces = dict[int, Array]


def torque(load: Torque, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return a constant torque: it has a potential, -T phi."""
    return {load.body: array([0.0, 0.0, load.torque_N_m])}


def motor_torque_N_m(motor: Motor | MotorTorque, speed_rad_s: Scalar) -> Scalar:
    """Return the torque of a motor that is linear in its speed, at one or at an array of speeds."""
    return motor.stall_torque_N_m * (1.0 - speed_rad_s / motor.no_load_speed_rad_s)


def motor_torque(load: MotorTorque, state: State, stored: bool) -> Forces:
    """Return a torque that is linear in the speed."""
    speed = state.velocity(load.body)[2]
    return {} if stored else turning(load.body, motor_torque_N_m(load, speed))


def turning_damper(load: TurningDamper, state: State, stored: bool) -> Forces:
    """Return a torque against the turning."""
    return {} if stored else turning(load.body, -load.damping_N_m_s * state.velocity(load.body)[2])


def torque_by_time(load: TorqueByTime, state: State, stored: bool) -> Forces:
    """Return a torque by the time."""
    return {} if stored else turning(load.body, load.torque_N_m.at(state.t)[0])


def torque_by_speed(load: TorqueBySpeed, state: State, stored: bool) -> Forces:
    """Return a torque by the speed."""
    return {} if stored else turning(load.body, load.torque_N_m.at(state.velocity(load.body)[2])[0])


def turning(body: int, torque: Scalar) -> Forces:
    """Return a torque in N m on a body."""
    return {body: array([0.0, 0.0, torque])}


def constant_force(load: ConstantForce, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return a constant force along a line: it has a potential, -F s."""
    return along(load, state, load.force_N)


def force_by_time(load: ForceByTime, state: State, stored: bool) -> Forces:
    """Return a force along a line by the time."""
    return {} if stored else along(load, state, load.force_N.at(state.t)[0])


def line_spring(load: LineSpring, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return the pull of a spring along a line: it has a potential, k (s - free position)^2/2."""
    i, j = ends_of(load, state)
    way = state.direction(load.body_i, load.angle_rad) @ (j.place - i.place)
    return along(load, state, -load.stiffness_N_m * (way - load.free_position_m))


# s = u.d, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n
# s' = u.d' + phi_i' n.d
def line_damper(load: LineDamper, state: State, stored: bool) -> Forces:
    """Return the force of a damper along a line."""
    i, j = ends_of(load, state)
    u = state.direction(load.body_i, load.angle_rad)
    across = array([-u[1], u[0]])
    rate = u @ (j.rate - i.rate) + i.spin * (across @ (j.place - i.place))
    return {} if stored else along(load, state, -load.damping_N_s_m * rate)


def gas_force(load: GasForce, state: State, stored: bool) -> Forces:
    """Return a force by the angle of the crank: what it gives in a revolution it does not take back."""
    return {} if stored else along(load, state, load.force_N.at(state.position(load.crank)[2])[0])


def along(load: AlongLine, state: State, force: Scalar) -> Forces:
    """Return a force in N along a load's line on the point of body j, and its reaction at the same place."""
    _, j = ends_of(load, state)
    pull = force * state.direction(load.body_i, load.angle_rad)
    forces = {load.body_j: pull @ j.jacobian}
    if load.body_i != GROUND:
        lever = j.place - state.position(load.body_i)[:2]
        forces[load.body_i] = -array([pull[0], pull[1], lever[0] * pull[1] - lever[1] * pull[0]])
    return forces


def spring_damper(load: SpringDamper, state: State, stored: bool) -> Forces:
    """Return the pull along the line between two points; if ``stored``, of the spring alone.

    One without a free length and a damper has a force at length 0 too, which is 0.
    """
    i, j = ends_of(load, state)
    d = j.place - i.place
    if not (load.free_length_m or load.damping_N_s_m):
        return pair(i, j, -load.stiffness_N_m * d)
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
        TurningDamper: turning_damper,
        TorqueByTime: torque_by_time,
        TorqueBySpeed: torque_by_speed,
        SpringDamper: spring_damper,
        ConstantForce: constant_force,
        ForceByTime: force_by_time,
        LineSpring: line_spring,
        LineDamper: line_damper,
        GasForce: gas_force,
    }
)
#: Kinds whose work is integrated beside the motion: it is no function of where the bodies are.
INTEGRATED = (
    *(MotorTorque, TurningDamper, TorqueByTime, TorqueBySpeed),
    *(ForceByTime, LineDamper, GasForce),
)


def integrated(load: Load) -> bool:
    """Whether the work of a load is integrated beside the motion: of a spring with a damper the damper's."""
    return isinstance(load, INTEGRATED) or (isinstance(load, SpringDamper) and load.damping_N_s_m != 0)


def power_of(load: Load, forces: Forces, state: State) -> Scalar:
    """Return the power in W of a load's forces on bodies, as far as it is integrated."""
    if isinstance(load, SpringDamper):
        i, j = ends_of(load, state)
        d = j.place - i.place
        closing = d @ (j.rate - i.rate)
        return -load.damping_N_s_m * (closing * closing / (d @ d))
    return sum(force @ state.velocity(body) for body, force in forces.items())

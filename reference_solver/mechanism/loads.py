"""What the loads put into {F(q, q')} of (2): one function for each kind, in ``LOADS``."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from reference_solver.mechanism.mechanism import SpringDamper, Torque
from reference_solver.mechanism.points import Point, State, ends_of
from reference_solver.tape import Array, Scalar, array, sqrt

#: Generalised forces (3,) by body.
Forces = dict[int, Array]


def torque(load: Torque, state: State, stored: bool) -> Forces:  # noqa: ARG001
    """Return a constant torque: it has a potential, -T phi."""
    return {load.body: array([0.0, 0.0, load.torque_N_m])}


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
    {Torque: torque, SpringDamper: spring_damper}
)

"""A plan as bodies and joints of a Pymunk space."""

import math
from collections.abc import Sequence

import pymunk

from engine_models.engine import FloatArray
from engine_models.pymunk.joints.plan import Joint, Plan
from reference_solver.mechanism.data import GROUND, Point

Bodies = tuple[pymunk.Body, ...]


def build(
    plan: Plan, gravity: Point, position: FloatArray, velocity: FloatArray, iterations: int, error_bias: float
) -> tuple[pymunk.Space, Bodies]:
    """Return the space and its bodies at positions and velocities (bodies, 3) of their centres of mass.

    There are no shapes, so nothing can ever touch.
    """
    space = pymunk.Space()
    space.iterations, space.gravity, space.damping = iterations, gravity, 1.0
    space.sleep_time_threshold = math.inf
    bodies = tuple(_body(plan, number, position, velocity) for number in range(len(plan.seats)))
    joints = [_joint(space, bodies, joint, plan.groove_m) for joint in plan.joints]
    for joint in joints:
        joint.error_bias = error_bias
        joint.max_bias = joint.max_force = math.inf
        joint.collide_bodies = False
    space.add(*bodies, *joints)
    return space, bodies


def _body(plan: Plan, number: int, position: FloatArray, velocity: FloatArray) -> pymunk.Body:
    seat, (x, y, phi), (x_rate, y_rate, spin) = (
        plan.seats[number],
        *(state[number].tolist() for state in (position, velocity)),
    )
    if seat.is_kinematic:
        body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    else:
        body = pymunk.Body(seat.mass_kg, seat.inertia_kg_m2)
    (o_x, o_y), cos, sin = seat.origin, math.cos(phi), math.sin(phi)
    arm_x, arm_y = cos * o_x - sin * o_y, sin * o_x + cos * o_y
    moves = x_rate - spin * arm_y, y_rate + spin * arm_x
    body.position, body.angle = seat.pivot or (x + arm_x, y + arm_y), phi
    body.velocity, body.angular_velocity = (0.0, 0.0) if seat.pivot else moves, spin
    return body


def _joint(
    space: pymunk.Space, bodies: Sequence[pymunk.Body], joint: Joint, reach_m: float
) -> pymunk.Constraint:
    one = space.static_body if joint.body_i == GROUND else bodies[joint.body_i]
    other = bodies[joint.body_j]
    if joint.kind == "pivot":
        return pymunk.PivotJoint(one, other, joint.point_i, joint.point_j)
    if joint.kind == "gear":
        return pymunk.GearJoint(one, other, other.angle - one.angle, 1.0)
    (x, y), a, b = joint.point_i, reach_m * math.cos(joint.angle_rad), reach_m * math.sin(joint.angle_rad)
    return pymunk.GrooveJoint(one, other, (x - a, y - b), (x + a, y + b), joint.point_j)

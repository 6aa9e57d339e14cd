"""The scene as bodies and ideal joints of a Pymunk space, and the pins that have room in their bearings."""

import math
from dataclasses import dataclass

import pymunk

from engine_models.mechanics.joints import End, ends
from engine_models.mechanics.start_check import checked_start
from engine_models.scene.scene import Clearance, Scene

Bodies = tuple[pymunk.Body, ...]

#: A body and a place on its x axis, in m from its origin.
Place = tuple[pymunk.Body, float]


@dataclass(frozen=True)
class Pin:
    """A bearing of radius R at (bearing_x, 0) of its body, a pin of radius R - c at (pin_x, 0) of its own."""

    bearing: pymunk.Body
    bearing_x: float
    pin: pymunk.Body
    pin_x: float
    clearance: Clearance


def crank_is_kinematic(scene: Scene) -> bool:
    """Return whether the crank is a kinematic body with its origin at O: at a given speed in an ideal joint.

    It needs no joint there, and no mass.
    """
    return scene.speed_is_prescribed and scene.clearance.O is None


def build(scene: Scene, iterations: int, error_bias: float) -> tuple[pymunk.Space, Bodies]:
    """Return the space at t = 0 and its crank, rod and slider, or its crank alone.

    The slider cannot turn. A crank at a given speed with clearance at O is free to move, but its spin is not:
    its moment of inertia is infinite. There are no shapes, so nothing can ever touch.
    """
    position, velocity = checked_start(scene)
    driven = scene.speed_is_prescribed
    if crank_is_kinematic(scene):
        crank = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        position[0, :2] = velocity[0, :2] = 0.0
    else:
        crank = pymunk.Body(scene.crank.mass_kg, math.inf if driven else scene.crank.inertia_kg_m2)
    bodies: Bodies = (crank,)
    if scene.is_crank_slider:
        _, link, block = scene.crank_slider()
        rod = pymunk.Body(link.mass_kg, link.inertia_kg_m2)
        bodies = (crank, rod, pymunk.Body(block.mass_kg, math.inf))
    for body, (x, y, phi), (x_rate, y_rate, phi_rate) in zip(
        bodies, position.tolist(), velocity.tolist(), strict=True
    ):
        body.position, body.angle = (x, y), phi
        body.velocity, body.angular_velocity = (x_rate, y_rate), phi_rate

    space = pymunk.Space()
    space.iterations = iterations
    space.gravity = (0.0, -scene.weight_m_s2)
    space.damping = 1.0
    space.sleep_time_threshold = math.inf
    joints: list[pymunk.Constraint] = [
        pymunk.PivotJoint(bearing, pin, (bearing_x, 0.0), (pin_x, 0.0))
        for name, ((bearing, bearing_x), (pin, pin_x)) in _sides(scene, space, bodies).items()
        if name not in scene.joints_with_clearance and not (name == "O" and crank_is_kinematic(scene))
    ]
    if scene.is_crank_slider:
        _, link, _ = scene.crank_slider()
        end = 2 * (scene.crank.length_m + link.length_m)  # of the groove, out of the slider's reach
        joints.append(pymunk.GrooveJoint(space.static_body, bodies[2], (-end, 0.0), (end, 0.0), (0.0, 0.0)))
    for joint in joints:
        joint.error_bias = error_bias
        joint.max_bias = joint.max_force = math.inf
        joint.collide_bodies = False
    space.add(*bodies, *joints)
    return space, bodies


def pins(scene: Scene, space: pymunk.Space, bodies: Bodies) -> dict[str, Pin]:
    """Return the pins of the joints with clearance, in the order O, A, B."""
    sides = _sides(scene, space, bodies)
    return {
        name: Pin(*bearing, *pin, clearance)
        for name, clearance in scene.clearances.items()
        for bearing, pin in [sides[name]]
    }


def _sides(scene: Scene, space: pymunk.Space, bodies: Bodies) -> dict[str, tuple[Place, Place]]:
    """Return where the bearing and the pin of each joint are on its two bodies."""

    def place(end: End) -> Place:
        body, distance = end
        return (space.static_body if body is None else bodies[body]), distance

    if crank_is_kinematic(scene):
        crank = scene.crank.model_copy(update={"centre_of_mass_m": 0.0})
        scene = scene.model_copy(update={"crank": crank})
    return {name: (place(bearing), place(pin)) for name, (pin, bearing) in ends(scene).items()}

"""The scene as bodies and ideal joints of a Pymunk space, and the pins that have room in their bearings."""

import math

import pymunk

from engine_models.mechanics.start_check import checked_start
from engine_models.pymunk.pin import PinInBearing
from engine_models.scene.scene import Scene

Bodies = tuple[pymunk.Body, ...]


def crank_is_kinematic(scene: Scene) -> bool:
    """Return whether the crank is a kinematic body with its origin at O: at constant speed in an ideal joint.

    It needs no joint there, and no mass.
    """
    return scene.drive.kind == "constant-speed" and scene.clearance.O is None


def build(scene: Scene, iterations: int, error_bias: float) -> tuple[pymunk.Space, Bodies]:
    """Return the space at t = 0 and its crank, rod and slider, or its crank alone.

    The slider cannot turn. A crank at constant speed with clearance at O is free to move but cannot change
    its spin: its moment of inertia is infinite. There are no shapes, so nothing can ever touch.
    """
    position, velocity = checked_start(scene)
    driven = scene.drive.kind == "constant-speed"
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
    space.gravity = (0.0, -scene.gravity_m_s2)
    space.damping = 1.0
    space.sleep_time_threshold = math.inf
    joints: list[pymunk.Constraint] = [
        pymunk.PivotJoint(a, b, (a_x, 0.0), (b_x, 0.0))
        for name, ((a, a_x), (b, b_x)) in _ends(scene, space, bodies).items()
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


def pins(scene: Scene, space: pymunk.Space, bodies: Bodies) -> list[PinInBearing]:
    """Return the pins of the joints with clearance, in the order O, A, B."""
    ends = _ends(scene, space, bodies)
    return [
        PinInBearing(name, *ends[name], getattr(scene.clearance, name))
        for name in scene.joints_with_clearance
    ]


def _ends(
    scene: Scene, space: pymunk.Space, bodies: Bodies
) -> dict[str, tuple[tuple[pymunk.Body, float], tuple[pymunk.Body, float]]]:
    """Return where each joint is on its two bodies, the one nearer the crank pivot first: x along the link.

    All joints lie on the lines of their links.
    """
    s = 0.0 if crank_is_kinematic(scene) else scene.crank.centre_of_mass_m
    crank = bodies[0]
    ends = {"O": ((space.static_body, 0.0), (crank, -s))}
    if scene.is_crank_slider:
        _, rod, slider = bodies
        _, link, _ = scene.crank_slider()
        d = link.centre_of_mass_m
        ends["A"] = ((crank, scene.crank.length_m - s), (rod, -d))
        ends["B"] = ((rod, link.length_m - d), (slider, 0.0))
    return ends

"""The ideal crank-slider as bodies and joints of a Pymunk space, and the loop that steps and reads it."""

import math
from time import perf_counter

import numpy as np
import pymunk
from numpy.typing import NDArray
from pymunk import batch

from engine_models.assembly import assembled
from engine_models.engine import FloatArray
from engine_models.scene import Scene

Bodies = tuple[pymunk.Body, pymunk.Body, pymunk.Body]

#: Sweeps in the first kicks of a half-kick start. They have no impulses of a like step to start from: kick 0
#: none at all, kicks 1 and 2 those of an unlike one; 3 and 4 share in telling the force at t = 0 (see
#: PymunkEngine). 100 sweeps are enough. The change to fewer leaves a ripple of some 1e-4 of the force at
#: dt = 5e-5 s, of order 1, for the next eight kicks.
START_ITERATIONS, START_KICKS = 200, 5

STATE = (
    batch.BodyFields.POSITION
    | batch.BodyFields.ANGLE
    | batch.BodyFields.VELOCITY
    | batch.BodyFields.ANGULAR_VELOCITY
)


def build(scene: Scene, iterations: int, error_bias: float) -> tuple[pymunk.Space, Bodies]:
    """Return the space at t = 0 and its crank, rod and slider.

    The slider cannot turn. A constant-speed drive is a kinematic crank with its origin at O: it needs no
    joint there, and no mass. There are no shapes, so nothing can ever touch.
    """
    position, velocity = assembled(scene, scene.start.crank_angle_rad, scene.start.crank_speed_rad_s)
    driven = scene.drive.kind == "constant-speed"
    if driven:
        crank = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        position[0, :2] = velocity[0, :2] = 0.0
    else:
        crank = pymunk.Body(scene.crank.mass_kg, scene.crank.inertia_kg_m2)
    rod = pymunk.Body(scene.rod.mass_kg, scene.rod.inertia_kg_m2)
    slider = pymunk.Body(scene.slider.mass_kg, math.inf)
    bodies = (crank, rod, slider)
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
    s, r = 0.0 if driven else scene.crank.centre_of_mass_m, scene.crank.length_m
    d, length = scene.rod.centre_of_mass_m, scene.rod.length_m
    end = 2 * (r + length)  # of the groove, out of the slider's reach
    joints: list[pymunk.Constraint] = [
        pymunk.PivotJoint(crank, rod, (r - s, 0.0), (-d, 0.0)),
        pymunk.PivotJoint(rod, slider, (length - d, 0.0), (0.0, 0.0)),
        pymunk.GrooveJoint(space.static_body, slider, (-end, 0.0), (end, 0.0), (0.0, 0.0)),
    ]
    if not driven:
        joints.insert(0, pymunk.PivotJoint(space.static_body, crank, (0.0, 0.0), (-s, 0.0)))
    for joint in joints:
        joint.error_bias = error_bias
        joint.max_bias = joint.max_force = math.inf
        joint.collide_bodies = False
    space.add(*bodies, *joints)
    return space, bodies


def run(
    space: pymunk.Space,
    bodies: Bodies,
    dt: float,
    *,
    crank_torque_N_m: float | None,
    half_kick_start: bool,
    read_after: NDArray[np.int64],
) -> tuple[FloatArray, FloatArray, float]:
    """Step the space and read it after the given steps, increasing from 0 (before the first step).

    Returns:
        Positions and velocities as Pymunk stores them, each (reads, 3, 3): crank, rod, slider by (x, y, phi)
        of the body's origin; and the wall time in s of the calls of ``space.step`` and what must go with each
        (the loop, a torque that has to be set again), without the reading.
    """
    log, order = batch.Buffer(), _order_of_reading(space, bodies)
    iterations, done, solve_time = space.iterations, 0, 0.0

    def advance(step_s: float, steps: int) -> float:
        step, crank = space.step, bodies[0]
        started = perf_counter()
        for _ in range(steps):
            if crank_torque_N_m is not None:
                crank.torque = crank_torque_N_m  # every step ends by clearing the loads
            step(step_s)
        return perf_counter() - started

    if half_kick_start:
        space.iterations = max(iterations, START_ITERATIONS)
        for body in bodies:
            body.position_func = _stay
        solve_time += advance(dt / 2, 1)
        for body in bodies:
            body.position_func = pymunk.Body.update_position
    for target in read_after.tolist():
        if done == START_KICKS - 1:
            space.iterations = iterations
        solve_time += advance(dt, target - done)
        done = target
        batch.get_space_bodies(space, STATE, log)
    states = np.frombuffer(bytes(log.float_buf())).reshape(len(read_after), -1, 6)[:, order]
    return states[:, :, :3], states[:, :, 3:], solve_time


def _stay(body: pymunk.Body, dt: float) -> None:
    """Leave the body where it is: the position update of a step that only kicks."""


def _order_of_reading(space: pymunk.Space, bodies: Bodies) -> list[int]:
    """Return where the bodies stand in a batch reading of the space."""
    ids = batch.Buffer()
    batch.get_space_bodies(space, batch.BodyFields.BODY_ID, ids)
    listed = memoryview(ids.int_buf()).cast("P").tolist()
    return [listed.index(body.id) for body in bodies]

"""Pymunk on its own: pivots and a groove, stepped from Python as its documentation does."""

import time

import numpy as np
import pymunk

from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import (
    CRANK_CENTRE_M,
    CRANK_KG,
    CRANK_M,
    GRAVITY,
    ROD_CENTRE_M,
    ROD_KG,
    ROD_M,
    SLIDER_KG,
    Answer,
)

#: Half of the guide's length; and sweeps over the joints, Pymunk's own number.
GUIDE_M, SWEEPS = 1.0, 10


def _run(
    steps: int, samples: int, end_s: float, inertias: tuple[float, float], speed: float, driven: bool
) -> Answer:
    space = pymunk.Space()
    space.gravity, space.iterations = (0.0, -GRAVITY), SWEEPS
    turn = -speed * CRANK_M / ROD_M
    crank = pymunk.Body(CRANK_KG, inertias[0]) if not driven else pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    rod, slider = pymunk.Body(ROD_KG, inertias[1]), pymunk.Body(SLIDER_KG, float("inf"))
    if driven:  # about the pivot, where it stays
        crank.center_of_gravity = (0.0, 0.0)
    else:
        crank.position, crank.velocity = (CRANK_CENTRE_M, 0.0), (0.0, CRANK_CENTRE_M * speed)
    centre = 0.0 if driven else CRANK_CENTRE_M
    crank.angular_velocity = speed
    rod.position, rod.angular_velocity = (CRANK_M + ROD_CENTRE_M, 0.0), turn
    rod.velocity = (0.0, CRANK_M * speed + ROD_CENTRE_M * turn)
    slider.position = (CRANK_M + ROD_M, 0.0)
    joints: list[pymunk.Constraint] = [
        pymunk.PivotJoint(crank, rod, (CRANK_M - centre, 0.0), (-ROD_CENTRE_M, 0.0)),
        pymunk.PivotJoint(rod, slider, (ROD_M - ROD_CENTRE_M, 0.0), (0.0, 0.0)),
        pymunk.GrooveJoint(space.static_body, slider, (-GUIDE_M, 0.0), (GUIDE_M, 0.0), (0.0, 0.0)),
    ]
    if not driven:
        joints.append(pymunk.PivotJoint(space.static_body, crank, (0.0, 0.0), (-centre, 0.0)))
    for joint in joints:
        joint.error_bias = 0.0
    space.add(crank, rod, slider, *joints)
    values, step_s, each = [slider.position.x], end_s / steps, steps // samples
    began = time.perf_counter()
    for _ in range(samples):
        for _ in range(each):
            space.step(step_s)
        values.append(slider.position.x)
    return Answer(time.perf_counter() - began, each * samples, np.array(values))


def ideal_free(steps: int, samples: int) -> Answer:
    """Return the slider's position."""
    return _run(steps, samples, problem.FREE_END_S, problem.FREE_INERTIAS, problem.FREE_SPEED, driven=False)


def ideal_driven(steps: int, samples: int) -> Answer:
    """Return the slider's position, on a crank that is moved and not pushed."""
    return _run(
        steps, samples, problem.DRIVEN_END_S, problem.DRIVEN_INERTIAS, problem.DRIVEN_SPEED, driven=True
    )

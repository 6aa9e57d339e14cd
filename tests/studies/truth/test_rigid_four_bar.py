"""A four-bar with a rigid wall and friction in the last joint, against an integration in extended precision.

Three angles are all coordinates while the pin flies: a double pendulum of crank and coupler, and the rocker.
Steps are Gragg, Bulirsch and Stoer's in NumPy's longdouble, of 64 bits on x86: what they are off by is far
below what is compared.
"""

import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings
from engine_models.scene.library.mechanisms import ALL_SCENES
from studies.judges.converged_truth import COLLOCATION, EXTRAPOLATION

Long = np.longdouble
Vector = NDArray[np.longdouble]
WALL = {
    "radial_clearance_m": 5e-4,
    "bearing_radius_m": 0.01,
    "law": "rigid",
    "restitution": 0.9,
    "friction": {"law": "tanh", "coefficient": 0.1, "regularisation_speed_m_s": 0.01},
}
OF = ALL_SCENES["four-bar"]().replace({"end_time_s": 0.06, "clearance.B": WALL})
PINS = {pin.name: pin for pin in OF.mechanism.pins}
#: Numbers of crank, coupler and rocker in SI, those that the scene has in double precision.
CENTRE = [-Long(PINS[name].point_j[0]) for name in "OAC"]
LENGTH = [
    centre + Long(place)
    for centre, place in zip(
        CENTRE, (PINS["A"].point_i[0], PINS["B"].point_i[0], PINS["B"].point_j[0]), strict=True
    )
]
MASS = [Long(body.mass_kg) for body in OF.mechanism.bodies]
INERTIA = [Long(body.inertia_kg_m2) for body in OF.mechanism.bodies]
PIVOT, G = Long(PINS["C"].point_i[0]), -Long(OF.mechanism.gravity_m_s2[1])
CLEARANCE, RADIUS, RESTITUTION, FRICTION = (Long(number) for number in (5e-4, 0.01, 0.9, 0.1))
COLUMNS, STEP_S = 9, Long(5e-4)


def inverse_mass(q: Vector) -> Vector:
    """Return the inverse (3, 3) of the mass matrix."""
    crank = INERTIA[0] + MASS[0] * CENTRE[0] ** 2 + MASS[1] * LENGTH[0] ** 2
    coupler, both = (
        INERTIA[1] + MASS[1] * CENTRE[1] ** 2,
        MASS[1] * LENGTH[0] * CENTRE[1] * np.cos(q[0] - q[1]),
    )
    found = np.zeros((3, 3), Long)
    found[:2, :2] = np.array([[coupler, -both], [-both, crank]]) / (crank * coupler - both**2)
    found[2, 2] = 1 / (INERTIA[2] + MASS[2] * CENTRE[2] ** 2)
    return found


def rates(y: Vector) -> Vector:
    """Return the derivative of angles and speeds (6,) in flight."""
    q, v = y[:3], y[3:]
    turning = MASS[1] * LENGTH[0] * CENTRE[1] * np.sin(q[0] - q[1])
    weight = np.array([MASS[0] * CENTRE[0] + MASS[1] * LENGTH[0], MASS[1] * CENTRE[1], MASS[2] * CENTRE[2]])
    force = -G * weight * np.cos(q) + np.array([-turning * v[1] ** 2, turning * v[0] ** 2, 0])
    return np.concatenate([v, inverse_mass(q) @ force])


def step(y: Vector, h: np.longdouble) -> Vector:
    """Return the state (6,) after h."""
    table: list[Vector] = []
    for j in range(1, COLUMNS + 1):
        part = h / (2 * j)
        before, now = y, y + part * rates(y)
        for _ in range(2 * j - 1):
            before, now = now, before + 2 * part * rates(now)
        row = [now]
        for k, other in enumerate(table):
            row.append(row[k] + (row[k] - other) / ((Long(j) / (j - k - 1)) ** 2 - 1))
        table = row
    return table[-1]


def gap(q: Vector) -> tuple[Vector, Vector]:
    """Return the gap (2,) from the bearing to the pin, and its derivatives (2, 3) by the angles."""
    along = np.array([np.cos(q), np.sin(q)]) * np.array([-LENGTH[0], -LENGTH[1], LENGTH[2]])
    return along.sum(axis=1) + np.array([PIVOT, Long(0)]), np.array([-along[1], along[0]])


def solved(A: Vector, b: Vector) -> Vector:
    """Return the solution (2,) of two equations."""
    (p, q), (r, s) = A
    return np.asarray(np.array([s * b[0] - q * b[1], p * b[1] - r * b[0]]) / (p * s - q * r))


def in_the_middle(y: Vector) -> Vector:
    """Return the state nearby, by the crank's, of which the pin is in the middle of its bearing, at rest."""
    for _ in range(4):
        d, J = gap(y[:3])
        y[1:3] -= solved(J[:, 1:], d)
    y[4:] = -solved(gap(y[:3])[1][:, 1:], J[:, 0] * y[3])
    return y


def rows(q: Vector) -> tuple[np.longdouble, Vector]:
    """Return how far the pin is from the middle, and rows (2, 3) of speeds inwards and of sliding."""
    d, J = gap(q)
    distance = np.sqrt(d @ d)
    n = d / distance
    sliding = n[0] * J[1] - n[1] * J[0] + np.array([Long(0), -RADIUS, RADIUS - CLEARANCE])
    return distance, np.array([-n @ J, sliding])


def hit(y: Vector) -> Vector:
    """Return the state (6,) after an impact by Newton's restitution and Coulomb's friction."""
    _, D = rows(y[:3])
    inverse = inverse_mass(y[:3])
    W, u = D @ inverse @ D.T, D @ y[3:]
    wanted = -(1 + RESTITUTION) * u[0]
    push, rub = solved(W, np.array([wanted, -u[1]]))
    if abs(rub) > FRICTION * push:  # it slides on, one way or the other
        for way in (1, -1):
            push = wanted / (W[0, 0] - way * FRICTION * W[0, 1])
            rub = -way * FRICTION * push
            if way * (u[1] + W[1] @ np.array([push, rub])) > 0:
                break
    return np.concatenate([y[:3], y[3:] + inverse @ D.T @ np.array([push, rub])])


def integrated(y: Vector, end_s: float) -> tuple[list[np.longdouble], Vector]:
    """Return the times of impacts, and the state (6,) at the end."""
    t, times, end = Long(0), list[np.longdouble](), Long(end_s)
    while t < end:
        h = min(STEP_S, end - t)
        after = step(y, h)
        if rows(after[:3])[0] > CLEARANCE:
            for _ in range(6):  # Newton's method, from a place nearby
                distance, D = rows(after[:3])
                h += (CLEARANCE - distance) / -(D[0] @ after[3:])
                after = step(y, h)
            after = hit(after)
            times.append(t + h)
        t, y = t + h, after
    return times, y


@pytest.mark.skipif(np.finfo(Long).eps > 1e-18, reason=f"longdouble is double on {sys.platform}")
def test_impacts_with_friction_are_those_of_extended_precision() -> None:
    """The reference is off by 1.5e-12 s here, and by 4e-12 s in shorter steps."""
    for solver in (COLLOCATION, EXTRAPOLATION):
        run = solver.simulate(OF, RunSettings(1.0, 1))
        start = np.concatenate([run.position[0, :, 2], run.velocity[0, :, 2]]).astype(Long)
        times, end = integrated(in_the_middle(start), 0.06)
        assert len(times) == len(run.contacts["B"].impacts.time_s) == 9
        off_s = np.abs(run.contacts["B"].impacts.time_s - np.array(times)).max()
        off = np.abs(np.concatenate([run.position[-1, :, 2], run.velocity[-1, :, 2]]) - end).max()
        assert off_s < 1e-13, f"impacts off by {off_s:.1e} s"
        assert off < 1e-11, f"angles or speeds off by {off:.1e}"

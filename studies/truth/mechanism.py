"""A scene in numbers for ``equations``: its coordinates, rows, walls, drive and loads, and its start."""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import ImpossibleStart
from engine_models.scene.general import placed_start
from engine_models.scene.mechanism import state_of
from engine_models.scene.parts import AnyScene, GeneralParts
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND, Line, MechanismData, Motor, Point
from studies.truth.physics import (
    BY,
    GAS,
    KIND,
    PHASE,
    TABLE,
    TURN,
    TURN_BY_TIME,
    TURNING_VISCOUS,
    WHAT,
    WHERE,
    Loads,
    acting_on,
    drive_of,
    wall_of,
)
from studies.truth.record import OF_JOINT, ROOM, Mechanism
from studies.truth.tables import tables_of
from studies.truth.tree import NONE, Layout, bearing_and_pin, layout_of, tree_of, work_of

FloatArray = NDArray[np.float64]
#: Angles from here on are put back by whole turns of ``TURNS``, after which gas is the same.
WOUND_RAD, TURNS = 4 * math.pi, 2
#: Parts of the largest speed and of the size within which an assembled pin is in its bearing's middle.
MIDDLE = 1e-12


@dataclass(frozen=True)
class Start:
    """Places and velocities of bodies at t = 0, (bodies, 3) each, put together or as a file tells them."""

    position: FloatArray
    velocity: FloatArray
    is_told: bool


@dataclass(frozen=True)
class Built:
    """A mechanism in numbers, where it begins, and what its parts are called.

    ``u`` and ``v`` (m,) are coordinates and rates at the start, ``beside`` (bodies,) is what a body's angle
    has beside its coordinate, ``angle`` which that is, or GROUND; ``parts`` are names of the loads' parts.
    """

    numbers: Mechanism
    layout: Layout
    u: FloatArray
    v: FloatArray
    angle: list[int]
    beside: FloatArray
    parts: list[str]


def start_of(scene: AnyScene) -> Start:
    """Return the start of a scene.

    Raises:
        ImpossibleStart: there is none.
    """
    parts = scene if isinstance(scene, GeneralParts) else scene.general if isinstance(scene, Scene) else None
    assert parts is not None
    try:
        placed = placed_start(parts)
    except ValueError as reason:
        raise ImpossibleStart(str(reason)) from None
    q, v = state_of(parts) if placed is None else (np.array(placed.q), np.array(placed.v))
    return Start(q.reshape(-1, 3), v.reshape(-1, 3), placed is None)


def _wound(angle: float) -> float:
    """Return an angle without whole turns, by twos, if it has many; a sine's own reduction is exact."""
    if abs(angle) <= WOUND_RAD:
        return angle
    within = math.atan2(math.sin(angle), math.cos(angle))
    return within + math.tau * (round((angle - within) / math.tau) % TURNS)


def built(of: MechanismData, start: Start) -> Built:
    """Return a mechanism in numbers, and its start."""
    angles = np.array([_wound(angle) for angle in start.position[:, 2].tolist()])
    layout = layout_of(of, angles)
    loose = of.loose
    acting = acting_on(of, layout, len(loose))
    coordinate = NONE
    if of.drive.law is not None:
        guide = of.drive.guide
        coordinate = layout.angle[of.drive.body] if guide is None else layout.ways[of.guides[guide].name]
    gases = [what for what in acting.what if what[WHAT] == GAS]
    by_speed = isinstance(of.drive.law, Motor) and of.drive.law.table is not None
    drive = drive_of(of.drive, coordinate, len(loose) + len(gases), acting.tables)
    kinks = [[what[TABLE], what[BY], 0, what[PHASE]] for what in gases]
    kinks += [[drive.table, coordinate, 1, drive.phase]] if by_speed else []
    beside = [
        numbers[0] for what, numbers in zip(acting.what, acting.numbers, strict=True) if what[WHAT] == GAS
    ]
    tree = tree_of(layout, acting.rows)
    first = tree.acting + 2 * len(of.bodies)
    for what in acting.what:
        if what[WHAT] not in (TURN, TURNING_VISCOUS, TURN_BY_TIME):
            what[WHERE] += first
    rows, m = tree.still.shape
    n = m - tree.closing
    driven = coordinate if of.drive.prescribes else NONE
    f = n - int(driven != NONE)
    mass = np.repeat([body.mass_kg for body in of.bodies], 2)
    inertias = np.zeros(tree.angles)
    for angle, body in zip(layout.angle, of.bodies, strict=True):
        if angle != GROUND:
            inertias[angle] += body.inertia_kg_m2
    joints = []
    for pin in loose:
        (bearing, _), (own, _) = bearing_and_pin(pin)
        ends = [GROUND if body == GROUND else layout.angle[body] for body in (own, bearing)]
        joints.append([layout.gaps[pin.name], *ends])
    u, v = _coordinates(of, layout, start, angles)
    numbers = Mechanism(
        tree=tree,
        work=work_of(tree),
        walls=np.array([wall_of(pin.clearance) for pin in loose if pin.clearance], float).reshape(
            -1, KIND + 1
        ),
        joints=np.array(joints, np.int64).reshape(-1, 3),
        masses=mass,
        weights=mass * np.tile(of.gravity_m_s2, len(of.bodies)),
        inertias=inertias,
        drive=drive,
        driven=driven,
        begin=float(u[driven]) if driven != NONE else 0.0,
        loads=Loads(
            np.array(acting.what, np.int64).reshape(-1, 5),
            np.array(acting.numbers, float).reshape(-1, 3),
            float(of.drive.clock_s),
        ),
        tables=tables_of(acting.tables),
        kinks=np.array(kinks, np.int64).reshape(-1, 4),
        beside=np.array(beside + [0.0] * by_speed, float),
        Jz=np.zeros((rows - tree.acting, n)),
        M=np.zeros((n, n)),
        q=np.zeros(n),
        A=np.zeros((f, f)),
        a=np.zeros(f),
        answer=np.zeros(n),
        Q=np.zeros(m),
        row=np.zeros(m),
        swaps=np.zeros(n, np.int64),
        room=np.zeros((ROOM, 2 * m + 2 + OF_JOINT * len(loose) + len(acting.what))),
    )
    root = np.array([0.0 if angle == GROUND else u[angle] for angle in layout.angle])
    return Built(numbers, layout, u, v, layout.angle, start.position[:, 2] - root, acting.names)


def _coordinates(
    of: MechanismData, layout: Layout, start: Start, angles: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return coordinates and rates at the start, as the bodies' states have them.

    An assembled pin is in the middle of its bearing, and at rest there.
    """
    u, v = np.zeros((2, len(layout.units)))
    for body, angle in reversed(list(enumerate(layout.angle))):
        if angle != GROUND:
            u[angle], v[angle] = angles[body], start.velocity[body, 2]
    fastest = float(np.abs(start.velocity).max(initial=0.0) * max(1.0, layout.size_m))
    for pin in of.loose:
        bearing, own = bearing_and_pin(pin)
        (place, rate), (place_0, rate_0) = (_moving(start, angles, *end) for end in (own, bearing))
        d, d_rate, x = place - place_0, rate - rate_0, layout.gaps[pin.name]
        if start.is_told or abs(d) > MIDDLE * layout.size_m or abs(d_rate) > MIDDLE * fastest:
            u[x : x + 2], v[x : x + 2] = (d.real, d.imag), (d_rate.real, d_rate.imag)
    for guide in of.guides:
        if guide.name in layout.ways:
            x = layout.ways[guide.name]
            u[x], v[x] = _way(start, angles, guide)
    for body, x in layout.free.items():
        u[x : x + 2], v[x : x + 2] = start.position[body, :2], start.velocity[body, :2]
    return u, v


def _moving(start: Start, angles: FloatArray, body: int, point: Point) -> tuple[complex, complex]:
    """Return place and velocity of a point of a body."""
    if body == GROUND:
        return complex(*point), 0j
    arm = cmath.rect(1.0, angles[body]) * complex(*point)
    (x, y, _), (v_x, v_y, turn) = start.position[body].tolist(), start.velocity[body].tolist()
    return complex(x, y) + arm, complex(v_x, v_y) + 1j * turn * arm


def _way(start: Start, angles: FloatArray, line: Line) -> tuple[float, float]:
    """Return the way along a line and its rate."""
    ends = (line.body_j, line.point_j), (line.body_i, line.point_i)
    (place, rate), (place_0, rate_0) = (_moving(start, angles, *end) for end in ends)
    turned, turn = 0.0, 0.0
    if line.body_i != GROUND:
        turned, turn = angles[line.body_i], start.velocity[line.body_i, 2]
    along, d = cmath.rect(1.0, line.angle_rad + turned), place - place_0
    return (along.conjugate() * d).real, (along.conjugate() * (rate - rate_0 - 1j * turn * d)).real

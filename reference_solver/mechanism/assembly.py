"""Starts that are put together: the state nearest to a rough one that the joints allow, and their rank.

Bodies are hung on the ground, one after the other, at the angles told. Gauss-Newton, in the norm of [M],
closes what is open, joints with clearance taken as ideal. Velocities follow from one least-squares solve.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from reference_solver.failures import listed
from reference_solver.mechanism.constraints import (
    Constraint,
    PrescribedMotion,
    PrescribedSlide,
    System,
    row_slices,
    system_of,
)
from reference_solver.mechanism.data import GROUND, ConstantSpeed, Guide, Line, MechanismData, Pin
from reference_solver.mechanism.mechanism import Mechanism, along, light, mechanism_of
from reference_solver.mechanism.points import State, ends_of
from reference_solver.tape import FloatArray

#: The largest turn in a step, in rad; steps at the most; and what joints are open by when they are closed, in
#: parts of the mechanism's length.
LARGEST_TURN_RAD, MOST_STEPS, CLOSED = 0.5, 100, 1e-12
#: Singular values of rows of length 1 below this are 0; a row has a share in a dependence from that on.
RANK_TOLERANCE, SHARE = 1e-9, 1e-6
#: A start that is given may be off by so much, in m and rad, and speeds by this part of the fastest.
START_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Told:
    """What is told of a start: rough values, which of them hold exactly, and speeds, by numbers.

    Angles in rad and speeds in rad/s by the numbers of bodies, positions in m and speeds in m/s by those of
    guides.
    """

    angle_rad: Mapping[int, float]
    position_m: Mapping[int, float]
    held_bodies: tuple[int, ...]
    held_guides: tuple[int, ...]
    speed_rad_s: Mapping[int, float]
    speed_m_s: Mapping[int, float]


@dataclass(frozen=True)
class Rank:
    """The rank of the joints' rows at a position: which of them depend on each other, and how nearly.

    ``singular_values`` of the rows, each of length 1 in the norm of [M]^-1, fall. ``dependent`` are the names
    of the joints whose rows depend on each other; ``nearest`` is that whose row has most of the least value.
    """

    rows: int
    rank: int
    freedoms: int
    singular_values: FloatArray
    dependent: tuple[str, ...]
    nearest: str


def ideal(of: MechanismData, driven: bool = False) -> MechanismData:
    """Return a mechanism whose joints have no clearance, and without its drive unless it is ``driven``."""
    drive = of.drive if driven else replace(of.drive, law=None)
    pins = tuple(replace(pin, clearance=None) for pin in of.pins)
    return replace(of, pins=pins, loads=(), springs=(), drive=drive)


class NotAssembled(ValueError):
    """There is no such start; the message says what was expected of what, and what came."""


def rows_named(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return the name of the joint of every row with the unit of its gap, (m,)."""
    rows = list[tuple[str, str]]()
    for k, part in enumerate(row_slices(mechanism.constraints, 3 * len(mechanism.bodies))):
        constraint = mechanism.constraints[k]
        units = ["rad" if isinstance(constraint, PrescribedMotion) else "m", "m"]
        units[1] = "rad" if isinstance(constraint, Guide) else "m"
        rows += [(mechanism.name_of(k), unit) for unit in units[: part.stop - part.start]]
    return rows


class Joints:
    """The rows of a mechanism's joints, taken as ideal, with their names; angles are measured from 0.

    ``ways`` are those along the guides.
    """

    def __init__(self, of: MechanismData, driven: bool = False) -> None:
        mechanism = mechanism_of(ideal(of, driven))
        self.data, self.n, self._still = of, 3 * len(of.bodies), np.zeros(3 * len(of.bodies))
        self._constraints, self.rows = mechanism.constraints, rows_named(mechanism)
        self.inverse_mass = 1.0 / mechanism.masses
        self._ways = tuple(PrescribedSlide(*along(guide), ConstantSpeed(0.0)) for guide in of.guides)

    def _system(self, constraints: tuple[Constraint, ...], q: FloatArray) -> System:
        return system_of(constraints, State(q, self._still), 0.0, self._still)

    def gaps(self, q: FloatArray) -> FloatArray:
        """Return how far the rows are open, in m and rad, (m,)."""
        return np.asarray(self._system(self._constraints, q).g, float)

    def matrix(self, q: FloatArray) -> FloatArray:
        """Return [B] (m, n)."""
        return np.asarray(self._system(self._constraints, q).B, float)

    def way_rows(self, q: FloatArray) -> FloatArray:
        """Return the rows (g, n) that give from velocities the speeds along the guides."""
        return np.asarray(self._system(self._ways, q).B, float)

    def ways(self, q: FloatArray) -> FloatArray:
        """Return the positions in m along the guides, (g,)."""
        return np.array([way_along(guide, q) for guide in self.data.guides])

    def lets_move(self, q: FloatArray, row: FloatArray) -> bool:
        """Return whether there are velocities for which a row (n,) is not 0."""
        root = np.sqrt(self.inverse_mass)
        own, rows = row * root, self.matrix(q) * root
        left = own - rows.T @ np.linalg.lstsq(rows.T, own, rcond=RANK_TOLERANCE)[0] if len(rows) else own
        return bool(np.linalg.norm(left) > RANK_TOLERANCE * np.linalg.norm(own))

    def rank(self, q: FloatArray) -> Rank:
        """Return the rank of the rows at a position."""
        scaled = self.matrix(q) * np.sqrt(self.inverse_mass)
        size = np.linalg.norm(scaled, axis=1, keepdims=True)
        left, values, _ = np.linalg.svd(scaled / np.where(size > 0, size, 1.0))
        rank = int((values > RANK_TOLERANCE).sum())
        shares = np.linalg.norm(left[:, rank:], axis=1)
        dependent = dict.fromkeys(name for (name, _), x in zip(self.rows, shares, strict=True) if x > SHARE)
        nearest = self.rows[int(np.abs(left[:, rank - 1]).argmax())][0] if rank else ""
        return Rank(len(scaled), rank, self.n - rank, values, tuple(dependent), nearest)


@dataclass(frozen=True)
class Assembled:
    """A start that was put together: q and v, (n,) each, its rank, and by how much it was moved.

    ``turned_rad`` (b,) and ``moved_m`` (g,) are of bodies and guides, from the values told. ``drive_moves``
    says whether the joints let move what the drive is on.
    """

    q: FloatArray
    v: FloatArray
    rank: Rank
    drive_moves: bool
    turned_rad: FloatArray
    moved_m: FloatArray


def assemble(of: MechanismData, told: Told) -> Assembled:
    """Return the start nearest to what is told.

    Raises:
        NotAssembled: the joints do not close, their rows depend on each other, or the speeds told are too
            many, too few or not what the joints allow.
    """
    joints = Joints(of)
    rough = hung(of, told)
    q = _closed(joints, rough, told)
    rank, own = joints.rank(q), Joints(replace(of, pins=of.ideal)).rank(q)
    if own.rank < own.rows:  # of joints with clearance rows are only taken for the start
        raise NotAssembled(light(of.bodies) or dependence(own))
    v = _moving(joints, q, told, rank)
    drive = of.drive
    row = np.eye(joints.n)[3 * drive.body + 2] if drive.guide is None else joints.way_rows(q)[drive.guide]
    moved = joints.ways(q) - [told.position_m.get(k, 0.0) for k in range(len(of.guides))]
    return Assembled(q, v, rank, joints.lets_move(q, row), (q - rough)[2::3], moved)


def require_closed(of: MechanismData, q: FloatArray, v: FloatArray) -> None:
    """Require joints without clearance to be closed, bodies on their guides, what is driven at its speed.

    Raises:
        NotAssembled: at q and v, (n,) each, one is not, by more than ``START_TOLERANCE``.
    """
    mechanism = mechanism_of(replace(of, pins=of.ideal, loads=(), springs=()))
    system, rows = system_of(mechanism.constraints, State(q, v), 0.0, q), rows_named(mechanism)
    gaps, speeds = np.abs(np.asarray(system.g, float)), np.abs(np.asarray(system.B @ v - system.C, float))
    if not gaps.max(initial=0.0) <= START_TOLERANCE:
        name, unit = rows[int(gaps.argmax())]
        came = f"{name} open by {gaps.max():.3g} {unit}"
        raise NotAssembled(f"expected joints that close, got {came}")
    if not speeds.max(initial=0.0) <= START_TOLERANCE * (1.0 + np.abs(v).max()):
        came = f"{rows[int(speeds.argmax())][0]} off by {speeds.max():.3g} m/s or rad/s"
        raise NotAssembled(f"expected speeds that joints and drive allow, got {came}")


def dependence(rank: Rank) -> str:
    """Return in words which joints have rows that depend on each other."""
    return (
        f"expected joints whose rows are independent, got {rank.rows} rows of rank {rank.rank}, those of "
        f"{listed(rank.dependent)} depend on each other: take one of these away, give it clearance, or "
        "start elsewhere"
    )


def _closed(joints: Joints, rough: FloatArray, told: Told) -> FloatArray:
    """Return coordinates at which the joints are closed, near to rough ones."""
    bodies = [3 * body + 2 for body in told.held_bodies]
    guides = list(told.held_guides)
    held = np.concatenate([rough[bodies], [told.position_m.get(k, 0.0) for k in guides]])
    root, q = np.sqrt(joints.inverse_mass), np.array(rough)
    length = max(1.0, np.abs(rough.reshape(-1, 3)[:, :2]).max())
    for _ in range(MOST_STEPS):
        open_by = np.concatenate([joints.gaps(q), np.concatenate([q[bodies], joints.ways(q)[guides]]) - held])
        rows = np.vstack([joints.matrix(q), np.eye(joints.n)[bodies], joints.way_rows(q)[guides]])
        step = root * np.linalg.lstsq(rows * root, open_by, rcond=1e-10)[0]
        turn = np.abs(step[2::3]).max()
        q = q - step * min(1.0, LARGEST_TURN_RAD / max(turn, LARGEST_TURN_RAD))
        if np.abs(step).max() < np.finfo(float).eps * length:
            break
    gaps = np.abs(joints.gaps(q))
    ways = np.abs(np.concatenate([q[bodies], joints.ways(q)[guides]]) - held)
    open_by, off = gaps.max(initial=0.0), ways.max(initial=0.0)
    if open_by <= CLOSED * length and off <= CLOSED * length:
        return q
    name, unit = joints.rows[int(gaps.argmax())] if open_by else ("none", "")
    worst = f"{name} open by {open_by:.3g} {unit}" if open_by else "none open"
    if bodies or guides:
        _closed(joints, rough, replace(told, held_bodies=(), held_guides=()))  # refuses what never closes
        parts = [joints.data.bodies[k].name for k in told.held_bodies]
        names = ", ".join([*parts, *(joints.data.guides[k].name for k in told.held_guides)])
        raise NotAssembled(f"expected held values ({names}) that the joints allow, got {worst}")
    raise NotAssembled(f"expected joints that close, got {worst}")


def _moving(joints: Joints, q: FloatArray, told: Told, rank: Rank) -> FloatArray:
    """Return velocities that the joints and the speeds told leave: all at rest if none is told."""
    count = len(told.speed_rad_s) + len(told.speed_m_s)
    if count == 0:
        return np.zeros(joints.n)
    if count != rank.freedoms:
        freedoms = "1 degree of freedom" if rank.freedoms == 1 else f"{rank.freedoms} degrees of freedom"
        raise NotAssembled(f"expected as many speeds as the joints leave, {freedoms}, got {count}")
    B, bodies = joints.matrix(q), [3 * body + 2 for body in told.speed_rad_s]
    rows = np.vstack([B, np.eye(joints.n)[bodies], joints.way_rows(q)[list(told.speed_m_s)]])
    speeds = np.concatenate([np.zeros(len(B)), [*told.speed_rad_s.values(), *told.speed_m_s.values()]])
    root = np.sqrt(joints.inverse_mass)
    v: FloatArray = root * np.linalg.lstsq(rows * root, speeds, rcond=1e-10)[0]
    off = np.abs(rows @ v - speeds)
    if not off.max(initial=0.0) <= START_TOLERANCE * (1.0 + np.abs(speeds).max()):
        bodies_of, guides_of = joints.data.bodies, joints.data.guides
        names = [bodies_of[k].name for k in told.speed_rad_s] + [guides_of[k].name for k in told.speed_m_s]
        worst = int(off[len(B) :].argmax())
        unit = "rad/s" if worst < len(bodies) else "m/s"
        came = f"that of {names[worst]} off by {off[len(B) + worst]:.3g} {unit}"
        raise NotAssembled(light(joints.data.bodies) or f"expected speeds that the joints allow, got {came}")
    return v


def way_along(line: Line, q: FloatArray) -> float:
    """Return the way in m of a line's point along it, at coordinates (n,)."""
    (i, j), along = ends_of(line, state := State(q, q)), state.direction(line.body_i, line.angle_rad)
    return float(along @ (j.place - i.place))


def hung(of: MechanismData, told: Told) -> FloatArray:
    """Return coordinates (n,) of bodies hung on the ground, one after the other, at the angles told."""
    q = np.zeros(3 * len(of.bodies))
    q[2::3] = _told_angles(of, told)
    links: list[tuple[Pin | Line, float]] = [(pin, 0.0) for pin in of.pins]
    links += [(guide, told.position_m.get(k, 0.0)) for k, guide in enumerate(of.guides)]
    done, waiting = {GROUND}, deque([GROUND])
    while waiting:
        here = waiting.popleft()
        for link, way in links:
            there = {link.body_i: link.body_j, link.body_j: link.body_i}.get(here)
            if there is None or there in done:
                continue
            along = 0.0
            if isinstance(link, Line):
                along = way * State(q, q).direction(link.body_i, link.angle_rad)
            sign = 1.0 if here == link.body_i else -1.0
            own, others = (link.point_i, link.point_j) if sign > 0 else (link.point_j, link.point_i)
            # Until now the other body is at the origin.
            q[3 * there : 3 * there + 2] = place_of(q, here, own) + sign * along - place_of(q, there, others)
            done.add(there)
            waiting.append(there)
    return q


def _told_angles(of: MechanismData, told: Told) -> FloatArray:
    """Return the angles told, 0 of others, (b,).

    A body that keeps its angle in a guide has that of what the guide is on, but for a rest that was told.
    """
    angles = np.array([told.angle_rad.get(body, 0.0) for body in range(len(of.bodies))])
    known = {GROUND, *told.angle_rad}
    for _ in of.guides:  # along rows of guides
        for guide in of.guides:
            i, j = guide.body_i, guide.body_j
            if guide.turns or not {i, j} & known:
                continue
            if i not in known:
                i, j = j, i
            own = 0.0 if i == GROUND else angles[i]
            if j != GROUND:
                angles[j] = own + (
                    math.remainder(angles[j] - own, 2 * math.pi) if j in told.angle_rad else 0.0
                )
            known.add(j)
    return angles


def place_of(q: FloatArray, body: int, point: tuple[float, float]) -> FloatArray:
    """Return where a point of a body is, (2,), at coordinates (n,)."""
    return np.asarray(State(q, q).point(body, point).place)

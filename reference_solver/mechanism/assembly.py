"""Starts that are put together: the state nearest to a rough one that the joints allow, and their rank.

Bodies are hung on the ground, one after the other, at the angles told. Gauss-Newton, in the norm of [M],
closes what is open, joints with clearance taken as ideal. Velocities follow from one least-squares solve.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from reference_solver.failures import listed
from reference_solver.mechanism.constraints import (
    PrescribedMotion,
    PrescribedSlide,
    System,
    row_dependence,
    row_slices,
    system_of,
)
from reference_solver.mechanism.data import GROUND, ConstantSpeed, Guide, Line, MechanismData, Pin
from reference_solver.mechanism.mechanism import Mechanism, along, light, mechanism_of
from reference_solver.mechanism.points import State, line_at
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
        pins = tuple(replace(pin, clearance=None) for pin in of.pins)
        drive = of.drive if driven else replace(of.drive, law=None)
        mechanism = mechanism_of(replace(of, pins=pins, loads=(), springs=(), drive=drive))
        self.data, self.n, self._still = of, 3 * len(of.bodies), np.zeros(3 * len(of.bodies))
        self._constraints, self.rows = mechanism.constraints, rows_named(mechanism)
        self.inverse_mass = 1.0 / mechanism.masses

    def _system(self, q: FloatArray) -> System:
        return system_of(self._constraints, State(q, self._still), self._still)

    def gaps(self, q: FloatArray) -> FloatArray:
        """Return how far the rows are open, in m and rad, (m,)."""
        return np.asarray(self._system(q).g, float)

    def matrix(self, q: FloatArray) -> FloatArray:
        """Return [B] (m, n)."""
        return np.asarray(self._system(q).B, float)

    def way_rows(self, q: FloatArray) -> FloatArray:
        """Return the rows (g, n) that give from velocities the speeds along the guides."""
        slides = [PrescribedSlide(*along(guide), ConstantSpeed(0.0)) for guide in self.data.guides]
        return np.asarray(system_of(slides, State(q, self._still), self._still).B, float)

    def told_rows(self, q: FloatArray, bodies: Iterable[int], guides: Iterable[int]) -> FloatArray:
        """Return the rows that give from velocities the speeds at which bodies turn and along guides."""
        return np.vstack([np.eye(self.n)[[3 * k + 2 for k in bodies]], self.way_rows(q)[list(guides)]])

    def told(self, q: FloatArray, bodies: Iterable[int], guides: Iterable[int]) -> FloatArray:
        """Return angles of bodies and positions in m along guides."""
        return np.concatenate([q[2::3][list(bodies)], self.ways(q)[list(guides)]])

    def ways(self, q: FloatArray) -> FloatArray:
        """Return the positions in m along the guides, (g,)."""
        lines = (line_at(guide, State(q, q)) for guide in self.data.guides)
        return np.array([along @ d for _, _, along, _, d in lines])

    def names(self, bodies: Iterable[int], guides: Iterable[int]) -> list[str]:
        """Return the names of bodies and guides."""
        return [*(self.data.bodies[k].name for k in bodies), *(self.data.guides[k].name for k in guides)]

    def lets_move(self, q: FloatArray, row: FloatArray) -> bool:
        """Return whether there are velocities for which a row (n,) is not 0."""
        root = np.sqrt(self.inverse_mass)
        own, rows = row * root, self.matrix(q) * root
        left = own - rows.T @ np.linalg.lstsq(rows.T, own, rcond=RANK_TOLERANCE)[0] if len(rows) else own
        return bool(np.linalg.norm(left) > RANK_TOLERANCE * np.linalg.norm(own))

    def rank(self, q: FloatArray) -> Rank:
        """Return the rank of the rows at a position."""
        values, shares = row_dependence(self.matrix(q), self.inverse_mass, RANK_TOLERANCE)
        rank = int((values > RANK_TOLERANCE).sum())
        names = [name for name, _ in self.rows]
        nearest = names[int(shares.argmax())] if names else ""
        involved = [name for name, x in zip(names, shares, strict=True) if x > SHARE and rank < len(names)]
        return Rank(len(names), rank, self.n - rank, values, tuple(dict.fromkeys(involved)), nearest)


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
    (row,) = joints.told_rows(q, *(([drive.body], []) if drive.guide is None else ([], [drive.guide])))
    moved = joints.ways(q) - [told.position_m.get(k, 0.0) for k in range(len(of.guides))]
    return Assembled(q, v, rank, joints.lets_move(q, row), (q - rough)[2::3], moved)


def require_closed(of: MechanismData, q: FloatArray, v: FloatArray) -> None:
    """Require joints without clearance to be closed, bodies on their guides, what is driven at its speed.

    Raises:
        NotAssembled: at q and v, (n,) each, one is not, by more than ``START_TOLERANCE``.
    """
    mechanism = mechanism_of(replace(of, pins=of.ideal, loads=(), springs=()))
    system, rows = system_of(mechanism.constraints, State(q, v), q), rows_named(mechanism)
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
    parts = told.held_bodies, told.held_guides
    held = [*rough[2::3][list(parts[0])], *(told.position_m.get(k, 0.0) for k in parts[1])]
    root, q = np.sqrt(joints.inverse_mass), np.array(rough)
    length = max(1.0, np.abs(rough.reshape(-1, 3)[:, :2]).max())
    for _ in range(MOST_STEPS):
        open_by = np.concatenate([joints.gaps(q), joints.told(q, *parts) - held])
        rows = np.vstack([joints.matrix(q), joints.told_rows(q, *parts)])
        step = root * np.linalg.lstsq(rows * root, open_by, rcond=1e-10)[0]
        turn = np.abs(step[2::3]).max()
        q = q - step * min(1.0, LARGEST_TURN_RAD / max(turn, LARGEST_TURN_RAD))
        if np.abs(step).max() < np.finfo(float).eps * length:
            break
    gaps, off = np.abs(joints.gaps(q)), np.abs(joints.told(q, *parts) - held)
    if max(gaps.max(initial=0.0), off.max(initial=0.0)) <= CLOSED * length:
        return q
    worst = "none open"
    if gaps.any():
        name, unit = joints.rows[int(gaps.argmax())]
        worst = f"{name} open by {gaps.max():.3g} {unit}"
    if held:
        _closed(joints, rough, replace(told, held_bodies=(), held_guides=()))  # refuses what never closes
        names = ", ".join(joints.names(*parts))
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
    B, parts = joints.matrix(q), (told.speed_rad_s, told.speed_m_s)
    rows = np.vstack([B, joints.told_rows(q, *parts)])
    speeds = np.array([*np.zeros(len(B)), *parts[0].values(), *parts[1].values()])
    root = np.sqrt(joints.inverse_mass)
    v: FloatArray = root * np.linalg.lstsq(rows * root, speeds, rcond=1e-10)[0]
    off = np.abs(rows @ v - speeds)
    if not off.max(initial=0.0) <= START_TOLERANCE * (1.0 + np.abs(speeds).max()):
        worst = int(off[len(B) :].argmax())
        unit = "rad/s" if worst < len(told.speed_rad_s) else "m/s"
        came = f"that of {joints.names(*parts)[worst]} off by {off[len(B) + worst]:.3g} {unit}"
        raise NotAssembled(light(joints.data.bodies) or f"expected speeds that the joints allow, got {came}")
    return v


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

"""Starts that are put together: the state nearest to a rough one that the joints allow, and their rank.

Bodies are hung on the ground, one after the other, at the angles told. Gauss-Newton, in the norm of [M],
closes what is open, joints with clearance taken as ideal. Velocities follow from one least-squares solve.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reference_solver.failures import listed
from reference_solver.mechanism import constraints
from reference_solver.mechanism.data import GROUND, ConstantSpeed, Guide, Line, MechanismData, Pin
from reference_solver.mechanism.mechanism import along, light, mechanism_of
from reference_solver.mechanism.points import State, line_at
from reference_solver.tape import FloatArray

#: The largest turn in a step, in rad; steps at the most; and what joints are open by when they are closed, in
#: parts of the mechanism's length.
LARGEST_TURN_RAD, MOST_STEPS, CLOSED = 0.5, 100, 1e-12
#: Singular values of rows of length 1 below this are 0; a row has a share in a dependence from that on.
RANK_TOLERANCE, SHARE = 1e-9, 1e-6
#: A start that is given may be off by so much, in m and rad, and speeds by this part of the fastest.
START_TOLERANCE = 1e-9
#: What may be told: the angle of a body, by its number, or the way along a guide, or a line like one.
Quantity = int | Guide


@dataclass(frozen=True)
class Told:
    """What is told of a start: rough values in rad or m, what holds exactly, and speeds in rad/s or m/s."""

    values: Mapping[Quantity, float]
    held: Sequence[Quantity]
    speeds: Mapping[Quantity, float]


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
    """There is no such start; the message says of which entry what was expected, and what came."""


class Joints:
    """The rows of a mechanism's joints, taken as ideal; angles are measured from 0.

    ``rows`` are the name of the joint of every row and the unit of its gap, (m,).
    """

    def __init__(self, of: MechanismData, driven: bool = False) -> None:
        pins = tuple(replace(pin, clearance=None) for pin in of.pins)
        drive = of.drive if driven else replace(of.drive, law=None)
        mechanism = mechanism_of(MechanismData(of.bodies, pins, of.guides, drive=drive))
        self.data, self.n, self._still = of, 3 * len(of.bodies), np.zeros(3 * len(of.bodies))
        self.constraints, self.inverse_mass = mechanism.constraints, 1.0 / mechanism.masses
        self.rows = list[tuple[str, str]]()
        for k, part in enumerate(constraints.row_slices(self.constraints, self.n)):
            first = "rad" if isinstance(self.constraints[k], constraints.PrescribedMotion) else "m"
            units = first, "rad" if isinstance(self.constraints[k], Guide) else "m"
            self.rows += [(mechanism.name_of(k), unit) for unit in units[: part.stop - part.start]]

    def gaps(self, q: FloatArray) -> FloatArray:
        """Return how far the rows are open, in m and rad, (m,)."""
        return np.asarray(constraints.system_of(self.constraints, State(q, q), self._still).g, float)

    def matrix(self, q: FloatArray) -> FloatArray:
        """Return [B] (m, n)."""
        return np.asarray(constraints.system_of(self.constraints, State(q, q), self._still).B, float)

    def told_rows(self, q: FloatArray, told: Iterable[Quantity]) -> FloatArray:
        """Return the rows that give from velocities (n,) the rates of what is told."""
        still, turned, moved = ConstantSpeed(0.0), constraints.PrescribedMotion, constraints.PrescribedSlide
        drivers = [turned(it, still) if isinstance(it, int) else moved(*along(it), still) for it in told]
        return np.asarray(constraints.system_of(drivers, State(q, q), self._still).B, float)

    def told(self, q: FloatArray, told: Collection[Quantity]) -> FloatArray:
        """Return the angles of bodies in rad and the ways along guides in m that are told."""
        lines = {it: line_at(it, State(q, q)) for it in told if not isinstance(it, int)}
        values = [q[3 * it + 2] if isinstance(it, int) else lines[it][2] @ lines[it][4] for it in told]
        return np.array(values, float)

    def names(self, told: Iterable[Quantity]) -> list[str]:
        """Return the names of bodies and guides."""
        names = [self.data.bodies[it].name if isinstance(it, int) else it.name for it in told]
        return [*dict.fromkeys(names)]

    def lets_move(self, q: FloatArray, row: FloatArray) -> bool:
        """Return whether there are velocities for which a row (n,) is not 0."""
        root = np.sqrt(self.inverse_mass)
        own, rows = row * root, self.matrix(q) * root
        left = own - rows.T @ np.linalg.lstsq(rows.T, own, rcond=RANK_TOLERANCE)[0] if len(rows) else own
        return bool(np.linalg.norm(left) > RANK_TOLERANCE * np.linalg.norm(own))

    def rank(self, q: FloatArray) -> Rank:
        """Return the rank of the rows at a position."""
        values, shares = constraints.row_dependence(self.matrix(q), self.inverse_mass, RANK_TOLERANCE)
        rank = int((values > RANK_TOLERANCE).sum())
        names = [name for name, _ in self.rows]
        nearest = names[int(shares.argmax())] if names else ""
        involved = [name for name, x in zip(names, shares, strict=True) if x > SHARE and rank < len(names)]
        return Rank(len(names), rank, self.n - rank, values, tuple(dict.fromkeys(involved)), nearest)


@dataclass(frozen=True)
class Assembled:
    """A start, q and v (n,) each: whether joints let move what the drive is on; in words, what was moved."""

    q: FloatArray
    v: FloatArray
    drive_moves: bool
    moved: str


def assemble(of: MechanismData, told: Told) -> Assembled:
    """Return the start nearest to what is told.

    Raises:
        NotAssembled: the joints do not close, their rows depend on each other, or the speeds told are too
            many, too few or not what the joints allow.
    """
    joints, ways = Joints(of), [it for it in told.values if not isinstance(it, int)]
    rough, held = hung(of, told), dict[Quantity, float]()
    for it in told.held:
        held[it] = rough[3 * it + 2] if isinstance(it, int) else told.values.get(it, 0.0)
    if places := [it for it in ways if it not in of.guides]:
        rough = _near(joints, rough, held | {it: told.values[it] for it in places})
    q = _closed(joints, rough, held)
    rank, own = joints.rank(q), Joints(replace(of, pins=of.ideal)).rank(q)
    if own.rank < own.rows:  # of joints with clearance rows are only taken for the start
        raise NotAssembled(f"start: {light(of.bodies) or dependence(own)}")
    v = _moving(joints, q, told, rank)
    (row,) = joints.told_rows(q, [of.drive.body if of.drive.guide is None else of.guides[of.drive.guide]])
    off, turned = joints.told(q, ways) - [told.values[it] for it in ways], (q - rough)[2::3]
    moved = [(f"{body.name} turned by", turn, "rad") for body, turn in zip(of.bodies, turned, strict=True)]
    for name in joints.names(ways):
        moved.append((f"{name} moved by", float(np.linalg.norm(off[[it.name == name for it in ways]])), "m"))
    words = ", ".join(f"{what} {abs(x):.3g} {unit}" for what, x, unit in moved if abs(x) > CLOSED)
    return Assembled(q, v, joints.lets_move(q, row), words or "nothing moved")


def require_closed(of: MechanismData, q: FloatArray, v: FloatArray) -> None:
    """Require joints without clearance to be closed, bodies on their guides, what is driven at its speed.

    Raises:
        NotAssembled: at q and v, (n,) each, one is not, by more than ``START_TOLERANCE``.
    """
    joints = Joints(replace(of, pins=of.ideal), driven=True)
    system, rows = constraints.system_of(joints.constraints, State(q, v), q), joints.rows
    gaps, speeds = np.abs(np.asarray(system.g, float)), np.abs(np.asarray(system.B @ v - system.C, float))
    if not gaps.max(initial=0.0) <= START_TOLERANCE:
        name, unit = rows[int(gaps.argmax())]
        came = f"{name} open by {gaps.max():.3g} {unit}"
        raise NotAssembled(f"start: expected joints that close, got {came}")
    if not speeds.max(initial=0.0) <= START_TOLERANCE * (1.0 + np.abs(v).max()):
        came = f"{rows[int(speeds.argmax())][0]} off by {speeds.max():.3g} m/s or rad/s"
        raise NotAssembled(f"start: expected speeds that joints and drive allow, got {came}")


def dependence(rank: Rank) -> str:
    """Return in words which joints have rows that depend on each other."""
    return (
        f"expected joints whose rows are independent, got {rank.rows} rows of rank {rank.rank}, those of "
        f"{listed(rank.dependent)} depend on each other: take one of these away, give it clearance, or "
        "start elsewhere"
    )


def _near(joints: Joints, rough: FloatArray, held: Mapping[Quantity, float]) -> FloatArray:
    """Return coordinates near to rough ones, which close the joints and have the values held if any do."""
    root, q, values = np.sqrt(joints.inverse_mass), np.array(rough), [*held.values()]
    for _ in range(MOST_STEPS):
        open_by = np.concatenate([joints.gaps(q), joints.told(q, held) - values])
        rows = np.vstack([joints.matrix(q), joints.told_rows(q, held)])
        step = root * np.linalg.lstsq(rows * root, open_by, rcond=1e-10)[0]
        turn = np.abs(step[2::3]).max()
        q = q - step * min(1.0, LARGEST_TURN_RAD / max(turn, LARGEST_TURN_RAD))
        if np.abs(step).max() < np.finfo(float).eps * _length(rough):
            break
    return q


def _length(rough: FloatArray) -> float:
    """Return the length of a mechanism, 1 m at least."""
    return max(1.0, float(np.abs(rough.reshape(-1, 3)[:, :2]).max()))


def _closed(joints: Joints, rough: FloatArray, held: Mapping[Quantity, float]) -> FloatArray:
    """Return coordinates at which the joints are closed, near to rough ones."""
    q = _near(joints, rough, held)
    gaps, off = np.abs(joints.gaps(q)), np.abs(joints.told(q, held) - [*held.values()])
    if max(gaps.max(initial=0.0), off.max(initial=0.0)) <= CLOSED * _length(rough):
        return q
    worst = "none open"
    if gaps.any():
        name, unit = joints.rows[int(gaps.argmax())]
        worst = f"{name} open by {gaps.max():.3g} {unit}"
    if held:
        _closed(joints, rough, {})  # refuses what never closes
        names = ", ".join(joints.names(held))
        raise NotAssembled(f"start.hold: expected held values ({names}) that the joints allow, got {worst}")
    raise NotAssembled(f"start: expected joints that close, got {worst}")


def _moving(joints: Joints, q: FloatArray, told: Told, rank: Rank) -> FloatArray:
    """Return velocities that the joints and the speeds told leave: all at rest if none is told."""
    count, speeds = len(told.speeds), np.array([*told.speeds.values()])
    field = f"start.speed_{'rad_s' if any(isinstance(it, int) for it in told.speeds) else 'm_s'}"
    if count == 0:
        return np.zeros(joints.n)
    if count != rank.freedoms:
        freedoms = "1 degree of freedom" if rank.freedoms == 1 else f"{rank.freedoms} degrees of freedom"
        raise NotAssembled(f"{field}: expected as many speeds as the joints leave, {freedoms}, got {count}")
    B = joints.matrix(q)
    rows, rates = np.vstack([B, joints.told_rows(q, told.speeds)]), np.concatenate([np.zeros(len(B)), speeds])
    root = np.sqrt(joints.inverse_mass)
    v: FloatArray = root * np.linalg.lstsq(rows * root, rates, rcond=1e-10)[0]
    off = np.abs(rows @ v - rates)
    if not off.max(initial=0.0) <= START_TOLERANCE * (1.0 + np.abs(speeds).max()):
        worst = int(off[len(B) :].argmax())
        unit = "rad/s" if isinstance([*told.speeds][worst], int) else "m/s"
        came = f"that of {joints.names(told.speeds)[worst]} off by {off[len(B) + worst]:.3g} {unit}"
        why = f"expected speeds that the joints allow, got {came}"
        raise NotAssembled(f"{field}: {light(joints.data.bodies) or why}")
    return v


def hung(of: MechanismData, told: Told) -> FloatArray:
    """Return coordinates (n,) of bodies hung on the ground, one after the other, at the angles told."""
    q = np.zeros(3 * len(of.bodies))
    q[2::3] = _told_angles(of, told)
    links: list[tuple[Pin | Line, float]] = [(pin, 0.0) for pin in of.pins]
    links += [(guide, told.values.get(guide, 0.0)) for guide in of.guides]
    state, placed = State(q, q), [GROUND]
    for here in placed:  # it grows
        for link, way in links:
            there = {link.body_i: link.body_j, link.body_j: link.body_i}.get(here)
            if there is None or there in placed:
                continue
            along = way * state.direction(link.body_i, link.angle_rad) if isinstance(link, Line) else 0.0
            sign = 1.0 if here == link.body_i else -1.0
            own, others = (link.point_i, link.point_j) if sign > 0 else (link.point_j, link.point_i)
            begin, end = state.point(here, own).place, state.point(there, others).place
            q[3 * there : 3 * there + 2] = begin + sign * along - end  # until now that is at the origin
            placed.append(there)
    return q


def _told_angles(of: MechanismData, told: Told) -> FloatArray:
    """Return the angles told, 0 of others, (b,).

    A body that keeps its angle in a guide has that of what the guide is on, but for a rest that was told.
    """
    angles = np.array([told.values.get(body, 0.0) for body in range(len(of.bodies))])
    known: set[Quantity] = {GROUND, *told.values}
    for _ in of.guides:  # along rows of guides
        for guide in of.guides:
            i, j = guide.body_i, guide.body_j
            if guide.turns or not {i, j} & known:
                continue
            if i not in known:
                i, j = j, i
            own = 0.0 if i == GROUND else angles[i]
            if j != GROUND:
                angles[j] = own + (math.remainder(angles[j] - own, 2 * math.pi) if j in told.values else 0.0)
            known.add(j)
    return angles

"""A scene in motion, with ideal joints, walls that give or rigid ones, near round-off from event to event.

Within a step every force is smooth: it ends where the equations change (see ``switches``). Towards touch and
release, where forces go with delta^1.5, its length falls as the error's estimate asks. What becomes of a pin
at a rigid wall is settled in ``rigid_walls``.
"""

import typing
from functools import cache
from typing import Any

import numpy as np
from numba import float64, int64, typeof, void
from numba.types import FunctionType, NamedTuple  # type: ignore[attr-defined]
from numpy.typing import NDArray

from engine_models.engine import ImpossibleStart
from engine_models.scene.parts import AnyScene
from reference_solver.machine_code import code_folder
from reference_solver.mechanism.data import Guide, MechanismData, Pin
from studies.truth import equations, kinematics, machine, stepping
from studies.truth.equations import (
    CONTACT,
    FOLLOWS,
    GAP,
    MEMORY,
    PIECE,
    PUSHED,
)
from studies.truth.kinematics import STEEP, choose, determinant, steepness
from studies.truth.machine import bare, interpreted
from studies.truth.mechanism import Built, Start, built, start_of
from studies.truth.physics import SLOWEST, A, C, K, prescribed, stops_s
from studies.truth.record import (
    END,
    OF_JOINT,
    OUT,
    TOLD,
    WEIGHTS,
    Mechanism,
    Packed,
    Watched,
    packed,
    parts,
    views,
)
from studies.truth.rigid_walls import RigidWalls, walls_at
from studies.truth.stepping import REJECT, Method, Problem
from studies.truth.switches import LEFT, ROOM, first_switch, piece_of, signal, switch
from studies.truth.tables import piece_at

FloatArray = NDArray[np.float64]
#: Room that the error is given when a step is chosen, and bounds of what it changes by.
SAFETY, LEAST, MOST = 0.8, 0.1, 4.0
#: Part of its clearance that a pin moves in a step, and an angle in rad.
MOVED = 0.5
#: The first step of a scene and after an event, and the shortest, as parts of the time to cross a clearance.
BEGIN, SHORTEST = 1e-3, 1e-11
#: Places in ``clock``: the next step in s, how many there were, and the loops' determinant: at present (0:
#: unknown), at the end of the step in hand, and at its largest with this choice of coordinates.
STEP, STEPS, BEGUN, ENDED, LARGEST = range(5)
#: The least part of that which a step may leave. The next is no longer than half the way to where it would be
#: 0, so that no step passes a singular position, nor two loops such ones at once. A motion ends where a loop
#: has come to this part of its own largest: round-off has grown by as much.
NEARER, SINGULAR = 0.2, 1e-4
#: The shortest flight between rigid walls, and the lowest, as a part of the clearance; it falls with that.
SHORTEST_FLIGHT_S, LOWEST = 2e-9, 1e-12
#: What an impact on a rigid wall counts for, in steps.
SETTLING = 20
#: What comes of an advance, beside a joint's number.
REACHED, SPENT = -1, -2
#: By how much joints may be open at the start, as a part of the size, and drift apart, of the largest speed:
#: where the start is put together, and where a file tells the states of bodies, maybe in ten digits. The
#: motion begins where coordinates taken from them close the joints to round-off.
CLOSED, TOLD_CLOSED = 1e-12, 1e-9
#: Places at which a prescribed motion is looked at for its largest speed.
LOOKS = 1000


class Contact(typing.NamedTuple):
    """A contact that is over, or an impulse of a rigid wall: see ``engine.Impacts``."""

    time_s: float
    duration_s: float
    approach_speed_m_s: float
    normal_impulse_N_s: float
    energy_lost_J: float


class Motion:
    """A scene in motion, by a step of ``stepping`` and its method, for so many steps at most.

    ``z`` (state,) and ``phases`` (k, 3) are as in ``equations``, ``both`` (2, state) is z and what round-off
    has left out of it, ``contacts`` those of every joint that are over.

    Raises:
        ImpossibleStart: joints do not close at the start, or a pin begins in a rigid wall.
    """

    def __init__(
        self,
        scene: AnyScene,
        step: Any,
        method: Method,
        steps: float = np.inf,
        shortest_flight_s: float = SHORTEST_FLIGHT_S,
    ) -> None:
        start = start_of(scene)
        self.built, self.method, self.steps = built(scene.mechanism, start), method, steps
        self.packed = packed(self.built.numbers)
        self.mechanism = m = views(self.packed, self.built.numbers)
        data = typeof(method), typeof(self.packed)
        rates, step = (compiled(f, *data) for f in (equations.rates, step))
        self.rates, self.advance = _entry(rates), _entry(compiled(advance, *data))
        self.call = {f: compiled(f, *data) for f in (look, equations.sample, walls_at)}
        self.size, self.joints = len(m.row), len(m.walls)
        self.time = 2 * self.size
        self.work = self.time + 1 + OF_JOINT * self.joints
        lowest = LOWEST * shortest_flight_s / SHORTEST_FLIGHT_S
        self.rigid = RigidWalls(self.packed, m, rates, self.call[walls_at], shortest_flight_s, lowest)
        self.contacts: tuple[list[Contact], ...] = tuple([] for _ in range(self.joints))
        self.both = np.zeros((2, self.work + 1 + len(self.built.parts)))
        self.z = self.both[0]
        self.z[: self.size], self.z[self.size : self.time] = self.built.u, self.built.v
        self.phases = np.zeros((self.joints + len(m.kinks), 3))
        self._set_scales(scene, start)
        self.problem = Problem(method, rates, self.packed, self.phases, self.scale)
        self.step = step
        self.clock = np.array([self.begin_s, 0.0, 0.0, 0.0, 0.0])
        self.stops_s = stops_s(m.drive, m.loads, m.tables)
        for k, (number, x, is_rate, phase) in enumerate(m.kinks.tolist()):
            now = float(self.z[self.size * is_rate + x] + m.beside[k])
            self.phases[phase, PIECE] = interpreted(piece_at)(m.tables, number, now)
        self.call[look](self.packed, self.z)
        self.answer()
        self._require_closed(start)
        self._begun: dict[int, tuple[float, float, FloatArray]] = {}
        for k in range(self.joints):
            x = m.joints[k, GAP]
            if np.hypot(*self.z[x : x + 2]) > m.walls[k, C]:
                self._begin_in_contact(k)

    def _set_scales(self, scene: AnyScene, start: Start) -> None:
        """Set what errors are parts of, and the first step and the shortest."""
        m, layout, of = self.mechanism, self.built.layout, scene.mechanism
        levers = _levers(of, layout.size_m)
        speed = _speed_of(of, self.built, start, levers, scene.end_time_s)
        lever = np.ones(self.size)
        for angle in range(m.tree.angles):
            lever[angle] = max(levers[b] for b, own in enumerate(self.built.angle) if own == angle)
        energy = float(m.masses[::2].sum()) * speed**2
        of_joints, works = np.full(OF_JOINT * self.joints, np.inf), np.full(1 + len(self.built.parts), energy)
        self.scale = np.concatenate([m.tree.unit, speed / lever, [1.0], of_joints, works])
        across_s = float(m.walls[:, C].min(initial=layout.size_m)) / speed
        self.begin_s, self.shortest_s = BEGIN * across_s, SHORTEST * across_s

    @property
    def time_s(self) -> float:
        """The time reached."""
        return float(self.z[self.time])

    @property
    def y(self) -> FloatArray:
        """The state in gaps, (state,)."""
        return self.rigid.gaps_of(self.z, self.phases)

    def answer(self) -> tuple[FloatArray, FloatArray]:
        """Return the derivative of z (state,), and what is told of joints, drive and loads."""
        out, told = np.empty(len(self.z)), np.empty(self.packed.told)
        self.rates(self.packed, self.phases, self.z, out, told)
        return out, told

    def bodies(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations of bodies, (bodies, 3) each, after ``answer``."""
        m, w, angles = self.mechanism, self.mechanism.work, self.built.angle
        found, centres = np.zeros((3, len(angles), 3)), np.empty((3, len(angles), 2))
        self.call[equations.sample](self.packed, *centres)
        found[..., :2] = centres
        turned = w.u, w.v, w.T @ m.answer[: len(m.q)] + w.b
        for row, values in zip(found, turned, strict=True):
            row[:, 2] = [0.0 if angle < 0 else values[angle] for angle in angles]
        found[0, :, 2] += self.built.beside
        return found[0], found[1], found[2]

    def to(self, time_s: float) -> bool:
        """Go on to a time; return whether it is reached before the steps are taken."""
        now = self.time_s
        for stop in [*self.stops_s[(self.stops_s > now) & (self.stops_s < time_s)].tolist(), time_s]:
            came = 0
            while came != REACHED:
                came = self.advance(
                    self.step,
                    *self.problem,
                    *(self.both, self.clock, self.begin_s, self.shortest_s, stop, self.steps),
                )
                if came == SPENT:
                    return False
                if came != REACHED:
                    self._meet(came)
        return True

    def _require_closed(self, start: Start) -> None:
        """Require of the start that all places and velocities are those of coordinates that close loops."""
        part = TOLD_CLOSED if start.is_told else CLOSED
        self.answer()
        position, velocity, _ = self.bodies()
        size_m, speed = max(1.0, self.built.layout.size_m), 1.0 + np.abs(start.velocity).max()
        for what, unit, off, whole in (
            ("joints are open", "m", (position - start.position)[:, :2], size_m),
            ("joints or driver are off", "m/s", velocity - start.velocity, speed),
        ):
            if not np.abs(off).max() <= part * whole:
                allowed = f"at t = 0 s, expected no more than {part * whole:.3g} {unit}"
                raise ImpossibleStart(f"start: {what} by {np.abs(off).max():.3g} {unit} {allowed}")

    def _begin_in_contact(self, k: int) -> None:
        """Let a pin that starts in its wall touch it now."""
        wall = self.mechanism.walls[k]
        if np.isinf(wall[K]):
            raise ImpossibleStart(f"a pin begins in its rigid wall, that of joint {k}")
        speed = self._outward_m_s(k)
        sliding = self.rigid.sliding_m_s(self.z, self.phases, k)
        self.phases[k] = PUSHED, wall[A] / max(speed, wall[SLOWEST]), interpreted(piece_of)(wall, sliding)
        self._begun[k] = self.time_s, speed, self._sums(k)

    def _meet(self, joint: int) -> None:
        """Enter a touch or a release, or settle what becomes of a pin at its rigid wall."""
        if np.isinf(self.mechanism.walls[joint, K]):
            self._settle(joint)
        elif self.phases[joint, CONTACT] == PUSHED:
            self._begun[joint] = self.time_s, self._outward_m_s(joint), self._sums(joint)
        else:
            began, speed, sums = self._begun.pop(joint)
            impulse, *lost = (self._sums(joint) - sums).tolist()
            self.contacts[joint].append(Contact(began, self.time_s - began, speed, impulse, sum(lost)))

    def _outward_m_s(self, k: int) -> float:
        x = self.mechanism.joints[k, GAP]
        d, rate = self.z[x : x + 2], self.z[self.size + x : self.size + x + 2]
        return float(d @ rate / np.hypot(*d))

    def _sums(self, k: int) -> FloatArray:
        """Return a joint's sums (OF_JOINT,) until now."""
        first = self.time + 1 + OF_JOINT * k
        return np.array(self.z[first : first + OF_JOINT])

    def _settle(self, joint: int) -> None:
        """Let a pin that has come to its rigid wall hit it, or one that is no more pressed to it leave."""
        before, y = np.flatnonzero(self.phases[: self.joints, CONTACT] == FOLLOWS).tolist(), self.y
        after, following = self.rigid.settled(y, self.phases, joint, before)
        y[self.size : self.time] = after.rate
        if self.mechanism.drive.coordinate >= 0:
            y[self.work] += after.driver_N_s * after.rate[self.mechanism.drive.coordinate]
        for got in after.impulses:
            first = self.time + 1 + OF_JOINT * got.joint
            y[first : first + 2] += got.normal_N_s, got.lost_J
            if got.normal_N_s != 0:
                entry = Contact(self.time_s, 0.0, got.speed_m_s, got.normal_N_s, got.lost_J)
                self.contacts[got.joint].append(entry)
        self.both[:] = self.rigid.placed_on_walls(y, self.phases, following), np.zeros(len(y))
        for k in {joint, *before} - set(following):
            self.phases[k, MEMORY] = 1.0
        self.clock[STEPS] += SETTLING


def _levers(of: MechanismData, size_m: float) -> list[float]:
    """Return the longest distance in m between two points of every body, or from its centre of mass."""
    points = [[0j] for _ in of.bodies]
    parts_of: list[Pin | Guide] = [*of.pins, *of.guides]
    for part in parts_of:
        for body, point in ((part.body_i, part.point_i), (part.body_j, part.point_j)):
            if body >= 0:
                points[body].append(complex(*point))
    return [max(abs(a - b) for a in own for b in own) or size_m for own in points]


def _speed_of(of: MechanismData, made: Built, start: Start, levers: list[float], end_time_s: float) -> float:
    """Return a speed in m/s typical of a mechanism: a driven one, one at the start, or what work may make it.

    It is no less than that which crosses a clearance within the scene.
    """
    m, size_m = made.numbers, made.layout.size_m
    rooms = m.walls[:, C].tolist() or [size_m]
    found = [room / end_time_s for room in rooms]
    turning = np.abs(start.velocity[:, 2]) * levers
    found.append(float(max(np.hypot(*start.velocity[:, :2].T).max(), turning.max())))
    if m.driven >= 0:
        looks = np.linspace(0.0, end_time_s, LOOKS).tolist()
        lever = levers[of.drive.body] if of.drive.guide is None else 1.0
        found.append(lever * max(abs(interpreted(prescribed)(m.drive, m.tables, t)[1]) for t in looks))
        return float(max(found))
    force, torque = 0.0, abs(m.drive.a)
    for load in of.loads:
        tables = [load.gas and load.gas.table, load.force_by_time]
        force += abs(load.force_N) + sum(float(np.abs(table.y).max()) for table in tables if table)
        torque += abs(load.torque_N_m)
    for spring in of.springs:
        force += spring.stiffness_N_m * spring.free_length_m / 10
    work = 2 * size_m * force + 2 * np.pi * torque
    weight = float(np.hypot(*of.gravity_m_s2))
    mass = float(m.masses[::2].sum())
    return float(np.sqrt(max(found) ** 2 + 2 * (weight * size_m + work / mass)))


def _entry(function: Any) -> Any:
    """Return machine code that Python calls, without Numba's look at the types of what it is called with."""
    (overload,) = function.overloads.values()
    return overload.entry_point


@cache
def compiled(function: Any, method: Any, data: Any) -> Any:
    """Return a function as machine code; the larger ones know of each other no more than types.

    So none is compiled as a part of another, over and over; and all are kept on disk, as they take half a
    minute. ``method`` and ``data`` are types.
    """
    matrix, vector = float64[:, ::1], float64[::1]
    rates = void(data, matrix, vector, vector, vector)
    of = method, FunctionType(rates), data, matrix, vector
    step = float64(NamedTuple(of, Problem), matrix, float64, matrix)
    signatures = {
        equations.rates: rates,
        equations.sample: void(data, matrix, matrix, matrix),
        look: void(data, vector),
        walls_at: void(data, matrix, vector, matrix, matrix),
        advance: int64(FunctionType(step), *of, matrix, vector, *[float64] * 4),
    }
    allocates = function in (stepping.extrapolated, stepping.collocated)
    with code_folder(interpreted(function)) as kept:
        keep = machine.njit(signatures.get(function, step), cache=kept, error_model="numpy", _nrt=allocates)
        return keep(interpreted(function))


def look(p: Packed, z: FloatArray) -> None:
    """Choose independent coordinates at a state."""
    m = parts(p)
    kinematics.look(m.tree, m.work, z)
    choose(m.tree, m.work, m.driven)


def advance(
    step: Any,
    method: Method,
    rates: Any,
    p: Packed,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    clock: FloatArray,
    begin_s: float,
    shortest_s: float,
    until_s: float,
    most_steps: float,
) -> int:
    """Move a state (2, state), its phases and clock on to a time and return ``REACHED``.

    Or return ``SPENT`` if it takes more steps, or none is short enough.
    Where a pin touches a wall or leaves it return the joint's number. At a rigid wall nothing is switched.
    """
    m = parts(p)
    of = Problem(method, rates, p, phases, m.room[WEIGHTS])
    watched = Watched(m.walls, m.joints, m.tables, m.kinks, m.beside, m.row, m.room)
    end, joints, time = m.room[END : END + 2], len(m.walls), 2 * len(m.row)
    z = y[0]
    while z[time] < until_s:
        if clock[STEPS] >= most_steps:
            return SPENT
        left, joint, which = until_s - z[time], -1, 0
        h = left if clock[STEP] >= left else min(clock[STEP], 0.5 * left)
        _weigh(m, phases, scale, z, of.scale)
        if clock[BEGUN] == 0.0:
            rates(p, phases, z, m.room[OUT], m.room[TOLD])
            clock[BEGUN] = determinant(m.tree, m.work)
            clock[LARGEST] = abs(clock[BEGUN])
        error, factor = _tried(of, step, m, y, h, end, clock)
        steep = steepness(m.tree, m.work) > STEEP
        clock[STEPS] += 1
        if (factor >= 1.0 or h <= shortest_s) and len(phases) > 0:
            at, joint, which, trials = first_switch(of, step, watched, y, end, h)
            clock[STEPS] += trials
            if joint >= 0:
                h = at
                error, factor = _tried(of, step, m, y, h, end, clock)
        if h <= shortest_s and not error < REJECT:
            return SPENT
        if factor < 1.0 and h > shortest_s:
            clock[STEP] = max(h * factor, shortest_s)
            continue
        for i in range(len(z)):
            z[i], y[1, i] = end[0, i], end[1, i]
        if joint >= 0:
            clock[STEP] = clock[STEP] if joint >= joints else begin_s
            if which != ROOM or m.walls[joint, K] < np.inf:
                switch(of, watched, z, joint, which)
        else:
            if h == left:
                z[time], y[1, time] = until_s, 0.0
            clock[STEP] = max(h * factor, clock[STEP] if h < clock[STEP] else 0.0)
            for k in range(joints):
                if m.walls[k, K] == np.inf and signal(of, watched, z, k, ROOM) < -2.0 * LEFT:
                    phases[k, MEMORY] = 0.0
        begun, now = clock[BEGUN], clock[ENDED]
        if now / begun < 1.0:
            clock[STEP] = min(clock[STEP], 0.5 * h * now / (begun - now))
        clock[BEGUN], clock[LARGEST] = now, max(clock[LARGEST], abs(now))
        if abs(now) < SINGULAR ** max(1.0, 0.5 * m.tree.closing) * clock[LARGEST]:
            return SPENT
        if joint >= 0 and which == ROOM:
            return joint
        if steep:
            rates(p, phases, z, m.room[OUT], m.room[TOLD])
            clock[BEGUN], y[1] = 0.0, 0.0
            choose(m.tree, m.work, m.driven)
    return REACHED


@bare
def _weigh(m: Mechanism, phases: FloatArray, scale: FloatArray, z: FloatArray, weights: FloatArray) -> None:
    """Fill the scales: those given, radians of angles on walls, present speeds and works where larger."""
    size, first, n = len(m.row), len(m.q) - len(m.a), len(m.q)
    for i in range(len(z)):
        weights[i] = scale[i]
    for k in range(len(m.walls)):
        if phases[k, CONTACT] == FOLLOWS:
            x = m.joints[k, GAP]
            weights[x] = 1.0
            weights[size + x] /= m.walls[k, C]
    for i in range(size, len(z)):
        if i != 2 * size:
            weights[i] = max(weights[i], abs(z[i]))
    for i in range(size):
        if m.work.place[i] < first or m.work.place[i] >= n:
            weights[i] = weights[size + i] = np.inf


@bare
def _tried(
    of: Problem, step: Any, m: Mechanism, y: FloatArray, h: float, end: FloatArray, clock: FloatArray
) -> tuple[float, float]:
    """Return a step's error, and what the next may be longer by: less than 1 where this one was too long."""
    error, far = step(of, y, h, end), 0.0
    clock[ENDED] = determinant(m.tree, m.work)
    if not clock[ENDED] / clock[BEGUN] > NEARER:
        error = REJECT
    for k in range(len(m.walls)):
        x, unit = m.joints[k, GAP], 1.0 if of.phases[k, CONTACT] == FOLLOWS else m.walls[k, C]
        far = max(far, np.hypot(end[0, x] - y[0, x], end[0, x + 1] - y[0, x + 1]) / unit)
    for i in range(m.tree.angles):
        far = max(far, abs(end[0, i] - y[0, i]))
    factor = SAFETY * max(error, 1e-30) ** (-1.0 / of.method.order)
    if error <= 1.0:
        factor = min(max(factor, 1.0), MOST)
    if far > MOVED or not np.isfinite(far):
        factor = min(factor, SAFETY * MOVED / far)
    return error, max(factor, LEAST) if factor == factor else LEAST

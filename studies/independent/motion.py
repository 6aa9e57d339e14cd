"""Crank-sliders with joint clearance, walls that give or rigid ones, integrated near round-off by events.

Within a step every force is smooth: it ends where a contact changes its law (see ``switches``). Towards touch
and release, where forces go with delta^1.5, its length falls as the error's estimate asks. What becomes of a
pin at a rigid wall is settled in ``rigid_walls``.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, njit, typeof, void
from numba.types import FunctionType  # type: ignore[attr-defined]

from engine_models.reference import kernels
from engine_models.scene.scene import Scene
from studies.independent import drives, equations, loads, mechanism, stepping, switches
from studies.independent.drives import stops_s
from studies.independent.equations import (
    CONTACT,
    FOLLOWS,
    GAS,
    MEMORY,
    OF_JOINT,
    PIECE,
    PUSHED,
    STATE,
    SUMS,
    TIME,
    WORK,
    kinematics,
    placed,
)
from studies.independent.loads import gas_piece
from studies.independent.mechanism import (
    SIZE,
    FloatArray,
    Mechanism,
    Walls,
    mechanism_of,
    speed_of,
    start_of,
)
from studies.independent.rigid_walls import RigidWalls
from studies.independent.stepping import REJECT, Table
from studies.independent.switches import GAP, LEFT, first_switch, piece_of, signal, switch

#: Modules whose text the machine code has taken over.
COMPILED_WITH = (drives, loads, mechanism, equations, stepping, switches)
#: Room that the error is given when a step is chosen, and bounds of what it changes by.
SAFETY, LEAST, MOST = 0.8, 0.1, 4.0
#: Part of its clearance that a pin moves in a step.
MOVED = 0.5
#: The first step of a scene and after an event, and the shortest, as parts of the time to cross a clearance.
BEGIN, SHORTEST = 1e-3, 1e-11
#: Places in ``clock``: the next step in s, and how many have been taken.
STEP, STEPS = range(2)
#: The shortest flight between rigid walls, and the lowest, as a part of the clearance; it falls with that.
SHORTEST_FLIGHT_S, LOWEST = 2e-9, 1e-12
#: What an impact on a rigid wall counts for, in steps.
SETTLING = 20
#: What comes of an advance, beside a joint's number.
REACHED, SPENT = 3, 4


class Contact(NamedTuple):
    """A contact that is over, or an impulse of a rigid wall: see ``engine.Impacts``."""

    time_s: float
    duration_s: float
    approach_speed_m_s: float
    normal_impulse_N_s: float
    energy_lost_J: float


class Motion:
    """A scene in motion, by a step of ``stepping`` and its table, for so many steps at most.

    ``z`` (STATE,) and ``phases`` (4, 3) are as in ``equations``, ``contacts`` those of every joint that are
    over. The crank starts ``moved_rad`` beside its angle.

    Raises:
        ValueError: a pin begins in a rigid wall.
    """

    def __init__(
        self,
        scene: Scene,
        step: Any,
        table: Table,
        steps: float = np.inf,
        moved_rad: float = 0.0,
        shortest_flight_s: float = SHORTEST_FLIGHT_S,
    ) -> None:
        self.mechanism, self.table, self.steps = mechanism_of(scene), table, steps
        data = typeof(table), typeof(self.mechanism)
        self.rates, self.step, self.advance = (_compiled(f, *data) for f in (equations.rates, step, advance))
        lowest = LOWEST * shortest_flight_s / SHORTEST_FLIGHT_S
        self.rigid = RigidWalls(self.mechanism, self.rates, shortest_flight_s, lowest)
        self.contacts: tuple[list[Contact], ...] = ([], [], [])
        walls, speed = self.mechanism.walls, speed_of(scene)
        crossing_s = walls.c[walls.c > 0].min() / speed
        room = np.where(walls.c > 0, walls.c, 1.0)
        self.scale = np.concatenate([[1.0], np.repeat(room, 2), np.full(SIZE, speed)])
        self.scale[SIZE] /= scene.crank.length_m
        self.begin_s, self.shortest_s = BEGIN * crossing_s, SHORTEST * crossing_s
        self.clock = np.array([self.begin_s, 0.0])
        self.stops_s = stops_s(self.mechanism.drive)
        self.z, self.phases = np.zeros(STATE), np.zeros((4, 3))
        self.z[:SIZE], self.z[SIZE:TIME] = start_of(scene)
        self.z[0] += moved_rad
        self.phases[GAS, PIECE] = gas_piece(self.mechanism.load, float(self.z[0]))
        self._begun: dict[int, tuple[float, float, FloatArray]] = {}
        for k in range(3):
            if walls.c[k] > 0 and np.hypot(*self.z[2 * k + 1 : 2 * k + 3]) > walls.c[k]:
                self._begin_in_contact(k)

    @property
    def time_s(self) -> float:
        """The time reached."""
        return float(self.z[TIME])

    @property
    def y(self) -> FloatArray:
        """The state in the coordinates w, (STATE,)."""
        return np.asarray(placed(self.mechanism.walls, self.phases, self.z))

    @property
    def slider_m(self) -> float:
        """The slider's position."""
        return float(kinematics(self.mechanism.bodies, self.y, np.empty((SIZE, SIZE)), np.empty(SIZE)))

    def answer(self) -> tuple[FloatArray, FloatArray]:
        """Return the derivative of z (STATE,), and what is told of joints and drive (4, 3)."""
        out, told = np.empty(STATE), np.empty((4, 3))
        self.rates(self.mechanism, self.phases, self.z, out, told)
        return out, told

    def to(self, time_s: float) -> bool:
        """Go on to a time; return whether it is reached before the steps are taken."""
        now = self.time_s
        for stop in [*self.stops_s[(self.stops_s > now) & (self.stops_s < time_s)].tolist(), time_s]:
            came = -1
            while came != REACHED:
                came = self.advance(
                    self.step,
                    self.table,
                    self.rates,
                    self.mechanism,
                    self.phases,
                    self.scale,
                    self.z,
                    self.clock,
                    self.begin_s,
                    self.shortest_s,
                    stop,
                    self.steps,
                )
                if came == SPENT:
                    return False
                if came != REACHED:
                    self._meet(came)
        return True

    def _begin_in_contact(self, k: int) -> None:
        """Let a pin that starts in its wall touch it now."""
        walls = self.mechanism.walls
        if np.isinf(walls.K[k]):
            raise ValueError(f"a pin of joint {k} begins in its rigid wall")
        speed = self._outward_m_s(k)
        sliding = float(self.rigid.sliding_row(self.z, k) @ self.z[SIZE:TIME])
        self.phases[k] = PUSHED, walls.a[k] / max(speed, walls.slowest[k]), piece_of(walls, k, sliding)
        self._begun[k] = self.time_s, speed, self._sums(k)

    def _meet(self, joint: int) -> None:
        """Enter a touch or a release, or settle what becomes of a pin at its rigid wall."""
        if np.isinf(self.mechanism.walls.K[joint]):
            self._settle(joint)
        elif self.phases[joint, CONTACT] == PUSHED:
            self._begun[joint] = self.time_s, self._outward_m_s(joint), self._sums(joint)
        else:
            began, speed, sums = self._begun.pop(joint)
            impulse, *lost = (self._sums(joint) - sums).tolist()
            self.contacts[joint].append(Contact(began, self.time_s - began, speed, impulse, sum(lost)))

    def _outward_m_s(self, k: int) -> float:
        x = 2 * k + 1
        d, rate = self.z[x : x + 2], self.z[SIZE + x : SIZE + x + 2]
        return float(d @ rate / np.hypot(*d))

    def _sums(self, k: int) -> FloatArray:
        """Return a joint's sums (OF_JOINT,) until now."""
        return np.array(self.z[SUMS + OF_JOINT * k : SUMS + OF_JOINT * (k + 1)])

    def _settle(self, joint: int) -> None:
        """Let a pin that has come to its rigid wall hit it, or one that is no more pressed to it leave."""
        before, y = np.flatnonzero(self.phases[:, CONTACT] == FOLLOWS).tolist(), self.y
        after, following = self.rigid.settled(y, self.phases, joint, before)
        y[SIZE:TIME] = after.rate
        y[WORK] += after.driver_N_m_s * after.rate[0]
        for got in after.impulses:
            y[SUMS + OF_JOINT * got.joint : SUMS + OF_JOINT * got.joint + 2] += got.normal_N_s, got.lost_J
            if got.normal_N_s != 0:
                entry = Contact(self.time_s, 0.0, got.speed_m_s, got.normal_N_s, got.lost_J)
                self.contacts[got.joint].append(entry)
        self.z[:] = self.rigid.placed_on_walls(y, self.phases, following)
        for k in {joint, *before} - set(following):
            self.phases[k, MEMORY] = 1.0
        self.clock[STEPS] += SETTLING


@cache
def _compiled(function: Any, table: Any, mechanism: Any) -> Any:
    """Return ``rates``, a step or ``advance`` as machine code; they know of each other no more than types.

    So none is compiled as a part of another, over and over; and all are kept on disk, as they take half a
    minute. ``table`` and ``mechanism`` are types.
    """
    phases, vector = float64[:, ::1], float64[::1]
    rates = void(mechanism, phases, vector, vector, float64[:, ::1])
    shared = FunctionType(rates), mechanism, phases, vector, vector
    step = float64(table, *shared, float64, vector)
    signature = rates if function is equations.rates else step
    if function is advance:
        signature = int64(FunctionType(step), table, *shared, vector, *[float64] * 4)
    keep = kernels.njit(signature, cache=True, error_model="numpy")
    return keep(getattr(function, "py_func", function))


def advance(
    step: Any,
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    clock: FloatArray,
    begin_s: float,
    shortest_s: float,
    until_s: float,
    most_steps: float,
) -> int:
    """Move state, phases and clock on to a time and return ``REACHED``.

    Or return ``SPENT`` if it takes more steps, or none is short enough.
    Where a pin touches a wall or leaves it return the joint's number. At a rigid wall nothing is switched.
    """
    end, weights, walls = np.empty(STATE), scale.copy(), m.walls
    while y[TIME] < until_s:
        if clock[STEPS] >= most_steps:
            return SPENT
        left, joint, which = until_s - y[TIME], -1, 0
        h = left if clock[STEP] >= left else min(clock[STEP], 0.5 * left)
        _weigh(walls, phases, scale, y, weights)
        error = step(table, rates, m, phases, weights, y, h, end)
        clock[STEPS] += 1
        factor = _factor(table, walls, phases, y, end, error)
        if factor >= 1.0 or h <= shortest_s:
            at, joint, which, trials = first_switch(step, table, rates, m, phases, weights, y, end, h)
            clock[STEPS] += trials
            if joint >= 0:
                h = at
                error = step(table, rates, m, phases, weights, y, h, end)
                factor = _factor(table, walls, phases, y, end, error)
        if h <= shortest_s and not error < REJECT:
            return SPENT
        if factor < 1.0 and h > shortest_s:
            clock[STEP] = max(h * factor, shortest_s)
            continue
        y[:] = end
        if joint >= 0:
            clock[STEP] = clock[STEP] if joint == GAS else begin_s
            if which != GAP or walls.K[joint] < np.inf:
                switch(rates, m, phases, y, joint, which)
            if which == GAP:
                return joint
        else:
            if h == left:
                y[TIME] = until_s
            clock[STEP] = max(h * factor, clock[STEP] if h < clock[STEP] else 0.0)
            for k in range(3):
                if walls.K[k] == np.inf and signal(rates, m, phases, y, k, GAP) < -2.0 * LEFT:
                    phases[k, MEMORY] = 0.0
    return REACHED


@njit(error_model="numpy")
def _weigh(walls: Walls, phases: FloatArray, scale: FloatArray, y: FloatArray, weights: FloatArray) -> None:
    """Fill the scales: those given, but of angles on walls radians, and present speeds that are larger."""
    weights[:] = scale
    for k in range(3):
        if phases[k, CONTACT] == FOLLOWS:
            x = 2 * k + 1
            weights[x] = 1.0
            weights[SIZE + x] /= walls.c[k]
    for i in range(SIZE, 2 * SIZE):
        weights[i] = max(weights[i], abs(y[i]))


@njit(error_model="numpy")
def _factor(
    table: Table, walls: Walls, phases: FloatArray, y: FloatArray, end: FloatArray, error: float
) -> float:
    """Return what the next step may be longer by: less than 1 where this one was too long."""
    far = 0.0
    for k in range(3):
        if walls.c[k] > 0.0:
            x, unit = 2 * k + 1, 1.0 if phases[k, CONTACT] == FOLLOWS else walls.c[k]
            far = max(far, np.hypot(end[x] - y[x], end[x + 1] - y[x + 1]) / unit)
    factor = SAFETY * max(error, 1e-30) ** (-1.0 / table.order)
    if error <= 1.0:
        factor = min(max(factor, 1.0), MOST)
    if far > MOVED or not np.isfinite(far):
        factor = min(factor, SAFETY * MOVED / far)
    return max(factor, LEAST) if factor == factor else LEAST

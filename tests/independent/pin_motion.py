"""Crank-sliders with joint clearance, walls that give or rigid ones, integrated near round-off by events.

Within a step every force is smooth: it ends where a contact changes its law (see ``switches``). Towards touch
and release, where forces go with delta^1.5, its length falls as the error's estimate asks. What becomes of a
pin at a rigid wall is settled in ``rigid_clearance``.
"""

from functools import cache
from typing import Any

import numpy as np
from numba import float64, int64, njit, typeof
from numba.types import FunctionType  # type: ignore[attr-defined]

from engine_models.scene.scene import Scene
from tests.independent.pins import (
    CONTACT,
    FLIGHT,
    FOLLOWS,
    JOINTS,
    MEMORY,
    PIECE,
    SIZE,
    Bodies,
    FloatArray,
    Walls,
    bodies_of,
    placed,
    slider_place,
    start_of,
    walls_of,
)
from tests.independent.rigid_clearance import SHORTEST_FLIGHT_S, settled
from tests.independent.rigid_kinematics import Pins
from tests.independent.stepping import REJECT, Table
from tests.independent.switches import GAP, LEFT, first_switch, piece_of, signal, sliding_speed, switch

#: Room that the error is given when a step is chosen, and bounds of what it changes by.
SAFETY, LEAST, MOST = 0.8, 0.1, 4.0
#: Part of its clearance that a pin moves in a step.
MOVED = 0.5
#: The first step of a scene and after an event, and the shortest, as parts of the time to cross a clearance.
BEGIN, SHORTEST = 1e-3, 1e-11
#: Places in ``clock``.
TIME, STEP, STEPS, TOUCHES = range(4)
#: The lowest flight, as a part of the clearance, beside ``SHORTEST_FLIGHT_S``; it falls with the shortest.
LOWEST = 1e-12
#: What an impact counts for, in steps.
SETTLING = 20
#: What comes of an advance, beside a joint's number.
REACHED, SPENT = 3, 4


class Motion:
    """A scene in motion, by a step of ``stepping`` and its table, for so many steps at most.

    The crank starts ``moved_rad`` beside its angle.
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
        self.table, self.steps = table, steps
        self.pins, self.shortest_flight_s, self.following = Pins(scene), shortest_flight_s, tuple[str, ...]()
        self.bodies, self.walls = bodies_of(scene), walls_of(scene)
        data = typeof(table), typeof(self.bodies), typeof(self.walls)
        self.advance, self.step = _compiled(advance, *data), _compiled(step, *data)
        self.z, self.phases = start_of(scene), np.zeros((3, 3))
        self.z[0] += moved_rad
        speed = scene.crank.length_m * abs(scene.start.crank_speed_rad_s)
        crossing_s = self.walls.c[self.walls.c > 0].min() / speed
        room = np.where(self.walls.c > 0, self.walls.c, 1.0)
        self.scale = np.concatenate([[1.0], np.repeat(room, 2), np.full(SIZE, speed)])
        self.scale[SIZE] /= scene.crank.length_m
        self.begin_s, self.shortest_s = BEGIN * crossing_s, SHORTEST * crossing_s
        self.clock = np.array([0.0, self.begin_s, 0.0, 0.0])

    def to(self, time_s: float) -> bool:
        """Go on to a time; return whether it is reached before the steps are taken."""
        while True:
            came = self.advance(
                self.step,
                self.table,
                self.bodies,
                self.walls,
                self.phases,
                self.scale,
                self.z,
                self.clock,
                self.begin_s,
                self.shortest_s,
                time_s,
                self.steps,
            )
            if came in (REACHED, SPENT):
                return bool(came == REACHED)
            self._settle(came)

    def _settle(self, joint: int) -> None:
        """Let a pin that has come to its rigid wall hit it, or one that is no more pressed to it leave."""
        y, name, before = placed(self.walls, self.phases, self.z), JOINTS[joint], self.following
        state = y[:SIZE], y[SIZE:]
        state, _, self.following, _ = settled(
            self.pins,
            float(self.clock[TIME]),
            state,
            name,
            before,
            self.shortest_flight_s,
            LOWEST * self.shortest_flight_s / SHORTEST_FLIGHT_S,
        )
        self.z[:] = np.concatenate(state)
        self.clock[STEPS] += SETTLING
        for k, other in enumerate(JOINTS):
            x, phase = 2 * k + 1, self.phases[k]
            if other in self.following:
                d, speed = state[0][x : x + 2], state[1][x : x + 2]
                phase[CONTACT] = FOLLOWS
                phase[PIECE] = piece_of(
                    self.walls, k, sliding_speed(self.bodies, self.walls, np.concatenate(state), k)
                )
                self.z[x : x + 2] = np.arctan2(d[1], d[0]), 0.0
                turn = (d[0] * speed[1] - d[1] * speed[0]) / self.walls.c[k] ** 2
                self.z[SIZE + x : SIZE + x + 2] = turn, 0.0
            elif other in {name, *before}:
                phase[CONTACT], phase[MEMORY] = FLIGHT, 1.0

    @property
    def slider_m(self) -> float:
        return float(slider_place(self.bodies, self.walls, self.phases, self.z))


@cache
def _compiled(function: Any, *data: Any) -> Any:
    """Return ``advance`` or a step as machine code; they know of each other no more than types.

    So neither is compiled as a part of the other, over and over. ``data`` are the types of table, bodies and
    walls.
    """
    shared = *data, float64[:, ::1], float64[::1], float64[::1]
    signature = float64(*shared, float64, float64[::1])
    if function is advance:
        signature = int64(FunctionType(signature), *shared, float64[::1], *[float64] * 4)
    return njit(signature, error_model="numpy")(function)


def advance(
    step: Any,
    table: Table,
    b: Bodies,
    walls: Walls,
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
    Where a pin comes to a rigid wall, or is no more pressed to it, return the joint's number.
    """
    end, weights = np.empty(len(y)), scale.copy()
    while clock[TIME] < until_s:
        if clock[STEPS] >= most_steps:
            return SPENT
        left, joint, which = until_s - clock[TIME], -1, 0
        h = left if clock[STEP] >= left else min(clock[STEP], 0.5 * left)
        _weigh(walls, phases, scale, y, weights)
        error = step(table, b, walls, phases, weights, y, h, end)
        clock[STEPS] += 1
        factor = _factor(table, walls, phases, y, end, error)
        if factor >= 1.0 or h <= shortest_s:
            at, joint, which, trials = first_switch(step, table, b, walls, phases, weights, y, end, h)
            clock[STEPS] += trials
            if joint >= 0:
                h = at
                error = step(table, b, walls, phases, weights, y, h, end)
                factor = _factor(table, walls, phases, y, end, error)
        if h <= shortest_s and not error < REJECT:
            return SPENT
        if factor < 1.0 and h > shortest_s:
            clock[STEP] = max(h * factor, shortest_s)
            continue
        y[:] = end
        if joint >= 0:
            clock[TIME] += h
            clock[STEP] = begin_s
            clock[TOUCHES] += which == GAP and phases[joint, CONTACT] == FLIGHT
            if which == GAP and walls.K[joint] == np.inf:
                return joint
            switch(b, walls, phases, y, joint, which)
        else:
            clock[TIME] = until_s if h == left else clock[TIME] + h
            clock[STEP] = max(h * factor, clock[STEP] if h < clock[STEP] else 0.0)
            for k in range(3):
                if walls.K[k] == np.inf and signal(b, walls, phases, y, k, GAP) < -2.0 * LEFT:
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

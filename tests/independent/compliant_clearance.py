"""Crank-sliders with compliant joint clearance, integrated near round-off from event to event.

Within a step every force is smooth: it ends where a contact changes its law (see ``switches``). Towards touch
and release, where forces go with delta^1.5, its length falls as the error's estimate asks.
"""

from typing import Any

import numpy as np
from numba import njit

from engine_models.scene.scene import Scene
from tests.independent.pins import (
    CONTACT,
    FLIGHT,
    SIZE,
    Bodies,
    FloatArray,
    Walls,
    bodies_of,
    slider_place,
    start_of,
    walls_of,
)
from tests.independent.stepping import Table
from tests.independent.switches import GAP, first_switch, switch

#: Room that the error is given when a step is chosen, and bounds of what it changes by.
SAFETY, LEAST, MOST = 0.8, 0.1, 4.0
#: Part of its clearance that a pin moves in a step.
MOVED = 0.5
#: The first step of a scene and after an event, and the shortest, as parts of the time to cross a clearance.
BEGIN, SHORTEST = 1e-3, 1e-11
#: Places in ``clock``.
TIME, STEP, STEPS, TOUCHES = range(4)


class Motion:
    """A scene in motion, by a step of ``stepping`` and its table, for so many steps at most.

    The crank starts ``moved_rad`` beside its angle.
    """

    def __init__(
        self, scene: Scene, step: Any, table: Table, steps: float = np.inf, moved_rad: float = 0.0
    ) -> None:
        self.step, self.table, self.steps = step, table, steps
        self.bodies, self.walls = bodies_of(scene), walls_of(scene)
        self.y, self.phases = start_of(scene), np.zeros((3, 3))
        self.y[0] += moved_rad
        speed = scene.crank.length_m * abs(scene.start.crank_speed_rad_s)
        crossing_s = self.walls.c[self.walls.c > 0].min() / speed
        room = np.where(self.walls.c > 0, self.walls.c, 1.0)
        self.scale = np.concatenate([[1.0], np.repeat(room, 2), np.full(SIZE, speed)])
        self.scale[SIZE] /= scene.crank.length_m
        self.begin_s, self.shortest_s = BEGIN * crossing_s, SHORTEST * crossing_s
        self.clock = np.array([0.0, self.begin_s, 0.0, 0.0])

    def to(self, time_s: float) -> bool:
        """Go on to a time; return whether it is reached before the steps are taken."""
        return bool(
            advance(
                self.step,
                self.table,
                self.bodies,
                self.walls,
                self.phases,
                self.scale,
                self.y,
                self.clock,
                self.begin_s,
                self.shortest_s,
                time_s,
                self.steps,
            )
        )

    @property
    def slider_m(self) -> float:
        return float(slider_place(self.bodies, self.y))


@njit(error_model="numpy")
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
) -> bool:
    """Move state, phases and clock on to a time; return False where that takes more steps."""
    end, weights = np.empty(len(y)), scale.copy()
    while clock[TIME] < until_s:
        if clock[STEPS] >= most_steps:
            return False
        left, joint, which = until_s - clock[TIME], -1, 0
        h = left if clock[STEP] >= left else min(clock[STEP], 0.5 * left)
        _weigh(scale, y, weights)
        error = step(table, b, walls, phases, weights, y, h, end)
        clock[STEPS] += 1
        factor = _factor(table, walls, y, end, error)
        if factor >= 1.0 or h <= shortest_s:
            at, joint, which, trials = first_switch(step, table, b, walls, phases, weights, y, end, h)
            clock[STEPS] += trials
            if joint >= 0:
                h = at
                error = step(table, b, walls, phases, weights, y, h, end)
                factor = _factor(table, walls, y, end, error)
        if factor < 1.0 and h > shortest_s:
            clock[STEP] = max(h * factor, shortest_s)
            continue
        y[:] = end
        if joint >= 0:
            clock[TIME] += h
            clock[STEP] = begin_s
            clock[TOUCHES] += which == GAP and phases[joint, CONTACT] == FLIGHT
            switch(b, walls, phases, y, joint, which)
        else:
            clock[TIME] = until_s if h == left else clock[TIME] + h
            clock[STEP] = max(h * factor, clock[STEP] if h < clock[STEP] else 0.0)
    return True


@njit(error_model="numpy")
def _weigh(scale: FloatArray, y: FloatArray, weights: FloatArray) -> None:
    """Fill the scales of speeds: those given, or the pins' present ones where they are larger."""
    for i in range(SIZE, 2 * SIZE):
        weights[i] = max(scale[i], abs(y[i]))


@njit(error_model="numpy")
def _factor(table: Table, walls: Walls, y: FloatArray, end: FloatArray, error: float) -> float:
    """Return what the next step may be longer by: less than 1 where this one was too long."""
    far = 0.0
    for k in range(3):
        if walls.c[k] > 0.0:
            x = 2 * k + 1
            far = max(far, np.hypot(end[x] - y[x], end[x + 1] - y[x + 1]) / walls.c[k])
    factor = SAFETY * max(error, 1e-30) ** (-1.0 / table.order)
    if error <= 1.0:
        factor = min(max(factor, 1.0), MOST)
    if far > MOVED or not np.isfinite(far):
        factor = min(factor, SAFETY * MOVED / far)
    return max(factor, LEAST) if factor == factor else LEAST

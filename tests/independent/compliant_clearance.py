"""Crank-sliders with compliant joint clearance, integrated near round-off from event to event.

A step ends where a pin reaches its wall or leaves it: the whole step is repeated with other lengths until the
gap is zero to round-off. A pin that is nearest to its wall, or deepest in flight's terms, within a step is
followed to that time first, so that a touch shorter than a step is seen. Kinks of the forces, as of clipped
ones and of friction, are left to the error's estimate.
"""

from typing import Any

import numpy as np
from numba import njit

from engine_models.scene.scene import Scene
from tests.independent.pins import (
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

#: Room that the error is given when a step is chosen, and bounds of what it changes by.
SAFETY, LEAST, MOST = 0.8, 0.1, 4.0
#: Part of its clearance that a pin moves in a step.
MOVED = 0.5
#: The first step of a scene and after an event, and the shortest, as parts of the time to cross a clearance.
BEGIN, SHORTEST = 1e-3, 1e-11
#: Part of c^2 by which a pin may miss its wall and yet be followed to where it is nearest.
NEAR = 0.05
#: Most trials for an event, and when its gap is zero: a part of c^2.
TRIALS, ZERO = 80, 2e-16
#: Places in ``clock``.
TIME, STEP, STEPS, TOUCHES = range(4)


class Motion:
    """A scene in motion, by a step of ``stepping`` and its table."""

    def __init__(self, scene: Scene, step: Any, table: Table, moved_rad: float = 0.0) -> None:
        self.step, self.table = step, table
        self.bodies, self.walls = bodies_of(scene), walls_of(scene)
        self.y, self.memory = start_of(scene), np.full(3, FLIGHT)
        self.y[0] += moved_rad
        speed = scene.crank.length_m * abs(scene.start.crank_speed_rad_s)
        crossing_s = self.walls.c[self.walls.c > 0].min() / speed
        room = np.where(self.walls.c > 0, self.walls.c, 1.0)
        self.scale = np.concatenate([[1.0], np.repeat(room, 2), np.full(SIZE, speed)])
        self.scale[SIZE] /= scene.crank.length_m
        self.begin_s, self.shortest_s = BEGIN * crossing_s, SHORTEST * crossing_s
        self.clock = np.array([0.0, self.begin_s, 0.0, 0.0])

    def to(self, time_s: float, steps: float = np.inf) -> bool:
        """Go on to a time; return whether it is reached within so many steps since the start."""
        return bool(
            advance(
                self.step,
                self.table,
                self.bodies,
                self.walls,
                self.memory,
                self.scale,
                self.y,
                self.clock,
                self.begin_s,
                self.shortest_s,
                time_s,
                steps,
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
    memory: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    clock: FloatArray,
    begin_s: float,
    shortest_s: float,
    until_s: float,
    most_steps: float,
) -> bool:
    """Move state, memory and clock on to a time; return False where that takes more steps."""
    end, landed = np.empty(len(y)), np.empty(len(y))
    weights = scale.copy()
    while clock[TIME] < until_s:
        if clock[STEPS] >= most_steps:
            return False
        left = until_s - clock[TIME]
        h = min(clock[STEP], left)
        if left < 2.0 * h:
            h = left if h == left else 0.5 * left
        _weigh(scale, y, weights)
        error = step(table, b, walls, memory, weights, y, h, end)
        clock[STEPS] += 1
        far = _moved(walls, y, end)
        if (error > 1.0 or far > MOVED) and h > shortest_s:
            factor = max(LEAST, SAFETY * error ** (-1.0 / table.order)) if error > 1.0 else 1.0
            clock[STEP] = max(h * min(factor, max(LEAST, 0.8 * MOVED / far) if far > MOVED else 1.0), shortest_s)
            continue
        which, at = -1, h
        for k in range(3):
            if walls.c[k] > 0.0:
                crossed = _crossing(step, table, b, walls, memory, weights, y, end, h, k, landed, clock)
                if 0.0 <= crossed <= at:
                    which, at = k, crossed
        if which < 0:
            y[:] = end
            clock[TIME] = until_s if h == left else clock[TIME] + h
            grown = h * min(MOST, SAFETY * max(error, 1e-30) ** (-1.0 / table.order))
            clock[STEP] = max(grown, clock[STEP]) if h < clock[STEP] else grown
            continue
        if at > 0.0:
            step(table, b, walls, memory, weights, y, at, landed)
            y[:] = landed
        clock[TIME] += at
        clock[STEP] = begin_s
        if memory[which] == FLIGHT:
            x = 2 * which + 1
            rate = _outward(y, which) / np.hypot(y[x], y[x + 1])
            memory[which] = walls.a[which] / max(rate, walls.slowest[which])
            clock[TOUCHES] += 1
        else:
            memory[which] = FLIGHT
    return True


@njit(error_model="numpy")
def _weigh(scale: FloatArray, y: FloatArray, weights: FloatArray) -> None:
    """Fill the scales of speeds: those given, or the pins' present ones where they are larger."""
    for i in range(SIZE + 1, 2 * SIZE):
        weights[i] = max(scale[i], abs(y[i]))
    weights[SIZE] = max(scale[SIZE], abs(y[SIZE]))


@njit(error_model="numpy")
def _moved(walls: Walls, y: FloatArray, end: FloatArray) -> float:
    """Return how far the fastest pin has moved, in its clearance."""
    far = 0.0
    for k in range(3):
        if walls.c[k] > 0.0:
            x = 2 * k + 1
            part = np.hypot(end[x] - y[x], end[x + 1] - y[x + 1]) / walls.c[k]
            if not part <= far:
                far = part
    return far if far == far else 1e6


@njit(error_model="numpy")
def _gap(walls: Walls, y: FloatArray, k: int) -> float:
    """Return d . d - c^2."""
    x = 2 * k + 1
    distance = np.hypot(y[x], y[x + 1])
    return (distance - walls.c[k]) * (distance + walls.c[k])


@njit(error_model="numpy")
def _outward(y: FloatArray, k: int) -> float:
    """Return d . d', half the gap's rate."""
    x = 2 * k + 1
    return y[x] * y[SIZE + x] + y[x + 1] * y[SIZE + x + 1]


@njit(error_model="numpy")
def _crossing(
    step: Any,
    table: Table,
    b: Bodies,
    walls: Walls,
    memory: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    end: FloatArray,
    h: float,
    k: int,
    trial: FloatArray,
    clock: FloatArray,
) -> float:
    """Return when in a step of h a pin touches or leaves its wall, -1 where it does not.

    Of a pin that touches the signs are turned: the gap always grows through zero.
    """
    sign = 1.0 if memory[k] == FLIGHT else -1.0
    c2 = walls.c[k] ** 2
    g0, g1 = sign * _gap(walls, y, k), sign * _gap(walls, end, k)
    r0, r1 = 2.0 * sign * _outward(y, k), 2.0 * sign * _outward(end, k)
    high, g_high = h, g1
    if g1 <= 0.0 or (r0 <= 0.0 and r1 <= 0.0):
        if not (r0 > 0.0 > r1) or _highest(g0, g1, r0, r1, h) < -NEAR * c2:
            return -1.0
        # The time at which the gap is largest, by its rate.
        low, r_low, r_high = 0.0, r0, r1
        side = 0
        for _ in range(TRIALS):
            high_or_low = (low * r_high - high * r_low) / (r_high - r_low)
            step(table, b, walls, memory, scale, y, high_or_low, trial)
            clock[STEPS] += 1
            r = 2.0 * sign * _outward(trial, k)
            g_high = sign * _gap(walls, trial, k)
            if g_high > 0.0 or abs(r) <= 1e-14 * max(r0, -r1) or high - low < 1e-13 * h:
                high = high_or_low
                break
            if r > 0.0:
                low, r_low = high_or_low, r
                r_high = 0.5 * r_high if side == 1 else r_high
                side = 1
            else:
                high, r_high = high_or_low, r
                r_low = 0.5 * r_low if side == -1 else r_low
                side = -1
        if g_high <= 0.0:
            return -1.0
    low, g_low = 0.0, g0
    if g0 >= 0.0:  # it has just left, or touched
        if r0 >= 0.0:
            return 0.0
        for _ in range(TRIALS):
            low = 0.5 * (low if low > 0.0 else high)
            step(table, b, walls, memory, scale, y, low, trial)
            clock[STEPS] += 1
            g_low = sign * _gap(walls, trial, k)
            if g_low < 0.0:
                break
            high, g_high = low, g_low
        if g_low >= 0.0:
            return 0.0
    side = 0
    for _ in range(TRIALS):
        at = (low * g_high - high * g_low) / (g_high - g_low)
        step(table, b, walls, memory, scale, y, at, trial)
        clock[STEPS] += 1
        g = sign * _gap(walls, trial, k)
        if abs(g) <= ZERO * c2 or high - low <= 1e-15 * h:
            return at
        if g < 0.0:
            low, g_low = at, g
            g_high = 0.5 * g_high if side == 1 else g_high
            side = 1
        else:
            high, g_high = at, g
            g_low = 0.5 * g_low if side == -1 else g_low
            side = -1
    return high


@njit(error_model="numpy")
def _highest(g0: float, g1: float, r0: float, r1: float, h: float) -> float:
    """Return the largest value of the cubic through both ends, at a grid of places."""
    highest = max(g0, g1)
    for i in range(1, 16):
        s = i / 16
        value = (1 + 2 * s) * (1 - s) ** 2 * g0 + s * s * (3 - 2 * s) * g1
        value += h * s * (1 - s) * ((1 - s) * r0 - s * r1)
        highest = max(highest, value)
    return highest

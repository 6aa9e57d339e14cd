"""The event loop: explicit Runge-Kutta steps from event to event, and samples on their interpolants.

A step is proposed, attempted, and accepted or rejected; where an event lies within it, the step is taken
again so that it ends there; then the contact changes its phase. Numba compiles it once for all mechanisms;
a kernel's functions are called by address.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from reference_solver import events, steps
from reference_solver.machine_code import Function, call, entry, inner
from reference_solver.mechanism.contacts import FLIGHT
from reference_solver.run import AT, DENSE, END, NEW, OLD, RECORDS, SLOPES, START, Run

#: How ``advance`` ends: at the end, with its budget of steps used, with the log full, at a step that met a
#: singular configuration or overflowed, at an event on a rigid wall from which on other pins follow, or
#: before a step within which a sample lies, where no dense output has been compiled.
DONE, SPENT, FULL, FAILED, WALL, WITHIN = range(6)
#: Bounds of a contact's first step, as a part of its duration.
SHORTEST_PART, LONGEST_PART = 1e-6, 0.5
#: Mobilities are looked up again after so many steps, in which bodies turn little.
STEPS_BETWEEN_PROBES = 16
#: Where in a step RK4's dense output takes an additional slope; not 1/2, where all quartics with the same
#: ends share it.
INSIDE = 1.0 / 3.0


@inner
def write(run, rows, contacts, samples, t, of):
    """Write the sample of a row's state; return whether it could."""
    row, out = run.taken, run.samples + run.taken * run.sample_width + 8 * run.size
    condition = call(run.forces, run.p, run.contacts, t, run.at + of * run.width, out)
    run.least = min(run.least, condition)
    for c in range(run.size):
        samples[row, c] = rows[of, c]
    if contacts is not None:
        phases = samples.shape[1] - 2 * len(contacts)
        for k in range(len(contacts)):
            samples[row, phases + 2 * k] = contacts[k].phase
            samples[row, phases + 2 * k + 1] = contacts[k].memory
    run.taken += 1
    return condition < np.inf


@inner
def interpolate(run, rows, method, step, x, parts):
    """Set y of AT to that at x of a step, by the first rows of dense output; of RK4 q by the quintic."""
    if method is None:
        steps.set_within(run, rows, step.end - run.time, x, run.time)
    for c in range(0 if run.controlled != 0 else run.n, run.size):
        change = 0.0
        for i in range(parts - 1, -1, -1):
            change = (change + rows[DENSE + i, c]) * (x if i % 2 == 0 else 1.0 - x)
        rows[AT, c] = rows[OLD, c] + change


@inner
def write_within(run, rows, contacts, method, times, samples, step):
    """Write the samples before the end of a step by the method's interpolant: of order 7 in s, or 4.

    Return whether it could. RK4's is, of velocities and sums, the quartic through values and slopes at both
    ends and the slope at a third of the step, evaluated on the cubic: in error by O(h^5), as the step itself
    is. (The quintic's own derivative would divide the round-off of q by h, and graded steps are short.)
    """
    if run.taken == len(times) or times[run.taken] >= step.end:
        return True
    ok, size, H = steps.know_slopes(run, step.end - run.time), run.size, step.H
    _, first = steps.time_at(step, step.begin)
    _, last = steps.time_at(step, step.begin + H)
    for c in range(size):
        change = rows[NEW, c] - rows[OLD, c]
        start, stop = H * (first * rows[START, c]), H * (last * rows[END, c])
        rows[DENSE, c], rows[DENSE + 1, c] = change, start - change
        rows[DENSE + 2, c] = 2.0 * change - start - stop
    parts = 4
    if method is None:
        interpolate(run, rows, method, step, INSIDE, 3)
        ok = steps.set_slopes(run, run.time + INSIDE * H, AT, SLOPES) < np.inf and ok
        for c in range(size):  # x^2 (1 - x)^2 has the slope 4/27 there
            cubic = rows[DENSE, c] + (rows[DENSE + 1, c] + rows[DENSE + 2, c]) / 3.0
            rows[DENSE + 3, c] = 6.75 * (H * rows[SLOPES, c] - cubic)
    else:
        stages, parts = method[0].stages, 3 + method[0].dense_rows
        for c in range(size):
            rows[SLOPES, c], rows[SLOPES + stages, c] = first * rows[START, c], last * rows[END, c]
        for row in range(stages + 1, method[0].slopes):
            ok = steps.set_stage(run, rows, method, step, row) < np.inf and ok
        for i in range(method[0].dense_rows):
            for c in range(size):
                total = 0.0
                for j in range(method[0].slopes):
                    total += method[0].dense[i, j] * rows[SLOPES + j, c]
                rows[DENSE + 3 + i, c] = H * total
    while run.taken < len(times) and times[run.taken] < step.end:
        time = times[run.taken]
        interpolate(run, rows, method, step, (steps.place_at(step, time) - step.begin) / H, parts)
        ok = write(run, rows, contacts, samples, time, AT) and ok
    return ok


@inner
def resolve(run, state, contacts, k):
    """Resolve an event on contact k's rigid wall, -1 at the start; return whether the same pins follow."""
    run.wall = k
    same = call(run.resolve, state.ctypes.data, run.contacts, run.time, run.at, len(contacts)) == 0.0
    steps.set_gaps(run, run.time, OLD)
    return same


@inner
def move_on(run, rows, contacts, method, step, error, event, factor):
    """Move on to the end of a step, and choose the one after it."""
    old, new = rows[OLD], rows[NEW]
    for c in range(run.whole):
        old[c] = new[c]
    if method is not None:
        for c in range(run.size):
            rows[START, c] = rows[END, c]
    if contacts is not None:
        if run.wall >= 0 and step.end > run.time:  # all contacts take part again
            run.wall = -1
            for k in range(len(contacts)):
                contacts[k].ignored = 0.0
    run.time, run.condition = step.end, max(run.condition, run.worst)
    run.error, run.rejected = max(error, 1e-4), 0
    if run.controlled != 0 and event < 0 and step.end < run.end:
        reached, H = step.begin + step.H, step.H * factor  # the next step in s, and in time
        run.step = H if step.sign == 0.0 else abs((2.0 * reached + H) * H)
        if step.sign < 0.0 and reached + H <= 0.0:  # beyond the release
            run.step = max(1.5 * reached * reached, factor * steps.lasting(step, 1.0))
        if contacts is not None:
            if run.fresh >= 0:
                part = steps.lasting(step, factor) / contacts[run.fresh].duration_s
                run.first_part, run.fresh = min(LONGEST_PART, max(SHORTEST_PART, part)), -1


@inner
def advance(state, rows, contacts, method, knots, times, samples):
    """Advance the motion to the run's end in place, event by event; return how that ended.

    See ``run.Run`` of the arguments; contacts, method and knots may be None (see ``loop_of``). Events are
    added to the log, and a sample is written for each of the times up to the end, on which no step depends.
    """
    run = state[0]
    if run.resumed == 0:  # a run, or a part of it, begins
        run.known = 0
        if contacts is not None:
            steps.set_gaps(run, run.time, OLD)
            for k in range(len(contacts)):
                closed = contacts[k].phase == FLIGHT and steps.gap_of(run, rows, OLD, k).g > 0.0
                if run.time == 0.0 and run.end > 0.0 and contacts[k].rigid == 0.0 and closed:
                    events.note(run, rows, contacts, 2 * k)
            if run.rigid_joints > 0 and run.settled == 0 and run.end > 0.0:
                if not resolve(run, state, contacts, -1):
                    return WALL
            steps.probe(run, rows, contacts)  # pins may have begun to follow rigid walls
        if method is not None:
            run.known = 1
            if not steps.set_slopes(run, run.time, OLD, START) < np.inf:
                return FAILED
    while True:
        while run.taken < len(times) and times[run.taken] <= run.time + run.slack:
            if not write(run, rows, contacts, samples, run.time, OLD):
                return FAILED
        run.resumed = run.time < run.end
        if run.resumed == 0:
            return DONE
        if run.steps >= run.budget:
            return SPENT
        if contacts is not None:
            if run.logged > len(run.events) // 2:
                return FULL
            closed = 0
            for k in range(len(contacts)):
                closed += contacts[k].phase != FLIGHT
            if run.located != 0 and run.steps % STEPS_BETWEEN_PROBES == 0 and closed > 0:
                steps.probe(run, rows, contacts)
        step, releasing = steps.propose(run, rows, contacts, method, knots)
        error, t = steps.attempt(run, rows, contacts, method, step, 1.0), run.time
        event, place, factor, longer = -1, 1.0, steps.changed(run, method, error), step
        if contacts is not None:
            if error <= 1.0:
                if method is not None:
                    h, far = step.end - t, steps.CONTROLLED_FLIGHT_PART
                    error = np.inf if steps.in_flight(run, rows, contacts, NEW, h, far) < 0.5 * h else error
                    factor = steps.changed(run, method, error)
            if error <= 1.0:
                step, event, place = events.cut(run, rows, contacts, method, step, releasing)
                if np.isnan(step.end):
                    error, step, factor = np.inf, steps.Step(t, 0.0, 0.0, longer.end - t, longer.end), 0.5
        if not error <= 1.0:
            run.step, run.rejected = steps.lasting(step, factor), run.rejected + 1
            if not t + run.step > t or run.rejected >= steps.MOST_REJECTIONS:
                return FAILED
            continue
        if knots is None:
            if run.taken < len(times) and times[run.taken] + run.slack < step.end:
                return WITHIN
        run.steps += 1
        if event < 0 or place > 0.0:
            if knots is not None:
                if not write_within(run, rows, contacts, method, times, samples, step):
                    return FAILED
            if contacts is not None:
                events.note_largest(run, rows, contacts, step.end - t)
            move_on(run, rows, contacts, method, step, error, event, factor)
        if contacts is not None:
            if event >= 0:
                if contacts[event // 2].rigid == 0.0:
                    events.note(run, rows, contacts, event)
                elif not resolve(run, state, contacts, event // 2):
                    run.resumed = 0
                    return WALL
                if run.controlled != 0 and not steps.set_slopes(run, run.time, OLD, START) < np.inf:
                    return FAILED


@cache
def loop_of(loose: bool, controlled: bool, within: bool) -> Callable[[Run], int]:
    """Return what advances runs: with contacts or without, by a method's error or not.

    ``within`` has it end steps at knots, and write samples that lie within a step; what does neither takes
    half as long to compile. That is done now, or was before.
    """

    def made() -> tuple[Any, Callable[..., Any]]:
        from numba import carray, float64, from_dtype, int64, types

        def enter(state, contacts, method, knots, rows, times, samples, sizes):  # type: ignore[no-untyped-def]
            of = carray(sizes, 6)
            return advance(
                carray(state, 1),
                carray(rows, (of[2], of[3])),
                carray(contacts, of[0]) if loose else None,
                carray(method, 1) if controlled else None,
                carray(knots, of[1]) if within else None,
                carray(times, of[4]),
                carray(samples, (of[4], of[5])),
            )

        records = map(from_dtype, RECORDS)
        return int64(*map(types.CPointer, (*records, float64, float64, float64, int64))), enter

    loop = entry(f"loop_{loose:d}{controlled:d}{within:d}", made)
    function = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 8)(loop.address)

    def take_on(run: Run, _: Function = loop) -> int:
        sizes = np.array([len(run.contacts), len(run.knots), *run.rows.shape, *run.samples.shape])
        arrays = run.state, run.contacts, run.method, run.knots, run.rows, run.times, run.samples, sizes
        return int(function(*(None if array is None else array.ctypes.data for array in arrays)))

    return take_on

"""A companion beside a member, step by step: how fast neighbouring motions part (Benettin et al. 1980).

It begins ``BESIDE`` of the clearance beside the member, goes through its own impacts, and is put back along
the same direction every few steps; the logarithms of what it was put back by are summed. It has all that
decides its steps from the member: so it takes the member's own but for what is of the size of the distance,
and errors of the method are common to both. Where one has touched or left a wall and the other has not,
nothing is done until both have.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact import types
from reference_solver.contact.loop import INNER
from reference_solver.tape import FloatArray, RecordArray

#: The distance at which a companion is put back, as a part of the clearance: far above round-off, which stiff
#: contacts amplify (with 1e-9 a settled motion seems chaotic, with 1e-6 all is as with this); after so
#: many steps.
BESIDE, EVERY = 1e-7, 16
#: A companion that could not be compared so many times is given up, and another one begun.
MISSED = 64

#: How a distance grows: from when on that counts, when it was compared last, for how long it was followed,
#: and the logarithm by which it grew then; how often in a row it could not be compared.
GROWTH_RECORD = types.record("from_s last_s followed_s total", "missed")


class Companion(NamedTuple):
    """The memory of a companion: of its run (see ``types.Run``); and whether there is one, 0 or 1.

    ``of_contacts`` (22 K,) are its contacts as numbers.
    """

    wanted: int
    contacts: RecordArray
    of_contacts: FloatArray
    gaps: RecordArray
    y: FloatArray
    control: RecordArray
    clock: RecordArray
    slopes: FloatArray
    events: RecordArray
    event_sums: FloatArray
    times: FloatArray
    samples: FloatArray


@register_jitable(**INNER)
def run_of(own, beside):
    """Return the companion's run, of the member's mechanism."""
    old = types.Motion(own.old.n, beside.y, beside.gaps)
    records = types.Records(beside.events, beside.event_sums, beside.times, beside.samples)
    return types.Run(
        own.kernel,
        own.p,
        own.method,
        beside.contacts,
        old,
        own.new,
        own.at,
        beside.slopes,
        beside.control,
        beside.clock,
        records,
        own.knots,
    )


@register_jitable(**INNER)
def begin(own, other, set_gaps, growth):
    """Begin beside a member where it is."""
    y, clearance = other.old.y, own.contacts[0].clearance
    for c in range(len(y)):
        y[c] = own.old.y[c]
    y[own.old.n - 3] += BESIDE * clearance
    for k in range(len(own.contacts)):
        other.contacts[k] = own.contacts[k]
    other.control[0], other.clock[0] = own.control[0], own.clock[0]
    for row in range(own.slopes.shape[0]):
        for c in range(own.slopes.shape[1]):
            other.slopes[row, c] = own.slopes[row, c]
    set_out(other, set_gaps)
    growth.last_s, growth.missed = own.clock[0].time, 0


@register_jitable(**INNER)
def step(advance_one, own, other, status):
    """Take a step; return how that ended."""
    now = other.clock[0]
    now.end = own.clock[0].end
    for _ in range(3):  # the log may be full, or an end be reached that is not the last
        if status != types.PAUSED:
            now.events, now.budget = 0, now.steps + 2
        status = advance_one(other)
        if status == types.PAUSED or status == types.FAILED:
            break
    return status


@register_jitable(**INNER)
def in_step(own, other):
    """Return whether a companion is where its member is: in its contacts, and in its step."""
    for k in range(len(own.contacts)):
        if own.contacts[k].phase != other.contacts[k].phase:
            return False
    now, then = own.clock[0], other.clock[0]
    return now.steps == then.steps and abs(then.time - now.time) < 1e-2 * now.tried


@register_jitable(**INNER)
def compared(own, other):
    """Move a companion to its member's time, by the slopes at both; return how far it is from it there.

    That is in the mechanism's own units.
    """
    n, y, control, slopes = own.old.n, other.old.y, own.control[0], other.slopes
    now, then, total = own.clock[0], other.clock[0], 0.0
    own.kernel.slopes(own.p, own.contacts, now.time, types.START, 1.0, own.old.y, slopes)
    other.kernel.slopes(other.p, other.contacts, then.time, types.END, 1.0, y, slopes)
    for c in range(len(y)):
        y[c] -= 0.5 * (then.time - now.time) * (slopes[types.START, c] + slopes[types.END, c])
    for c in range(2 * n):
        unit = (1.0 if c % 3 == 2 else control.length) * (1.0 if c < n else control.rate)
        total += ((y[c] - own.old.y[c]) / unit) ** 2
    return np.sqrt(total)


@register_jitable(**INNER)
def nearer(numbers, others, part):
    """Move numbers towards others, to a part of their distance."""
    for c in range(len(numbers)):
        if others[c] != numbers[c]:
            others[c] = numbers[c] + part * (others[c] - numbers[c])


@register_jitable(**INNER)
def put_back(own, other, of_contacts, beside, part, set_gaps):
    """Put a companion that has been moved to its member's time back to a part of its distance."""
    nearer(own.old.y, beside.y, part)
    nearer(of_contacts, beside.of_contacts, part)
    now, then = own.clock[0], other.clock[0]
    then.time, then.lost = now.time, now.lost
    set_out(other, set_gaps)


@register_jitable(**INNER)
def set_out(other, set_gaps):
    """Set what belongs to a companion's state."""
    t = other.clock[0].time
    set_gaps(other.p, other.contacts, t, other.old)
    other.kernel.slopes(other.p, other.contacts, t, types.START, 1.0, other.old.y, other.slopes)


@register_jitable(**INNER)
def follow(own, other, of_contacts, beside, growth, set_gaps):
    """Note how a distance has grown, and put the companion back, where both can be compared."""
    growth.missed += 1
    if not in_step(own, other):
        return
    size = BESIDE * own.contacts[0].clearance / own.control[0].length
    apart, time = compared(own, other), own.clock[0].time
    if growth.last_s >= growth.from_s:
        growth.total += np.log(apart / size)
        growth.followed_s += time - growth.last_s
    growth.last_s, growth.missed = time, 0
    put_back(own, other, of_contacts, beside, size / apart, set_gaps)

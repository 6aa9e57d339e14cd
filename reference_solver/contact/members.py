"""The loop over members: runs of one topology, each with its own numbers, start, end, steps and events.

Numba compiles this module as it stands. A member is advanced by the loop of a single run, called by address:
by the same machine code, so that it equals that run bit for bit. It is watched: after every step somebody
takes notes of it. No Python is called on the way, and no lock of it is held.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import from_dtype
from numba.extending import register_jitable
from numba.types import FunctionType, int64
from numba.types import NamedTuple as NumbaTuple

from reference_solver.contact import companion, controlled_step, loop, types
from reference_solver.contact.loop import ARRAY, CLOCK, CONTACTS, EVENTS, INNER, MOTION, TABLE
from reference_solver.tape import FloatArray, RecordArray

#: Modules whose functions and constants the machine code has taken over.
COMPILED_WITH = (types, loop, controlled_step, companion)
OPTIONS = {**loop.OPTIONS, "nogil": True}

#: Where a loop over members is: at which one, how its run's last call ended (``NEW`` before the first) and
#: when that began; how its companion's ended; how many of its ``ends`` it has reached, and touches are noted;
#: and after how many steps a single run's loop comes back.
PLACE_RECORD = types.record("began_s", "member status beside reached touches chunk")
NEW = -1
#: A contact up to the last step: its phase, the penetration and its rate, its impulse at the touch; and which
#: of the sums is the impulse.
PAST_RECORD = types.record("phase depth rate impulse", "sum")
#: Touches in a step, at the most, for each contact.
TOUCHES_AT_ONCE = 4


class Members(NamedTuple):
    """Runs in rows, m of one topology with K contacts: what they start from, and what is left of them.

    ``p`` (m, P), ``contacts`` and ``gaps`` (m, K), ``y`` (m, w), ``control`` and ``clock`` (m,), ``times``
    (m, s) and ``samples`` (m, s, W) and ``knots`` are as in ``types.Run``. ``weights`` (m, 2n) are those of
    error control, (m, 0) without. ``ends`` (m, l) are times on which steps land, the last one the run's.
    ``notes`` (m,) are the observer's, ``growth`` (m,) the companion's, to which ``of_contacts`` (m, 22 K) are
    the contacts as numbers. ``status`` (m,) says how each run ended.
    """

    p: FloatArray
    contacts: RecordArray
    gaps: RecordArray
    y: FloatArray
    control: RecordArray
    clock: RecordArray
    times: FloatArray
    samples: FloatArray
    knots: RecordArray
    weights: FloatArray
    ends: FloatArray
    notes: RecordArray
    growth: RecordArray
    of_contacts: FloatArray
    status: Any


class Watching(NamedTuple):
    """Who takes notes, with memory for them: past steps (K,), and what is noted of touches, one by one.

    ``observe`` (see ``observer_type``) returns how many touches have been noted.
    """

    observe: Any
    past: RecordArray
    touches: FloatArray


PLACES, PASTS = (from_dtype(dtype)[::1] for dtype in (PLACE_RECORD, PAST_RECORD))


def observer_type(notes: np.dtype[np.void]) -> FunctionType:
    """Return the type of observers with these notes.

    ``observe(notes, past, contacts, motion, clock, events, event_sums, first, touches, noted)`` gets a
    member's notes (1,), its state after a step, and the log of events, of which those from ``first`` on are
    of this step; or its state at the start, with ``first`` < 0. It returns how many of ``touches`` are
    ``noted``.
    """
    own = from_dtype(notes)[::1]
    return FunctionType(int64(own, PASTS, CONTACTS, MOTION, CLOCK, EVENTS, TABLE, int64, ARRAY, int64))


def advance_type(of_loop: Any, notes: np.dtype[np.void]) -> Any:
    """Return the signature of ``advance`` for a loop, a module, and an observer's notes."""
    single = of_loop.ADVANCE
    (run,) = single.args

    def rows(array: Any, ndim: int = 2) -> Any:
        return array.copy(ndim=ndim)

    of = dict(zip(types.Run._fields, run.types, strict=True))
    gaps, control, knots = of["old"].types[2], of["control"], of["knots"]
    records = (TABLE, rows(CONTACTS), rows(gaps), TABLE, control, CLOCK, TABLE, rows(ARRAY, 3), rows(knots))
    growth = from_dtype(companion.GROWTH_RECORD)[::1]
    others = (TABLE, TABLE, from_dtype(notes)[::1], growth, TABLE, int64[::1])
    members = NumbaTuple((*records, *others), Members)
    watching = NumbaTuple((observer_type(notes), PASTS, ARRAY), Watching)
    state = (CONTACTS, ARRAY, gaps, ARRAY, control, CLOCK, TABLE, EVENTS, TABLE, ARRAY, TABLE)
    beside = NumbaTuple((int64, *state), companion.Companion)
    by_address = FunctionType(single), loop.AT_STATE
    return int64(*by_address, run, members, watching, beside, PLACES, int64)


@register_jitable(**INNER)
def run_of(run, members, k):
    """Return the run of a member: its own rows, and the memory of ``run`` that all members share."""
    old = types.Motion(run.old.n, members.y[k], members.gaps[k])
    log = run.records
    records = types.Records(log.events, log.event_sums, members.times[k], members.samples[k])
    control, clock = members.control[k : k + 1], members.clock[k : k + 1]
    shared = (run.new, run.at, run.slopes)
    return types.Run(
        run.kernel,
        members.p[k],
        run.method,
        members.contacts[k],
        old,
        *shared,
        control,
        clock,
        records,
        members.knots[k],
    )


@register_jitable(**INNER)
def clear(run, weights):
    """Leave nothing of another member in the memory that all share."""
    for c in range(len(run.old.y)):
        run.new.y[c] = run.at.y[c] = 0.0
    for row in range(run.slopes.shape[0]):
        for c in range(run.slopes.shape[1]):
            run.slopes[row, c] = 0.0
    for c in range(len(weights)):
        run.slopes[controlled_step.WEIGHT, c] = weights[c]


@register_jitable(**INNER)
def set_going(run, here):
    """Prepare the call of a run's loop: it goes on after a pause, or begins as a single run's call does."""
    now = run.clock[0]
    if here.status != types.PAUSED:
        now.watched, now.events, here.began_s = 1, 0, now.time
        now.budget = now.steps + here.chunk


@register_jitable(**INNER)
def landed(now, here, ends):
    """Go on to the next end after one is reached; return whether there is none."""
    here.reached += 1
    if here.reached == len(ends):
        return True
    now.end = ends[here.reached]
    return False


@register_jitable(**INNER)
def observe(run, members, watching, here, first):
    """Have notes taken of a run."""
    notes, log = members.notes[here.member : here.member + 1], run.records
    here.touches = watching.observe(
        notes,
        watching.past,
        run.contacts,
        run.old,
        run.clock,
        log.events,
        log.event_sums,
        first,
        watching.touches,
        here.touches,
    )


@register_jitable(**INNER)
def accompany(advance_one, set_gaps, own, members, beside, here, first):
    """Take the companion's step beside the member's, or begin it anew; and note its distance."""
    k = here.member
    growth, other = members.growth[k], companion.run_of(own, beside)
    if here.beside == NEW or growth.missed >= companion.MISSED:
        companion.begin(own, other, set_gaps, growth)
        here.beside = here.status
        return
    before = beside.clock[0].events
    if here.beside != types.FAILED:
        here.beside = companion.step(advance_one, own, other, here.beside)
    quiet = own.clock[0].events == first and beside.clock[0].events == before
    if quiet and own.clock[0].steps % companion.EVERY == 0:
        companion.follow(own, other, members.of_contacts[k], beside, growth, set_gaps)


def advance(advance_one, set_gaps, run, members, watching, beside, place, most):
    """Advance members one after another from a place on; return how many steps were taken.

    It comes back where all are through, or, to be called again, after ``most`` steps and where there may be
    no room for touches. A run has ended as ``DONE``, or as ``FAILED`` for whatever reason.
    """
    here, taken = place[0], 0
    room = len(watching.touches) - TOUCHES_AT_ONCE * len(watching.past)
    while here.member < len(members.status):
        k = here.member
        own = run_of(run, members, k)
        now = own.clock[0]
        if here.status == NEW:
            clear(own, members.weights[k])
            set_gaps(own.p, own.contacts, now.time, own.old)
            observe(own, members, watching, here, -1)
            here.reached, here.beside = 0, NEW
        while True:
            set_going(own, here)
            first = now.events
            if beside.wanted and here.beside != NEW:  # round-off in what decides steps would tell them apart
                beside.control[0] = own.control[0]
            here.status = advance_one(own)
            if here.status == types.PAUSED:
                taken += 1
                observe(own, members, watching, here, first)
                if beside.wanted:
                    accompany(advance_one, set_gaps, own, members, beside, here, first)
                if here.touches > room or taken >= most:
                    return taken
            elif here.status == types.DONE:
                if landed(now, here, members.ends[k]):
                    break
            elif here.status == types.FAILED or now.time == here.began_s:
                here.status = types.FAILED
                break
        members.status[k] = here.status
        here.member, here.status = k + 1, NEW
    return taken

"""The loop of runs between rigid walls: that of contacts, with every event on a wall settled on the way."""

from numba.extending import register_jitable

from reference_solver.contact import adaptive_loop, loop, types
from reference_solver.contact.loop import INNER
from reference_solver.machine_code import OPTIONS, compiled
from reference_solver.rigid import settling

#: Events on rigid walls at one time, per contact: more than a few mean that they do not settle.
EVENTS_AT_ONCE = 20


@register_jitable(**INNER)
def bounce(advance, run, s):
    """Advance a run in place, as its loop does, and settle the events on rigid walls.

    Where it is to settle ``alone`` it comes back after that; else with SETTLE where other pins follow from
    now on, or the log is full, and with REFUSED where an event has no answer.
    """
    control, now, contacts = s.control[0], run.clock[0], run.contacts
    most, room = EVENTS_AT_ONCE * len(contacts), len(s.log) - settling.ROWS_OF_EVENT * len(s.walls.joints)
    if control.alone != 0:
        control.alone = 0
        return settling.settle(contacts, run.clock, run.old, s)
    if control.stale != 0:
        loop.set_gaps(run, now.time, types.OLD, run.old)
        control.stale = 0
    while control.logged < room:
        began = now.time
        status = advance(run)
        if status != types.SETTLE:
            return status
        control.settled, control.at_once = control.settled + 1, control.at_once + 1
        if now.time > began:
            control.at_once = 1
        if control.at_once > most:
            control.fault = settling.UNSETTLED
            return types.REFUSED
        status = settling.settle(contacts, run.clock, run.old, s)
        if status != types.GO:
            control.stale = 1
            return status
        loop.set_gaps(run, now.time, types.OLD, run.old)
    return types.SETTLE


@compiled(**OPTIONS)
def bounce_by_steps(parts, settling_parts):
    """Advance a run of RK4 (see ``bounce``)."""
    return bounce(loop.advance_by_events, types.run_of(parts), settling.settling_of(settling_parts))


@compiled(**OPTIONS)
def bounce_by_error(parts, settling_parts):
    """Advance a run with error control (see ``bounce``)."""
    return bounce(adaptive_loop.advance_by_events, types.run_of(parts), settling.settling_of(settling_parts))

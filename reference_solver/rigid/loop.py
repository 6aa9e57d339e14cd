"""The loop of runs between rigid walls: that of contacts, with every event on a wall settled on the way.

Numba compiles this module as it stands; the run's own loop and ``settling.settle`` are called by address.
"""

from typing import Any

from numba.types import FunctionType, int64

from reference_solver.contact import types
from reference_solver.contact.loop import OPTIONS
from reference_solver.rigid import settling
from reference_solver.rigid.settling import SETTLING

__all__ = ["COMPILED_WITH", "OPTIONS"]

#: Modules whose constants the machine code has taken over.
COMPILED_WITH = (types, settling)

#: Events on rigid walls at one time, per contact: more than a few mean that they do not settle.
EVENTS_AT_ONCE = 20


def bounce_type(advance: Any) -> Any:
    """Return the signature of ``bounce`` by that of a loop's ``advance``."""
    (run,) = advance.args
    return int64(FunctionType(advance), FunctionType(settling.SETTLE), run, SETTLING)


def bounce(advance, settle, run, s):
    """Advance a run in place, as its loop does, and settle the events on rigid walls.

    It comes back with SETTLE where other pins follow from now on, or the log is full; with REFUSED where an
    event has no answer.
    """
    control, now, contacts = s.control[0], run.clock[0], run.contacts
    most, room = EVENTS_AT_ONCE * len(contacts), len(s.log) - settling.ROWS_OF_EVENT * len(s.walls.joints)
    if control.stale != 0:
        run.kernel.gaps(run.p, contacts, now.time, run.old)
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
        status = settle(contacts, run.clock, run.old, s)
        if status != types.GO:
            control.stale = 1
            return status
        run.kernel.gaps(run.p, contacts, now.time, run.old)
    return types.SETTLE

"""The loop of error control without contacts, where no event ends a step.

Numba compiles this module as it stands, as it does ``contact.adaptive_loop``, whose steps these are: in less
than half of the time, since nothing is in it that looks for events.
"""

from reference_solver import methods
from reference_solver.contact import adaptive_loop, loop, types
from reference_solver.contact.adaptive_loop import ADVANCE, KERNEL, ROWS, Course, Kernel
from reference_solver.contact.loop import OPTIONS
from reference_solver.contact.types import FAILED, GO, PAUSED, RESUMED

__all__ = ["ADVANCE", "COMPILED_WITH", "KERNEL", "OPTIONS", "ROWS", "Kernel", "advance"]

#: Modules whose functions and constants the machine code has taken over.
COMPILED_WITH = (types, loop, methods, adaptive_loop)


def advance(run):
    """Advance the motion in place, as ``contact.loop.advance`` does, with error control."""
    now, control = run.clock[0], run.control[0]
    status = GO if now.watched == RESUMED else adaptive_loop.set_out(run)
    while status == GO:
        if not loop.write_due(run):
            return FAILED
        status = loop.due(now, len(run.records.events))
        if status != GO:
            return status
        h = loop.to_knot(run, min(control.step, now.longest), 1.0)
        step = adaptive_loop.no_further(now, Course(now.time, 0.0, 0.0), h)
        error, factor = adaptive_loop.tried(run, step)
        if not error <= 1.0:
            status = adaptive_loop.again(control, now.time, step.H * factor)
            continue
        now.steps += 1
        if not adaptive_loop.within(run, step):
            return FAILED
        adaptive_loop.accept(run, step, -1, error, factor)
        if now.watched:
            return PAUSED
    return status

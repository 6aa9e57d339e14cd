"""The loop of error control without contacts, where no event ends a step.

Numba compiles this module as it stands, as it does ``adaptive_loop``, in less than half of the time: nothing
is in it that looks for events.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable
from numba.types import NamedTuple as NumbaTuple

from reference_solver import methods
from reference_solver.contact import controlled_step, loop, types
from reference_solver.contact.controlled_step import ROWS, Course
from reference_solver.contact.loop import ARRIVE, FORCES, OPTIONS, SLOPES
from reference_solver.contact.types import FAILED, GO

__all__ = ["ADVANCE", "COMPILED_WITH", "KERNEL", "OPTIONS", "ROWS", "Kernel", "advance"]

#: Modules whose functions and constants the machine code has taken over.
COMPILED_WITH = (types, loop, methods, controlled_step)


class Kernel(NamedTuple):
    """The functions of a mechanism, compiled or readable (see ``kernel`` and ``faces``)."""

    slopes: object
    forces: object
    arrive: object


KERNEL = NumbaTuple((SLOPES, FORCES, ARRIVE), Kernel)
ADVANCE = loop.advance_type(KERNEL)


@register_jitable(**loop.INNER)
def tried(run, step):
    """Take a step; return its error over the tolerance, infinite where its end is none."""
    error = controlled_step.trial(run, step.course, step.H)
    return error if not error <= 1.0 or controlled_step.finish(run, step.end) else np.inf


def advance(run):
    """Advance the motion in place, as ``contact.loop.advance`` does, with error control."""
    now, control = run.clock[0], run.control[0]
    status = GO if now.resumed else controlled_step.set_out(run)
    while status == GO:
        if not loop.write_due(run):
            return FAILED
        status = loop.due(now, len(run.records.events))
        if status != GO:
            return status
        h = loop.to_knot(run, min(control.step, now.longest), 1.0, 0.0)
        step = controlled_step.no_further(now, Course(now.time, 0.0, 0.0), h)
        error = tried(run, step)
        for _ in range(loop.LANDINGS):
            landed = controlled_step.to_kink(run, step)
            if landed.H == step.H or not error <= 1.0:
                break
            step, error = landed, tried(run, landed)
        next_h = step.H * controlled_step.changed(error, control, run.method.exponent)
        if not error <= 1.0:
            status = controlled_step.again(control, now.time, next_h)
            continue
        now.steps += 1
        if not controlled_step.within(run, step):
            return FAILED
        controlled_step.move_on(run, step.end, error)
        if now.time < now.end:
            control.step = next_h
    return status

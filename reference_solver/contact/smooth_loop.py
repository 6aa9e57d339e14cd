"""The loop of error control without contacts, where no event ends a step.

Numba compiles this module as it stands, as it does ``adaptive_loop``, in less than half of the time: nothing
is in it that looks for events.
"""

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact import controlled_step, loop
from reference_solver.contact.controlled_step import Course
from reference_solver.contact.types import FAILED, GO, run_of
from reference_solver.machine_code import OPTIONS, compiled


@register_jitable(**loop.INNER)
def tried(run, step):
    """Take a step; return its error over the tolerance, infinite where its end is none."""
    error = controlled_step.trial(run, step.course, step.H)
    return error if not error <= 1.0 or controlled_step.finish(run, step.end) else np.inf


@compiled(**OPTIONS)
def advance(parts):
    """Advance the motion in place, as ``contact.loop.advance`` does, with error control."""
    run = run_of(parts)
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

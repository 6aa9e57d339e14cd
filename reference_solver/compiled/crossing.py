"""Equal steps past singular positions, where a stage that comes too near to one is amplified.

The motion itself is smooth there, but a stage is off the constraints by an error e of its own, and at a
distance d from a singular position {q''} is in error by e/d; a step that ends there is projected with an
error of round-off/d^2. So where a step's stages get too near (see ``methods.Step``), it and some after it are
taken together in unequal parts, whose stages stay clear. Two such splittings have to agree.
"""

from itertools import combinations, product

import numpy as np

from reference_solver.contact import loop
from reference_solver.contact.types import Run
from reference_solver.tape import FloatArray

#: Steps that are taken together, as many as it needs: longer ones have their stages further apart, which
#: counts where round-off does; and the pieces of a part, shorter ones, where the method's error does.
TOGETHER, PIECES = (1, 2, 4, 8, 16), (1, 3)
#: Ways to split a length. No stage is in its middle: the nearest is an eighth, or a sixth away.
SPLITTINGS = (3 / 8, 1 / 2, 1 / 8), (1 / 8, 1 / 2, 3 / 8), (1 / 3, 2 / 3), (2 / 3, 1 / 3)
#: Splittings may differ by so much beside the error of a step of order 4, as a part of the mechanism's length
#: and of a radian: round-off, amplified.
AMPLIFIED = 1e-9


def crossed(run: Run, h: float) -> int:
    """Take so many of the equal steps h together, past a singular position; return how many, 0 for failure.

    The motion is moved on, and samples within are interpolated, by a run's records with fields.
    """
    length, rate = run.control[0].length, run.control[0].rate
    weight = np.tile([1 / length, 1 / length, 1.0], run.old.n // 3)
    weight, turned = np.concatenate([weight, weight / rate]), rate * h
    best, end, together = turned**4 + AMPLIFIED, None, 0
    for steps in TOGETHER:
        ways = product(SPLITTINGS, PIECES)
        ends = [split(run, h, steps, parts, pieces) for parts, pieces in ways]
        for one, other in combinations(ends, 2):
            apart = np.abs(weight * (one - other)[: len(weight)]).max()
            if apart < best:
                best, end, together = apart, one, steps
        if best < turned**5:
            break
    if end is None:
        return 0
    sums = slice(2 * run.old.n, None)
    run.new.y[:] = end
    run.new.y[sums] -= run.old.y[sums]
    if not loop.within(run, together * h):
        return 0
    run.old.y[:] = end
    return together


def split(run: Run, h: float, steps: int, parts: tuple[float, ...], pieces: int) -> FloatArray:
    """Return y after so many steps of h, taken in parts of so many pieces; NaN on failure.

    It is one, too, if the step after it would fail: its end is too near.
    """
    t, y, advance = run.clock[0].time, run.old.y.copy(), run.kernel.advance
    for part in parts:
        piece = part * steps * h / pieces
        if advance(run.p, y, piece, t / piece, pieces)[0] < pieces:
            return np.full_like(y, np.nan)
        t += part * steps * h
    return y if advance(run.p, y.copy(), h, t / h, 1)[0] else np.full_like(y, np.nan)

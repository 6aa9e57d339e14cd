"""Equal steps past singular positions, where a stage that comes too near to one is amplified.

The motion itself is smooth there, but a stage is off the constraints by an error e of its own, and at a
distance d from a singular position {q''} is in error by e/d; a step that ends there is projected with an
error of round-off/d^2. So where a step's stages get too near (see ``methods.Step``), it and some after it are
taken together in unequal parts, whose stages stay clear. Two such splittings have to agree.
"""

from itertools import combinations, product

import numpy as np

from reference_solver.contact.loop import write_within
from reference_solver.contact.types import NEW, OLD, Run, plain
from reference_solver.kernel import Kernel
from reference_solver.tape import FloatArray

#: Steps that are taken together, as many as it needs: longer ones have their stages further apart, which
#: counts where round-off does; and the pieces of a part, shorter ones, where the method's error does.
TOGETHER, PIECES = (1, 2, 4, 8, 16), (1, 3)
#: Ways to split a length. No stage is in its middle: the nearest is an eighth, or a sixth away.
SPLITTINGS = (3 / 8, 1 / 2, 1 / 8), (1 / 8, 1 / 2, 3 / 8), (1 / 3, 2 / 3), (2 / 3, 1 / 3)
#: Splittings may differ by so much beside the error of a step of order 4, as a part of the mechanism's length
#: and of a radian: round-off, amplified.
AMPLIFIED = 1e-9


def crossed(kernel: Kernel, run: Run, h: float) -> bool:
    """Take some of the equal steps h together, past a singular position, if that can be done.

    The run is moved on, and samples within are interpolated.
    """
    (now,), (control,), (n, y, _) = run.clock, run.control, run.old
    weight = np.tile([1 / control["length"], 1 / control["length"], 1.0], n // 3)
    weight, turned = np.concatenate([weight, weight / control["rate"]]), control["rate"] * h
    best, end, together = turned**4 + AMPLIFIED, None, 0
    for steps in TOGETHER:
        ways = product(SPLITTINGS, PIECES)
        ends = [split(kernel, run, h, steps, parts, pieces) for parts, pieces in ways]
        for one, other in combinations(ends, 2):
            apart = np.abs(weight * (one - other)[: len(weight)]).max()
            if apart < best:
                best, end, together = apart, one, steps
        if best < turned**5:
            break
    if end is None:
        return False
    run.slopes[NEW] = end
    run.slopes[NEW, 2 * n : len(y)] -= y[2 * n :]
    if not write_within(plain(run), together * h):
        return False
    run.slopes[OLD] = end
    now["steps"] += together
    return True


def split(
    kernel: Kernel, run: Run, h: float, steps: int, parts: tuple[float, ...], pieces: int
) -> FloatArray:
    """Return the state after so many steps of h, taken in parts of so many pieces; NaN on failure.

    It is one, too, if the step after it would fail: its end is too near.
    """
    t, state = float(run.clock["time"][0]), run.slopes[OLD].copy()
    for part in parts:
        piece = part * steps * h / pieces
        for _ in range(pieces):
            state = stepped(kernel, run, state, t, piece)
            t += piece
    return np.asarray(state + 0.0 * stepped(kernel, run, state, t, h))


def stepped(kernel: Kernel, run: Run, state: FloatArray, t: float, h: float) -> FloatArray:
    """Return the state after a step, NaN on failure."""
    (now,), sums = run.clock, slice(2 * run.old.n, len(run.old.y))
    new: FloatArray = state.copy()
    state[now["place_of_h"]] = h
    condition = kernel["step"](kernel.p, int(now["contacts"]), t, state, new)
    new[sums] += state[sums]
    if not condition < np.inf:
        new[:] = np.nan
    return new

"""The kernel of a set of following joints: an RK4 step with its sums, the gaps, and ``rigid_loop``."""

import inspect
import re
from functools import cache

from reference_solver import rigid_loop
from reference_solver.kernel import ENTRY, INNER, Kernel, Topology
from reference_solver.points import State
from reference_solver.rigid_friction import FollowingEquations


@cache
def rigid_source_of(topology: Topology) -> str:
    """Return a module with ``step``, ``gaps``, ``multipliers``, and ``until_alarm`` of ``rigid_loop``."""
    kernel = Kernel(topology)
    kernel.answer()
    kernel.projections()
    _step(kernel)
    _gaps(kernel)
    kernel.multipliers()
    text = inspect.getsource(rigid_loop)
    text = text[text.index("\n\n\ndef ") :]
    text = re.sub(r"^    (step|gaps|multipliers): Function,\n", "", text, flags=re.MULTILINE)
    return (
        "from __future__ import annotations\n\nimport numpy as np\n"
        + kernel.source()
        + compiled(text, "until_alarm")
    )


def _step(kernel: Kernel) -> None:
    """Write ``step(p, t, h, q, v, sums)``: an RK4 step in place, its sums added; False on failure."""
    tape, _, q, v = kernel.begin()
    step = kernel.step(tape, tape.input("t"), q, v, tape.input("h"))
    stores = [(f"q[{c}]", x) for c, x in enumerate(step.q)] + [(f"v[{c}]", x) for c, x in enumerate(step.v)]
    stores += [(f"sums[{k}]", tape.input(f"sums[{k}]") + x) for k, x in enumerate(step.sums.values())]
    kernel.add("step", ["p", "t", "h", "q", "v", "sums"], tape, [step.ok], stores)


def _gaps(kernel: Kernel) -> None:
    """Write ``gaps(p, q, v, out)``: g = (d.d - c^2)/2 in m^2 and its rate of every joint, (J, 2)."""
    tape, equations, q, v = kernel.begin()
    assert isinstance(equations, FollowingEquations)
    stores, state = [], State(q, v)
    for k, joint in enumerate(equations.joints):
        i, j = state.point(joint.body_i, joint.point_i), state.point(joint.body_j, joint.point_j)
        d, d_dot, c = j.place - i.place, j.rate - i.rate, joint.radial_clearance_m
        stores += [(f"out[{k}, 0]", 0.5 * (d @ d - c * c)), (f"out[{k}, 1]", d @ d_dot)]
    kernel.add("gaps", ["p", "q", "v", "out"], tape, [True], stores)


def compiled(text: str, entry: str) -> str:
    """Return the text of functions, each compiled, with ``entry`` for Python to call."""
    text = text.replace("\ndef ", f"\n@njit({INNER})\ndef ")
    return text.replace(f"\n@njit({INNER})\ndef {entry}(", f"\n@njit({ENTRY})\ndef {entry}(")

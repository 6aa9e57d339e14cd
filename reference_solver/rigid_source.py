"""The kernel of a set of following joints: an RK4 step with its sums, the gaps, and ``rigid_loop``."""

import inspect
import re

from reference_solver import rigid_loop
from reference_solver.kernel_source import (
    HEADER,
    INLINE,
    INNER,
    call,
    compiled,
    drivers_power,
    function,
    mean,
    names,
    rk4_lines,
)
from reference_solver.rigid_friction import RK4_DAMPER_LIMIT
from reference_solver.rigid_friction_source import FollowingWriter
from reference_solver.straight_line import StraightLine


def rigid_kernel_source(writer: FollowingWriter) -> str:
    """Return a module with ``step``, ``gaps``, ``multipliers``, and ``until_alarm`` of ``rigid_loop``.

    ``writer.parameters`` is complete afterwards.
    """
    q, v = names("q", writer.n), names("v", writer.n)
    code, accelerations, lambda_, ok = writer.accelerations(None)
    results = [*accelerations, *lambda_, *writer.rates, ok]
    functions = [function("accelerations", ["p", "t", *q, *v], code.lines, results, INLINE)]
    for of in ("q", "v"):
        code, moved, ok = writer.projection(of)
        arguments = ["p", "t", *q, *(v if of == "v" else [])]
        functions.append(function(f"project_{of}", arguments, code.lines, [*moved, ok], INLINE))
    functions += [_step(writer), _gaps(writer), _multipliers(writer)]
    text = inspect.getsource(rigid_loop)
    text = text[text.index("\n\n\ndef ") :]
    text = re.sub(r"^    (step|gaps|multipliers): Function,\n", "", text, flags=re.MULTILINE)
    text = compiled(text, "until_alarm")
    header = "from __future__ import annotations\n\nimport numpy as np\n"
    if writer.rates:
        header += "from math import copysign, tanh\n"
    return "\n\n".join([header + HEADER, *functions]) + f"\n{text}"


def _unpack(writer: FollowingWriter) -> list[str]:
    return [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]


def _step(writer: FollowingWriter) -> str:
    """Write ``step(p, t, h, q, v, sums)``: an RK4 step in place, its sums added; False on failure."""
    joints = len(writer.joints)
    lines, ok = rk4_lines(writer, ["p"], writer.rates, True)
    if writer.rates:
        ok += "".join(f" and h*damping_{stage} <= {RK4_DAMPER_LIMIT}" for stage in (1, 2, 3, 4))
    lines = [*_unpack(writer), *lines, f"if not ({ok}):", "    return False"]
    for name, to in (("q", "x"), ("v", "y")):
        lines += [f"{name}[{c}] = {to}{c}" for c in range(writer.n)]
    if power := drivers_power(writer):
        lines.append(f"sums[0] += {power}")
    for k in writer.following:
        row = writer.row_of(k)
        clearance = writer.parameter(f"clearance {k}", writer.joints[k].radial_clearance_m)
        lines.append(f"sums[{1 + k}] -= {clearance}*{mean(f'lambda{row}')}")
        if writer.joints[k].friction is not None:
            lines.append(f"sums[{1 + joints + k}] += {mean(f'lost{row}')}")
    return function("step", ["p", "t", "h", "q", "v", "sums"], lines, ["True"])


def _gaps(writer: FollowingWriter) -> str:
    """Write ``gaps(p, q, v, out)``: g in m^2 and its rate of every joint, (J, 2)."""
    code, out = StraightLine(), []
    for k, joint in enumerate(writer.joints):
        ends = ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j))
        _, (x, y), (rate_x, rate_y) = writer.between(code, f"n{k}", ends)
        c = writer.parameter(f"clearance {k}", joint.radial_clearance_m)
        out.append(f"out[{k}, 0] = 0.5*({x}*{x} + {y}*{y} - {c}*{c})")
        out.append(f"out[{k}, 1] = {x}*({rate_x}) + {y}*({rate_y})")
    return function("gaps", ["p", "q", "v", "out"], [*_unpack(writer), *code.lines, *out], ["True"], INNER)


def _multipliers(writer: FollowingWriter) -> str:
    """Write ``multipliers(p, t, q, v, out)``: {lambda} at a state into ``out``; returns whether it could."""
    lambda_, state = names("lambda", writer.m), [*names("q", writer.n), *names("v", writer.n)]
    results = [*names("a", writer.n), *lambda_, *writer.rates, "ok"]
    lines = [*_unpack(writer), call(results, "accelerations", ["p", "t", *state])]
    lines += [f"out[{r}] = {name}" for r, name in enumerate(lambda_)]
    return function("multipliers", ["p", "t", "q", "v", "out"], lines, ["ok"], INNER)

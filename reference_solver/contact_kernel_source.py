"""The source of a compiled kernel with contacts: an RK4 step, the gaps, the text of ``contact_loop``."""

import inspect
import re

from reference_solver import contact_events, contact_loop
from reference_solver.contact_events import CLIPPED, CONTACT, FLIGHT, PROBE
from reference_solver.contact_source import gap_acceleration_lines, gap_lines, losses
from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.kernel_source import HEADER, call, function, names
from reference_solver.straight_line import ZERO, StraightLine, product, total

CONTACT_HEADER = (
    "from __future__ import annotations\n\nfrom math import copysign, tanh\n\nimport numpy as np\n"
)
PHASES = f"FLIGHT, CONTACT, CLIPPED, PROBE = {FLIGHT}, {CONTACT}, {CLIPPED}, {PROBE}"


def contact_kernel_source(writer: EquationsWriter, baumgarte: Baumgarte | None, projected: bool) -> str:
    """Return a module with ``advance`` of ``contact_loop`` for the writer's topology.

    ``writer.parameters`` is complete afterwards.
    """
    q, v = names("q", writer.n), names("v", writer.n)
    code, accelerations, lambda_, ok = writer.accelerations(baumgarte)
    results = [*accelerations, *lambda_, *all_losses(writer), ok]
    functions = [function("accelerations", ["p", "s", "t", *q, *v], code.lines, results, inline=True)]
    if projected:
        for of in ("q", "v"):
            code, moved, ok = writer.projection(of)
            arguments = ["p", "t", *q, *(v if of == "v" else [])]
            functions.append(function(f"project_{of}", arguments, code.lines, [*moved, ok], inline=True))
    functions += [_step(writer, projected), _gaps(writer), _gap_accelerations(writer), _multipliers(writer)]
    return "\n\n".join([CONTACT_HEADER + HEADER, *functions, _driver()]) + "\n"


def all_losses(writer: EquationsWriter) -> list[str]:
    """Return the names of the contacts' losses, in the order of the work array behind the drivers' work."""
    return [name for k, joint in enumerate(writer.mechanism.contacts) for name in losses(k, joint)]


def _driver() -> str:
    """Return the text of the driver with the module's own functions in place of its parameters."""
    texts = []
    for module in (contact_events, contact_loop):
        source = inspect.getsource(module)
        texts.append(source[source.index("\n\n\ndef ") :])
    text = re.sub(r"^    (step|gaps|gap_accelerations): Function,\n", "", "".join(texts), flags=re.MULTILINE)
    text = re.sub(r"\b(step|gaps|gap_accelerations), ", "", text)
    return PHASES + text.replace("\ndef ", "\n@njit(**OPTIONS)\ndef ")


def _unpack(writer: EquationsWriter) -> list[str]:
    return [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]


def _step(writer: EquationsWriter, projected: bool) -> str:
    """Write ``step(p, s, q, v, t, h, new_q, new_v, work)``: an RK4 step and its losses; False on failure."""
    n, m, loss = range(writer.n), writer.m, all_losses(writer)
    lines = _unpack(writer)
    start_q, start_v = names("q", writer.n), names("v", writer.n)
    stages = ((1, "", "t"), (2, "0.5*h", "t + 0.5*h"), (3, "0.5*h", "t + 0.5*h"), (4, "h", "t + h"))
    for stage, fraction, time in stages:
        if stage > 1:
            lines += [f"x{c} = q{c} + {fraction}*{start_v[c]}" for c in n]
            lines += [f"y{stage}_{c} = v{c} + {fraction}*a{stage - 1}_{c}" for c in n]
            start_q, start_v = names("x", writer.n), names(f"y{stage}_", writer.n)
        results = [f"a{stage}_{c}" for c in n] + names(f"m{stage}_", m)
        results += [f"{name}_{stage}" for name in loss] + [f"ok{stage}"]
        lines.append(call(results, "accelerations", ["p", "s", time, *start_q, *start_v]))
    lines += [f"x{c} = q{c} + h/6.0*(v{c} + 2.0*(y2_{c} + y3_{c}) + y4_{c})" for c in n]
    lines += [f"y{c} = v{c} + h/6.0*(a1_{c} + 2.0*(a2_{c} + a3_{c}) + a4_{c})" for c in n]
    ok = "ok1 and ok2 and ok3 and ok4"
    if projected:
        x, y = names("x", writer.n), names("y", writer.n)
        lines.append(call([*x, "ok5"], "project_q", ["p", "t + h", *x]))
        lines.append(call([*y, "ok6"], "project_v", ["p", "t + h", *x, *y]))
        ok += " and ok5 and ok6"
    mean = "h/6.0*({0}1{1} + 2.0*({0}2{1} + {0}3{1}) + {0}4{1})"
    rows = enumerate(writer.rows(StraightLine()))
    power = total(product(row.C, mean.format("m", f"_{r}")) for r, row in rows if row.C != ZERO)
    lines.append(f"work[0] = {power}")
    lines += [f"work[{k}] = {mean.format(f'{name}_', '')}" for k, name in enumerate(loss, 1)]
    lines += [f"new_q[{c}], new_v[{c}] = x{c}, y{c}" for c in n]
    arguments = ["p", "s", "q", "v", "t", "h", "new_q", "new_v", "work"]
    return function("step", arguments, lines, [ok])


def _gaps(writer: EquationsWriter) -> str:
    lines = _unpack(writer)
    for k, joint in enumerate(writer.mechanism.contacts):
        lines += gap_lines(writer, k, joint)
    return function("gaps", ["p", "q", "v", "out"], lines, ["True"])


def _gap_accelerations(writer: EquationsWriter) -> str:
    lines = [*_unpack(writer), _accelerations(writer)]
    for k, joint in enumerate(writer.mechanism.contacts):
        lines += gap_acceleration_lines(writer, k, joint)
    return function("gap_accelerations", ["p", "s", "t", "q", "v", "out"], lines, ["ok"])


def _multipliers(writer: EquationsWriter) -> str:
    lines = [*_unpack(writer), _accelerations(writer), *(f"out[{r}] = lambda{r}" for r in range(writer.m))]
    return function("multipliers", ["p", "s", "t", "q", "v", "out"], lines, ["ok"])


def _accelerations(writer: EquationsWriter) -> str:
    results = [*names("a", writer.n), *names("lambda", writer.m), *all_losses(writer), "ok"]
    return call(results, "accelerations", ["p", "s", "t", *names("q", writer.n), *names("v", writer.n)])

"""The source of a compiled kernel with contacts: an RK4 step, the gaps, the text of ``contact_loop``."""

import inspect
import re

from reference_solver import contact_events, contact_loop
from reference_solver.contact_events import CLIPPED, CONTACT, FLIGHT, PROBE
from reference_solver.contact_source import gap_acceleration_lines, gap_lines, rates
from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.kernel_source import HEADER, call, drivers_power, function, mean, names, rk4_lines
from reference_solver.straight_line import ZERO

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
    results = [*accelerations, *lambda_, *all_rates(writer), ok]
    functions = [function("accelerations", ["p", "s", "t", *q, *v], code.lines, results, inline=True)]
    if projected:
        for of in ("q", "v"):
            code, moved, ok = writer.projection(of)
            arguments = ["p", "t", *q, *(v if of == "v" else [])]
            functions.append(function(f"project_{of}", arguments, code.lines, [*moved, ok], inline=True))
    functions += [_step(writer, projected), _gaps(writer), _gap_accelerations(writer), _multipliers(writer)]
    return "\n\n".join([CONTACT_HEADER + HEADER, *functions, _driver()]) + "\n"


def all_rates(writer: EquationsWriter) -> list[str]:
    """Return the names of the contacts' rates, in the order of the work array behind the drivers' work."""
    return [name for k, joint in enumerate(writer.mechanism.contacts) for name in rates(k, joint)]


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
    """Write ``step(p, s, q, v, t, h, new_q, new_v, work)``: an RK4 step and its sums; False on failure."""
    n, added = range(writer.n), all_rates(writer)
    step, ok = rk4_lines(writer, ["p", "s"], added, projected)
    lines = [*_unpack(writer), *step, f"work[0] = {drivers_power(writer) or ZERO}"]
    lines += [f"work[{k}] = {mean(name)}" for k, name in enumerate(added, 1)]
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
    results = [*names("a", writer.n), *names("lambda", writer.m), *all_rates(writer), "ok"]
    return call(results, "accelerations", ["p", "s", "t", *names("q", writer.n), *names("v", writer.n)])

"""The source of a compiled kernel with contacts: what ``contact_driver`` calls, for one topology."""

from reference_solver.contact_source import gap_acceleration_lines, gap_lines, rates
from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.kernel_source import (
    HEADER,
    INLINE,
    call,
    drivers_power,
    function,
    mean,
    names,
    projections,
    removing,
    rk4_lines,
    stabilisation_loss,
)
from reference_solver.straight_line import ZERO

CONTACT_HEADER = HEADER + "\nfrom math import copysign, tanh\n"


def contact_kernel_source(writer: EquationsWriter, baumgarte: Baumgarte | None, projected: bool) -> str:
    """Return a module with ``step``, ``gaps``, ``gap_accelerations`` and ``slopes`` for a topology.

    ``writer.parameters`` is complete afterwards.
    """
    q, v = names("q", writer.n), names("v", writer.n)
    code, accelerations, lambda_, ok = writer.accelerations(baumgarte)
    rates = [*all_rates(writer), *removing(baumgarte)]
    results = [*accelerations, *lambda_, *rates, ok]
    functions = [function("accelerations", ["p", "s", "t", *q, *v], code.lines, results, INLINE)]
    if projected:
        functions += projections(writer, ["p", "s"])
    functions += [
        _gaps(writer),
        _step(writer, rates, projected),
        _gap_accelerations(writer, rates),
        _slopes(writer, rates, projected),
    ]
    return "\n\n".join([CONTACT_HEADER, *functions]) + "\n"


def all_rates(writer: EquationsWriter) -> list[str]:
    """Return the names of the contacts' rates, in the order of the work array behind the drivers' work."""
    return [name for k, joint in enumerate(writer.mechanism.contacts) for name in rates(k, joint)]


def _unpack(writer: EquationsWriter) -> list[str]:
    return [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]


def _step(writer: EquationsWriter, rates: list[str], projected: bool) -> str:
    """Write ``step(p, s, q, v, t, h, new_q, new_v, work, gap)``: an RK4 step, its sums, the new gaps.

    It returns False on failure. The sums are the drivers' work, those of ``all_rates``, and with a
    stabilisation the energy it removes.
    """
    n, contacts = range(writer.n), all_rates(writer)
    step, ok = rk4_lines(writer, ["p", "s"], rates, projected, ledger=True)
    lines = [*_unpack(writer), *step, f"work[0] = {drivers_power(writer) or ZERO}"]
    lines += [f"work[{k}] = {mean(name)}" for k, name in enumerate(contacts, 1)]
    if removed := stabilisation_loss(rates, projected):
        lines.append(f"work[{1 + len(contacts)}] = {removed}")
    lines += [f"new_q[{c}], new_v[{c}] = x{c}, y{c}" for c in n]
    lines.append("gaps(p, new_q, new_v, gap)")
    arguments = ["p", "s", "q", "v", "t", "h", "new_q", "new_v", "work", "gap"]
    return function("step", arguments, lines, [ok])


def _gaps(writer: EquationsWriter) -> str:
    lines = _unpack(writer)
    for k, joint in enumerate(writer.mechanism.contacts):
        lines += gap_lines(writer, k, joint)
    return function("gaps", ["p", "q", "v", "out"], lines, ["True"])


def _gap_accelerations(writer: EquationsWriter, rates: list[str]) -> str:
    lines = [*_unpack(writer), _accelerations(writer, rates)]
    for k, joint in enumerate(writer.mechanism.contacts):
        lines += gap_acceleration_lines(writer, k, joint)
    return function("gap_accelerations", ["p", "s", "t", "q", "v", "out"], lines, ["ok"])


def _slopes(writer: EquationsWriter, rates: list[str], projected: bool) -> str:
    """Write ``slopes(p, s, t, q, v, a, rate, multipliers)``: {q''}, the sums' rates and {lambda} at a state.

    A projection acts between steps: the rate of what it removes is zero.
    """
    lines = [*_unpack(writer), _accelerations(writer, rates)]
    lines += [f"a[{c}] = a{c}" for c in range(writer.n)]
    sums = [drivers_power(writer, str) or ZERO, *rates, *([ZERO] if projected else [])]
    lines += [f"rate[{k}] = {name}" for k, name in enumerate(sums)]
    lines += [f"multipliers[{r}] = lambda{r}" for r in range(writer.m)]
    arguments = ["p", "s", "t", "q", "v", "a", "rate", "multipliers"]
    return function("slopes", arguments, lines, ["ok"])


def _accelerations(writer: EquationsWriter, rates: list[str]) -> str:
    results = [*names("a", writer.n), *names("lambda", writer.m), *rates, "ok"]
    return call(results, "accelerations", ["p", "s", "t", *names("q", writer.n), *names("v", writer.n)])

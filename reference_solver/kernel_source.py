"""The source of a compiled kernel: RK4 around the straight-line equations, in functions that Python calls."""

from collections.abc import Callable

from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.straight_line import ZERO, StraightLine, product

HEADER = '''"""Generated from a mechanism's topology by reference_solver.generator."""

from math import cos, sin, sqrt

from reference_solver.kernel_store import njit

OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}
INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
ENTRY = {**OPTIONS, "cache": True}
'''
#: The header's options of what Python calls, kept on disk, and of what only compiled functions call.
ENTRY, INNER, INLINE = "**ENTRY", "**INNER", "**INNER, forceinline=True"


def kernel_source(writer: EquationsWriter, baumgarte: Baumgarte | None, projected: bool) -> str:
    """Return a module with ``advance`` and ``multipliers`` for the writer's topology (see ``kernel``).

    ``writer.parameters`` is complete afterwards.
    """
    q, v = names("q", writer.n), names("v", writer.n)
    code, accelerations, lambda_, ok = writer.accelerations(baumgarte)
    rates = removing(baumgarte)
    results = [*accelerations, *lambda_, *rates, ok]
    functions = [function("accelerations", ["p", "t", *q, *v], code.lines, results, INLINE)]
    if projected:
        functions += projections(writer, ["p"])
    functions.append(_advance(writer, rates, projected))
    functions.append(_multipliers(writer, rates))
    return "\n\n".join([HEADER, *functions]) + "\n"


def projections(writer: EquationsWriter, inputs: list[str]) -> list[str]:
    """Return ``project_q`` and ``project_v``: their results are the new q or v, energy removed, success."""
    functions = []
    for of, state in (("q", "q"), ("v", "qv")):
        code, results, ok = writer.projection(of, ledger=True)
        arguments = [*inputs, "t", *(name for letter in state for name in names(letter, writer.n))]
        functions.append(function(f"project_{of}", arguments, code.lines, [*results, ok], INLINE))
    return functions


def removing(baumgarte: Baumgarte | None) -> list[str]:
    """Return the name of the power that Baumgarte's feedback takes away, if there is any."""
    return [] if baumgarte is None else ["removing"]


def names(letter: str, count: int) -> list[str]:
    """Return letter0, letter1, ..."""
    return [f"{letter}{k}" for k in range(count)]


def function(
    name: str, arguments: list[str], lines: list[str], results: list[str], options: str = ENTRY
) -> str:
    """Return a compiled function's text."""
    body = [*lines, f"return {', '.join(results)}"]
    return "\n    ".join([f"@njit({options})\ndef {name}({', '.join(arguments)}):", *body])


def compiled(text: str, entry: str) -> str:
    """Return the text of functions, each compiled, with ``entry`` for Python to call."""
    text = text.replace("\ndef ", f"\n@njit({INNER})\ndef ")
    return text.replace(f"\n@njit({INNER})\ndef {entry}(", f"\n@njit({ENTRY})\ndef {entry}(")


def call(results: list[str], called: str, arguments: list[str]) -> str:
    """Return the line that calls a function and names its results."""
    return f"{', '.join(results)} = {called}({', '.join(arguments)})"


def _advance(writer: EquationsWriter, rates: list[str], projected: bool) -> str:
    """Write ``advance(p, q, v, h, first, count)``: RK4 steps number first to first + count - 1, in place.

    It returns the number of steps done and the drivers' work over them, and with a stabilisation the energy
    that it has removed; fewer than ``count`` steps mean that the step begun from the state left in q and v
    met a singular configuration or overflowed.
    """
    n = range(writer.n)
    lines, ok = rk4_lines(writer, ["p"], rates, projected, compensated=True, ledger=True)
    step = ["t = (first + done)*h", *lines, f"if not ({ok}):", "    break"]
    sums = {"work": drivers_power(writer), "removed": stabilisation_loss(rates, projected)}
    step += [f"{name} += {added}" for name, added in sums.items() if added]
    step += [f"q{c} = x{c}" for c in n] + [f"v{c} = y{c}" for c in n] + ["done += 1"]
    lines = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in n]
    lines += [f"lost_{name}{c} = 0.0" for name in "qv" for c in n]
    results = ["done", "work"]
    lines.append("done, work = 0, 0.0")
    if sums["removed"]:
        results.append("removed")
        lines.append("removed = 0.0")
    lines += ["while done < count:", *(f"    {line}" for line in step)]
    lines += [f"{name}[{c}] = {name}{c}" for name in "qv" for c in n]
    return function("advance", ["p", "q", "v", "h", "first", "count"], lines, results)


def rk4_lines(
    writer: EquationsWriter,
    inputs: list[str],
    rates: list[str],
    projected: bool,
    compensated: bool = False,
    ledger: bool = False,
) -> tuple[list[str], str]:
    """Return one RK4 step of (11)-(13) from q, v at t to x, y at t + h, and the condition that it holds.

    ``inputs`` come first in the call of ``accelerations``, ``rates`` last in its results; the value of
    ``name`` in stage k is called ``name_k``. With the ``ledger`` a projection's results have the energy
    removed, called ``removed_q`` and ``removed_v``.
    """
    n, lines = range(writer.n), []
    start_q, start_v = names("q", writer.n), names("v", writer.n)
    for stage, fraction, time in (
        (1, "", "t"),
        (2, "0.5*h", "t + 0.5*h"),
        (3, "0.5*h", "t + 0.5*h"),
        (4, "h", "t + h"),
    ):
        if stage > 1:
            lines += [f"x{c} = q{c} + {fraction}*{start_v[c]}" for c in n]
            lines += [f"y{c}_{stage} = v{c} + {fraction}*a{c}_{stage - 1}" for c in n]
            start_q, start_v = names("x", writer.n), [f"y{c}_{stage}" for c in n]
        results = [*names("a", writer.n), *names("lambda", writer.m), *rates, "ok"]
        arguments = [*inputs, time, *start_q, *start_v]
        lines.append(call([f"{name}_{stage}" for name in results], "accelerations", arguments))
    for c in n:
        changes = (("x", "q", f"h/6.0*(v{c} + 2.0*(y{c}_2 + y{c}_3) + y{c}_4)"), ("y", "v", mean(f"a{c}")))
        for new, old, change in changes:
            lines += _sum(f"{new}{c}", f"{old}{c}", change, compensated)
    conditions = ["ok_1", "ok_2", "ok_3", "ok_4"]
    if projected:
        x, y = names("x", writer.n), names("y", writer.n)
        for of, moved, state in (("q", x, x), ("v", y, [*x, *y])):
            results = [*moved, *([f"removed_{of}"] if ledger else []), f"ok_{of}"]
            lines.append(call(results, f"project_{of}", [*inputs, "t + h", *state]))
        conditions += ["ok_q", "ok_v"]
    return lines, " and ".join(conditions)


def stabilisation_loss(rates: list[str], projected: bool) -> str:
    """Return the energy that the stabilisation removes in a step (see ``readable``); empty without one."""
    if projected:
        return "removed_q + removed_v"
    return "h*removing_1" if "removing" in rates else ""


def mean(name: str) -> str:
    """Return h times RK4's mean of a value over the stages."""
    return f"h/6.0*({name}_1 + 2.0*({name}_2 + {name}_3) + {name}_4)"


def drivers_power(writer: EquationsWriter, of: Callable[[str], str] = mean) -> str:
    """Return the drivers' {lambda}^T{C}, by default their work in a step; empty without drivers."""
    rows = enumerate(writer.rows(StraightLine()))
    return " + ".join(product(row.C, of(f"lambda{r}")) for r, row in rows if row.C != ZERO)


def _sum(new: str, old: str, change: str, compensated: bool) -> list[str]:
    """Write new = old + change, if compensated with the rounding carried to the next step (Kahan 1965)."""
    if not compensated:
        return [f"{new} = {old} + {change}"]
    return [
        f"change = {change} + lost_{old}",
        f"{new} = {old} + change",
        f"lost_{old} = change - ({new} - {old})",
    ]


def _multipliers(writer: EquationsWriter, rates: list[str]) -> str:
    """Write ``multipliers(p, t, q, v, out)``: {lambda} at a state into ``out``; returns whether it could."""
    q, v = names("q", writer.n), names("v", writer.n)
    lambda_ = names("lambda", writer.m)
    lines = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]
    results = [*names("a", writer.n), *lambda_, *rates, "ok"]
    lines.append(call(results, "accelerations", ["p", "t", *q, *v]))
    lines += [f"out[{r}] = {name}" for r, name in enumerate(lambda_)]
    return function("multipliers", ["p", "t", "q", "v", "out"], lines, ["ok"])

"""The source of a compiled kernel: RK4 around the straight-line equations, in functions that Python calls."""

from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.straight_line import ZERO, StraightLine, product

HEADER = '''"""Generated from a mechanism's topology by reference_solver.generator."""

from math import cos, sin, sqrt

from numba import njit

OPTIONS = {"cache": True, "error_model": "numpy", "fastmath": {"contract"}}
'''


def kernel_source(writer: EquationsWriter, baumgarte: Baumgarte | None, projected: bool) -> str:
    """Return a module with ``advance`` and ``multipliers`` for the writer's topology (see ``kernel``).

    ``writer.parameters`` is complete afterwards.
    """
    q, v = names("q", writer.n), names("v", writer.n)
    code, accelerations, lambda_, ok = writer.accelerations(baumgarte)
    functions = [
        function("accelerations", ["p", "t", *q, *v], code.lines, [*accelerations, *lambda_, ok], inline=True)
    ]
    if projected:
        for of in ("q", "v"):
            code, moved, ok = writer.projection(of)
            arguments = ["p", "t", *q, *(v if of == "v" else [])]
            functions.append(function(f"project_{of}", arguments, code.lines, [*moved, ok], inline=True))
    functions.append(_advance(writer, projected))
    functions.append(_multipliers(writer))
    return "\n\n".join([HEADER, *functions]) + "\n"


def names(letter: str, count: int) -> list[str]:
    """Return letter0, letter1, ..."""
    return [f"{letter}{k}" for k in range(count)]


def function(
    name: str, arguments: list[str], lines: list[str], results: list[str], inline: bool = False
) -> str:
    """Return a compiled function's text."""
    options = "**OPTIONS, forceinline=True" if inline else "**OPTIONS"
    body = [*lines, f"return {', '.join(results)}"]
    return "\n    ".join([f"@njit({options})\ndef {name}({', '.join(arguments)}):", *body])


def call(results: list[str], called: str, arguments: list[str]) -> str:
    """Return the line that calls a function and names its results."""
    return f"{', '.join(results)} = {called}({', '.join(arguments)})"


def _advance(writer: EquationsWriter, projected: bool) -> str:
    """Write ``advance(p, q, v, h, first, count)``: RK4 steps number first to first + count - 1, in place.

    It returns the number of steps done and the drivers' work over them; fewer than ``count`` steps mean that
    the step begun from the state left in q and v met a singular configuration or overflowed.
    """
    n = range(writer.n)
    lines, ok = rk4_lines(writer, ["p"], [], projected, compensated=True)
    step = ["t = (first + done)*h", *lines, f"if not ({ok}):", "    break"]
    if power := drivers_power(writer):
        step.append(f"work += {power}")
    step += [f"q{c} = x{c}" for c in n] + [f"v{c} = y{c}" for c in n] + ["done += 1"]
    lines = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in n]
    lines += [f"lost_{name}{c} = 0.0" for name in "qv" for c in n]
    lines += ["done, work = 0, 0.0", "while done < count:", *(f"    {line}" for line in step)]
    lines += [f"{name}[{c}] = {name}{c}" for name in "qv" for c in n]
    return function("advance", ["p", "q", "v", "h", "first", "count"], lines, ["done", "work"])


def rk4_lines(
    writer: EquationsWriter, inputs: list[str], rates: list[str], projected: bool, compensated: bool = False
) -> tuple[list[str], str]:
    """Return one RK4 step of (11)-(13) from q, v at t to x, y at t + h, and the condition that it holds.

    ``inputs`` come first in the call of ``accelerations``, ``rates`` last in its results; the value of
    ``name`` in stage k is called ``name_k``.
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
        lines.append(call([*x, "ok_q"], "project_q", ["p", "t + h", *x]))
        lines.append(call([*y, "ok_v"], "project_v", ["p", "t + h", *x, *y]))
        conditions += ["ok_q", "ok_v"]
    return lines, " and ".join(conditions)


def mean(name: str) -> str:
    """Return h times RK4's mean of a value over the stages."""
    return f"h/6.0*({name}_1 + 2.0*({name}_2 + {name}_3) + {name}_4)"


def drivers_power(writer: EquationsWriter) -> str:
    """Return the drivers' work in a step, {lambda}^T{C} by RK4's quadrature; empty without drivers."""
    rows = enumerate(writer.rows(StraightLine()))
    return " + ".join(product(row.C, mean(f"lambda{r}")) for r, row in rows if row.C != ZERO)


def _sum(new: str, old: str, change: str, compensated: bool) -> list[str]:
    """Write new = old + change, if compensated with the rounding carried to the next step (Kahan 1965)."""
    if not compensated:
        return [f"{new} = {old} + {change}"]
    return [
        f"change = {change} + lost_{old}",
        f"{new} = {old} + change",
        f"lost_{old} = change - ({new} - {old})",
    ]


def _multipliers(writer: EquationsWriter) -> str:
    """Write ``multipliers(p, t, q, v, out)``: {lambda} at a state into ``out``; returns whether it could."""
    q, v = names("q", writer.n), names("v", writer.n)
    lambda_ = names("lambda", writer.m)
    lines = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]
    lines.append(call([*names("a", writer.n), *lambda_, "ok"], "accelerations", ["p", "t", *q, *v]))
    lines += [f"out[{r}] = {name}" for r, name in enumerate(lambda_)]
    return function("multipliers", ["p", "t", "q", "v", "out"], lines, ["ok"])

"""The source of a compiled kernel: RK4 around the straight-line equations, in functions that Python calls."""

from reference_solver.equations import Baumgarte
from reference_solver.generator import EquationsWriter
from reference_solver.straight_line import ZERO, StraightLine, product, total

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
    n, m = range(writer.n), range(writer.m)
    q, v = names("q", writer.n), names("v", writer.n)
    step = ["t = (first + done)*h"]
    start_q, start_v = q, v
    for stage, (fraction, time) in enumerate(
        zip(("", "0.5*h", "0.5*h", "h"), ("t", "t + 0.5*h", "t + 0.5*h", "t + h"), strict=True), 1
    ):
        if stage > 1:
            step += [f"x{c} = q{c} + {fraction}*{start_v[c]}" for c in n]
            step += [f"y{stage}_{c} = v{c} + {fraction}*a{stage - 1}_{c}" for c in n]
            start_q, start_v = names("x", writer.n), names(f"y{stage}_", writer.n)
        results = [f"a{stage}_{c}" for c in n] + [f"m{stage}_{r}" for r in m] + [f"ok{stage}"]
        step.append(call(results, "accelerations", ["p", time, *start_q, *start_v]))
    ok = "ok1 and ok2 and ok3 and ok4"
    step += _compensated("x", "q", "h/6.0*(v{c} + 2.0*(y2_{c} + y3_{c}) + y4_{c})", n)
    step += _compensated("y", "v", "h/6.0*(a1_{c} + 2.0*(a2_{c} + a3_{c}) + a4_{c})", n)
    if projected:
        x, y = names("x", writer.n), names("y", writer.n)
        step.append(call([*x, "ok5"], "project_q", ["p", "t + h", *x]))
        step.append(call([*y, "ok6"], "project_v", ["p", "t + h", *x, *y]))
        ok += " and ok5 and ok6"
    step += [f"if not ({ok}):", "    break"]
    mean = "h/6.0*(m1_{r} + 2.0*(m2_{r} + m3_{r}) + m4_{r})"
    drivers = [(r, row.C) for r, row in enumerate(writer.rows(StraightLine())) if row.C != ZERO]
    if drivers:
        step.append(f"work += {total(product(C, mean.format(r=r)) for r, C in drivers)}")
    step += [f"q{c} = x{c}" for c in n] + [f"v{c} = y{c}" for c in n] + ["done += 1"]
    lines = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in n]
    lines += [f"lost_{name}{c} = 0.0" for name in "qv" for c in n]
    lines += ["done, work = 0, 0.0", "while done < count:", *(f"    {line}" for line in step)]
    lines += [f"{name}[{c}] = {name}{c}" for name in "qv" for c in n]
    return function("advance", ["p", "q", "v", "h", "first", "count"], lines, ["done", "work"])


def _compensated(new: str, old: str, increment: str, coordinates: range) -> list[str]:
    """Write new = old + increment with the rounding carried to the next step (Kahan 1965)."""
    lines = []
    for c in coordinates:
        lines.append(f"d{c} = {increment.format(c=c)} + lost_{old}{c}")
        lines.append(f"{new}{c} = {old}{c} + d{c}")
        lines.append(f"lost_{old}{c} = d{c} - ({new}{c} - {old}{c})")
    return lines


def _multipliers(writer: EquationsWriter) -> str:
    """Write ``multipliers(p, t, q, v, out)``: {lambda} at a state into ``out``; returns whether it could."""
    q, v = names("q", writer.n), names("v", writer.n)
    lambda_ = names("lambda", writer.m)
    lines = [f"{name}{c} = {name}[{c}]" for name in "qv" for c in range(writer.n)]
    lines.append(call([*names("a", writer.n), *lambda_, "ok"], "accelerations", ["p", "t", *q, *v]))
    lines += [f"out[{r}] = {name}" for r, name in enumerate(lambda_)]
    return function("multipliers", ["p", "t", "q", "v", "out"], lines, ["ok"])

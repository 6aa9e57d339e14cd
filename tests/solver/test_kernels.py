"""Kernels: machine code does what Python does with its text, which has what a mechanism needs and no more."""

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from reference_solver.compiled import kernel
from reference_solver.compiled.faces import CompiledFace
from reference_solver.kernel import Topology
from reference_solver.kernel import source_of as source_of_marked
from reference_solver.compiled.store import load_kernel
from reference_solver.equations import Equations
from reference_solver.mechanism.mechanism import Body, Mechanism
from reference_solver.methods import RK4, Method, dop853
from reference_solver.solver import LARGEST_COMPILED, solve
from tests.helpers.chains import chain, chain_start

HEAD = """
from math import asin, copysign, cos, exp, inf, nan, sin, sqrt, tanh
from reference_solver.compiled.store import njit
from reference_solver.compiled.straight_line import straight_line

@njit()
def mean(x, y):
    return 0.5*(x + y)

"""
#: Of every operation that a kernel has, expressions in x and y.
ALGEBRA = (
    *("x + y", "x - y", "x*y", "x/(y*y + 1.0)", "-x", "-(x - y)*2.0", "x - (y - 1.0)", "1.0/(x*x + 1.0)/3.0"),
    *("abs(x)", "copysign(x, y)", "sqrt(abs(x))", "max(x, y)", "min(x, y)", "max(x, 0.0)", "min(1.0, y)"),
    *("x if x > y else y", "1.0 if x == y else inf", "x if (x > 0.0) & (y > 0.0) else -y", "x > y", "True"),
)
#: Those whose last digit libraries may round otherwise; the last ones no kernel has yet.
ROUNDED = ("cos(x)", "sin(y)", "tanh(x)", "asin(tanh(y))", "pow(abs(x), 1.7)", "exp(-abs(y))", "mean(x, y)")
NUMBERS = (0.0, -0.0, 1.0, -2.5, 3e-9, 7e8)


def both_faces(expression: str) -> tuple[Any, Any]:
    """Return an expression's function of x and y as Python and as machine code."""
    text = f"{HEAD}\n@straight_line\ndef of(x, y):\n    z = {expression}\n    return z\n\n"
    module = load_kernel(text + "@njit()\ndef compiled(x, y):\n    return of(x, y)\n")
    return lambda x, y: eval(expression, vars(module) | {"x": x, "y": y}), module.compiled


def same(x: Any, y: Any) -> bool:
    """Return whether two are the same to the last bit, and of one kind."""
    return (isinstance(x, bool), np.float64(x).tobytes()) == (isinstance(y, bool), np.float64(y).tobytes())


@pytest.mark.parametrize("expression", [*ALGEBRA, *ROUNDED])
def test_an_expression_is_what_it_is_in_python_to_the_last_bit_or_to_rounding(expression: str) -> None:
    python, compiled = both_faces(expression)
    for x, y in product(NUMBERS, NUMBERS):
        rounded = expression in ROUNDED and compiled(x, y) == pytest.approx(python(x, y), rel=4e-16, abs=0.0)
        assert rounded or same(python(x, y), compiled(x, y)), (x, y)


@pytest.mark.parametrize(
    "expression", ["max(x, y)", "min(x, y)", "x if x > y else y", "1.0 if x == y else 2.0"]
)
def test_what_is_no_number_goes_through_as_in_python(expression: str) -> None:
    """A step that fails has infinities and worse, which are to be found in its condition."""
    python, compiled = both_faces(expression)
    for x, y in product((1.0, math.inf, -math.inf, math.nan), repeat=2):
        assert compiled(x, y) == pytest.approx(python(x, y), nan_ok=True)


def test_a_function_that_is_called_has_its_module_s_name_in_machine_code() -> None:
    """Machine code kept by several processes would call what another module has by the same name."""
    text = HEAD.replace("import straight_line\n", "import called, straight_line\n")
    text += '@called(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False)\n'
    text += "def inner(p, x):\n    return x*p[0], x\n\n"
    text += "@straight_line\ndef outer_(p, x):\n    y, z = inner(p, x)\n    return y + z\n\n"
    text += "@njit()\ndef outer(p, x):\n    return outer_(p, x)\n"
    module = load_kernel(text)
    assert module.outer(np.array([2.0]), 3.0) == 9.0
    (overload,) = module.inner.overloads.values()
    assert f"{module.__name__}5inner" in overload.fndesc.mangled_name


# The text of kernels


def source_of(mechanism: Mechanism, projected: bool = False, method: Method = RK4) -> str:
    return source_of_marked(Topology(mechanism, projected=projected, method=method).marked())


def sums(source: str) -> list[str]:
    """Return what a step adds to the sums of a driver's work and of what a stabilisation removes."""
    _, _, step = source.partition("def stepped")
    return step.partition("return ")[2].partition("\n")[0].split(", ")[-2:]


def test_a_kernel_contains_nothing_that_its_mechanism_does_not() -> None:
    free, driven = (mechanism_of(IDEAL_SCENES[name]()) for name in ("ideal-free", "ideal-driven"))
    free_source, driven_source = (source_of(of).partition("def answer")[2] for of in (free, driven))
    assert "sqrt(" not in free_source, "no spring, no length"
    assert sums(free_source) == ["0.0", "0.0"], "no driver, no driver's work"
    assert "project" not in free_source
    work, removed = sums(driven_source)
    assert work != "0.0"
    assert removed == "0.0", "no stabilisation, no energy that it removes"
    assert sums(source_of(driven, projected=True))[1] != "0.0"
    # Eight rows and the two angles that carry arms: the slider's angle has neither sine nor cosine.
    assert free_source.count("cos(") == free_source.count("sin(") == 2
    assert "lambda8" not in free_source
    assert "lambda8" in driven_source
    assert len(source_of(replace(free, gravity_m_s2=0.0)).partition("def answer")[2]) < len(free_source)


def test_another_mechanism_of_the_same_topology_has_the_same_source() -> None:
    mechanism = mechanism_of(IDEAL_SCENES["ideal-driven"]())
    bodies = tuple(Body(3 * b.mass_kg, 2 * b.inertia_kg_m2) for b in mechanism.bodies)
    assert source_of(replace(mechanism, bodies=bodies, gravity_m_s2=1.62)) == source_of(mechanism)


@pytest.mark.parametrize("method", [RK4, dop853()], ids=["rk4", "dop853"])
def test_only_a_large_mechanism_has_functions_that_are_called(method: Method) -> None:
    for links, decorated in ((kernel.LARGEST_INLINE, 0), (kernel.LARGEST_INLINE + 1, 3)):
        text = source_of(chain(links), True, method)
        assert text.count("@called(") == decorated
        assert ("zeros(" in text) == (decorated > 0 and method is RK4)


def test_a_mechanism_too_large_for_straight_line_code_is_stepped_by_the_readable_face(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(CompiledFace, "advance", None)  # it would be called
    links = LARGEST_COMPILED + 1
    q, v = chain_start(np.linspace(0, 1, links), np.linspace(1, -1, links))
    run = solve(chain(links), q, v, end_time_s=1e-3, samples=1, step=1e-3, stabilisation="none")
    equations = Equations(chain(links), q)
    B, weight = equations.constraint_matrix(q), equations.inverse_mass
    right = -equations.centripetal(q, v) - B @ (weight * equations.applied_force(0.0, q, v))
    dense = np.linalg.solve((B * weight) @ B.T, right)
    assert np.abs(run.multipliers[0] - dense).max() <= 1e-9 * np.abs(dense).max()

"""Machine code of a tape computes what its functions compute of numbers, and nothing that is not needed.

So it does of whole mechanisms, of parts at random.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings

from engine_models.reference.run import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from reference_solver import machine_code
from reference_solver.equations import Equations
from reference_solver.kernel import Topology, program_of
from reference_solver.machine_code import HEAD, FunctionText, compile_text, parameters_text
from reference_solver.mechanism.contacts import power
from reference_solver.mechanism.data import Body
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.tape import (
    Node,
    Tape,
    both,
    choose,
    cos,
    larger,
    signed,
    sin,
    smaller,
    sqrt,
    tanh,
    when,
)
from tests.helpers.chains import chain, chain_start
from tests.solver.pins import run as run_of
from tests.solver.random_mechanisms import (
    BESIDE_WALLS,
    BY_LAWS,
    LOADED,
    ON_WALLS,
    RECIPES,
    Recipe,
    outcomes,
)

NAMES = ("a", "b", "c")


def written(function: Callable[..., list[Any]], known: tuple[str, ...] = ()) -> tuple[str, dict[Node, int]]:
    """Return the text of a function of a, b and c, of which some are known before a run, and p's nodes."""
    tape, parameters = Tape(), dict[Node, int]()
    inputs = (("raw" if name in known else "y", k, name in known) for k, name in enumerate(NAMES))
    results = function(*(tape.input(*of) for of in inputs))
    text = FunctionText("of", tape, [*results, 1.0], parameters).text
    return text, parameters


def run(
    function: Callable[..., list[Any]], values: Sequence[float], known: tuple[str, ...] = ()
) -> list[float]:
    """Return what machine code of such a function makes of a, b and c."""
    text, parameters = written(function, known)
    p, y, out = np.zeros(len(parameters)), np.array(values, dtype=float), np.zeros(text.count("store double"))
    text += parameters_text(parameters)
    functions = compile_text(HEAD + text, ["of", "parameters"])
    functions["parameters"](0, 0, 0.0, y, p)
    assert functions["of"](p.ctypes.data, 0, 0.0, y, out) == 1.0
    return [float(x) for x in out]


def test_zeros_and_ones_fold_equal_operations_are_shared_and_what_nobody_needs_is_not_written() -> None:
    def function(a: Any, b: Any, c: Any) -> list[Any]:
        cos(c)  # nobody needs it
        product = a * b
        return [0.0 * c + 1.0 * product, b * a + sqrt(product), -1.0 * (a + 0.0), a - a, product / -1.0]

    text, _ = written(function)
    assert (text.count("fmul"), text.count("load double"), "cos" in text) == (1, 2, False), text
    assert run(function, (2.0, 8.0, 0.0)) == [16.0, 20.0, -2.0, 0.0, -16.0]


def test_what_a_branch_needs_alone_is_computed_in_it_alone() -> None:
    def function(a: Any, b: Any, c: Any) -> list[Any]:
        return [when(a > 0.0, lambda: (sqrt(b) * c,), 1)[0]]

    text, _ = written(function)
    assert text.index("taken") < text.index("sqrt") < text.index("phi")
    assert [run(function, (a, 9.0, 2.0)) for a in (1.0, -1.0)] == [[6.0], [0.0]]


def test_what_depends_on_parameters_alone_is_computed_before_the_run() -> None:
    def function(a: Any, b: Any, c: Any) -> list[Any]:
        return [sin(a) / b * c, 1.0 / b + c]

    text, _ = written(function, ("a", "b"))
    assert "sin" not in text, "it is a parameter"
    expected = [math.sin(0.7) / 3.0 * 5.0, 1 / 3.0 + 5.0]
    assert run(function, (0.7, 3.0, 5.0), ("a", "b")) == pytest.approx(expected, rel=1e-15)


#: Of every operation that a kernel has, functions of x and y, and how libraries may round them.
OPERATIONS: dict[str, tuple[Callable[[Any, Any], Any], float]] = {
    "x + y": (lambda x, y: x + y, 0.0),
    "x-y": (lambda x, y: x - y, 0.0),
    "-x-y": (lambda x, y: -x - y, 0.0),
    "-x-(-y)": (lambda x, y: -x - (-y), 0.0),
    "2-(-x)y": (lambda x, y: 2.0 - (-x) * y, 0.0),
    "x/(y^2 + 1)": (lambda x, y: x / (y * y + 1.0), 0.0),
    "-(x-2y)": (lambda x, y: -(x - 2.0 * y), 0.0),
    "|x|": (lambda x, _: abs(x), 0.0),
    "sign": (signed, 0.0),
    "sqrt": (lambda x, _: sqrt(abs(x)), 0.0),
    "larger": (larger, 0.0),
    "smaller": (smaller, 0.0),
    "larger than 0": (lambda x, _: larger(x, 0.0), 0.0),
    "x if x > y": (lambda x, y: choose(x > y, x, y), 0.0),
    "both": (lambda x, y: choose(both(x > 0.0, y > 0.0), x, -y), 0.0),
    "cos": (lambda x, _: cos(x), 4e-16),
    "sin": (lambda _, y: sin(y), 4e-16),
    "tanh": (lambda x, _: tanh(x), 4e-16),
    "power": (lambda x, _: power(abs(x), 1.7), 4e-16),
}
NUMBERS = (0.0, -0.0, 1.0, -2.5, 3e-9, 7e8)
#: Of a step that fails, which are to be found in its condition.
NO_NUMBERS = (1.0, math.inf, -math.inf, math.nan)
PASSING = ("larger", "smaller", "x if x > y", "inf if x == y")


@pytest.mark.parametrize("name", OPERATIONS)
def test_an_operation_is_what_it_is_of_numbers_to_the_last_bit_or_to_rounding(name: str) -> None:
    function, rounding = OPERATIONS[name]
    pairs = [*product(NUMBERS, repeat=2), *(product(NO_NUMBERS, repeat=2) if name in PASSING else ())]
    for x, y in pairs:
        (found,) = run(lambda a, b, _: [function(a, b)], (x, y, 0.0))
        expected = float(function(np.float64(x), np.float64(y)))
        assert found == pytest.approx(expected, rel=rounding, abs=0.0, nan_ok=True), (x, y)


@pytest.mark.parametrize("period", [0.0, 2.0])
def test_a_table_is_looked_up_as_in_numbers(period: float) -> None:
    rows = tuple(x for k in range(5) for x in (0.4 * k - 0.3, 1.0 + k, 0.5, -0.2 * k, 0.1))
    table = PiecewiseCubic(rows, period)
    tape = Tape()
    place = tape.input("raw", known=True)
    results = [*replace(table.placed(), place=place).at(tape.input("y")), 1.0]
    parameters: dict[Node, int] = {}
    text = FunctionText("of", tape, results, parameters).text
    assert [*parameters] == [place.node]
    p = np.array([*rows, table.placed().place])
    of, out = compile_text(HEAD + text, ["of"])["of"], np.zeros(3)
    for x in (-7.3, -0.3, -0.25, 0.1, 0.5, 1.3, 1.69, 1.7, 9.9):
        of(p.ctypes.data + 8 * len(rows), 0, 0.0, np.array([x]), out)
        assert out == pytest.approx(table.at(x), rel=1e-14), x


# Whole mechanisms


def program(mechanism: Mechanism) -> str:
    return program_of(Topology(mechanism).marked())[0]


def stored(mechanism: Mechanism, name: str) -> list[str]:
    """Return what a function of a mechanism's kernel stores, in order."""
    text = program(mechanism).partition(f"define double @{name}(")[2].partition("\n}\n")[0]
    return re.findall("store double ([^,]*), ptr", text)


def test_a_kernel_contains_nothing_that_its_mechanism_does_not_and_serves_all_of_a_topology() -> None:
    zero = "0x0000000000000000"
    free, driven = (mechanism_of(IDEAL_SCENES[name]()) for name in ("ideal-free", "ideal-driven"))
    assert stored(free, "rates")[18:20] == [zero, zero], "no driver's work, no energy that is removed"
    work, removed = stored(driven, "rates")[18:20]
    assert (work != zero, removed) == (True, zero), "no stabilisation"
    assert [len(stored(of, "forces")) for of in (free, driven)] == [8, 9]
    bodies = tuple(Body(3 * b.mass_kg, 2 * b.inertia_kg_m2) for b in driven.bodies)
    assert program(replace(driven, bodies=bodies, gravity_m_s2=1.62)) is program(driven)


def test_a_long_chain_moves_by_the_accelerations_of_its_whole_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its texts are compiled without optimisation, as are longer ones."""
    monkeypatch.setattr(machine_code, "LONG", 1_000_000)
    links = 22
    q, v = chain_start(np.linspace(0, 1, links), np.linspace(1, -1, links))
    found = run_of(chain(links), q, v, 1e-3, 1, 1)
    equations = Equations(chain(links), q)
    B, weight = equations.system(0.0, q).B, equations.inverse_mass
    right = -equations.system(0.0, q, v).B_dot_v - B @ (weight * equations.forces(0.0, q, v)[0])
    dense = np.linalg.solve((B * weight) @ B.T, right)
    assert np.abs(found.multipliers[0] - dense).max() <= 1e-9 * np.abs(dense).max()


#: Parts of the largest number of a function; units in the last place, magnified, are 1e-12.
ROUND_OFF = 1e-10


@settings(max_examples=30, deadline=None)
@given(RECIPES)
@example(LOADED)
@example(BY_LAWS)
@example(BESIDE_WALLS)
@example(ON_WALLS)
def test_what_the_tape_writes_of_a_mechanism_computes_what_its_equations_do(recipe: Recipe) -> None:
    with np.errstate(all="ignore"):
        machine, readable, beside = outcomes(recipe)
    assume(readable)
    assert machine.keys() == readable.keys()
    for name, numbers in readable.items():
        known = np.isfinite(numbers)
        assert (np.isfinite(machine[name]) == known).all(), name
        # No number is known better than some hundred roundings of the state move it; ten times, since what
        # comes between rounds too. What they make NaN of is not compared.
        apart = np.abs(machine[name] - numbers) - 10 * np.abs(beside[name] - numbers)
        worst = np.nanmax(apart[known], initial=0.0)
        # Where constraints leave a body no freedom, its mobility is the round-off of one over its mass.
        scale = np.abs(numbers[known]).max(initial=1e-3 if name == "mobilities" else 0.0)
        assert worst <= ROUND_OFF * scale, f"{name}: {worst:.1e} of {scale:.1e}"


@settings(max_examples=100, deadline=None)
@given(RECIPES)
def test_factors_solve_the_equations_of_a_mechanism_as_their_whole_matrix_does(recipe: Recipe) -> None:
    topology, random = recipe.topology(), np.random.default_rng(recipe.seed)
    q_start, q, v = random.uniform(-1.0, 1.0, (3, topology.n))
    equations = Equations(topology.mechanism, q_start)
    answer = equations.answer(0.3, q, v)
    assume(answer.condition < 1e4)  # which makes 1e-12 of a rounding
    system, F = equations.system(0.3, q, v), equations.forces(0.3, q, v)[0]
    B, rows = np.asarray(system.B, dtype=float), len(system.B)
    whole = np.block([[np.diag(equations.mass.astype(float)), -B.T], [B, np.zeros((rows, rows))]])
    dense = np.linalg.solve(whole, np.array([*F, *(system.C_dot - system.B_dot_v)], dtype=float))
    found = np.array([*answer.accelerations, *answer.multipliers], dtype=float)
    np.testing.assert_allclose(found, dense, rtol=0, atol=1e-10 * np.abs(dense).max())

"""Machine code of a tape computes what its functions compute of numbers, and nothing that is not needed.

So it does of whole mechanisms, of parts at random.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from reference_solver import kernel
from reference_solver.factorisation import Factors, eliminated
from reference_solver.machine_code import HEAD, FunctionText, compile_text, known_numbers
from reference_solver.mechanism.constraints import PrescribedMotion
from reference_solver.mechanism.data import Body, ConstantSpeed
from reference_solver.mechanism.lifting import lifted
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.tape import (
    Node,
    Tape,
    array,
    both,
    choose,
    cos,
    equal,
    larger,
    power,
    signed,
    sin,
    size,
    smaller,
    sqrt,
    tanh,
    when,
)
from tests.solver.random_mechanisms import CONSTRAINTS as KINDS
from tests.solver.random_mechanisms import FRICTIONS, LAWS, LOADS, STABILISATIONS, Recipe, outcomes, solved

NAMES = ("a", "b", "c")


def written(function: Callable[..., list[Any]], known: tuple[str, ...] = ()) -> tuple[str, dict[Node, int]]:
    """Return the text of a function of a, b and c, of which some are known before a run, and p's nodes."""
    tape, parameters = Tape(), dict[Node, int]()
    results = function(*(tape.input(name, name in known) for name in NAMES))
    places = {name: ("y", k) for k, name in enumerate(NAMES)}
    text = FunctionText("of", tape, [*results, 1.0], places.__getitem__, parameters).text
    return text, parameters


def run(
    function: Callable[..., list[Any]], values: Sequence[float], known: tuple[str, ...] = ()
) -> list[float]:
    """Return what machine code of such a function makes of a, b and c."""
    text, parameters = written(function, known)
    p = np.array(known_numbers(parameters, dict(zip(NAMES, values, strict=True))))
    out = np.zeros(text.count("store double"))
    of = compile_text(HEAD + text, ["of"])["of"]
    assert of(p.ctypes.data, 0, 0.0, np.array(values, dtype=float), out) == 1.0
    return [float(x) for x in out]


def test_zeros_and_ones_fold_equal_operations_are_shared_and_what_nobody_needs_is_not_written() -> None:
    def function(a: Any, b: Any, c: Any) -> list[Any]:
        cos(c)  # nobody needs it
        product = a * b
        return [0.0 * c + 1.0 * product, b * a + sqrt(product), -1.0 * (a + 0.0), a - a, product / -1.0]

    text, _ = written(function)
    assert text.count("fmul") == 1, text
    assert "cos" not in text
    assert text.count("load double") == 2, "of a and b"
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


#: Of every operation that a kernel has, functions of x and y; the last ones libraries may round otherwise.
EXACT: dict[str, Callable[[Any, Any], Any]] = {
    "x + y": lambda x, y: x + y,
    "x - y": lambda x, y: x - y,
    "x y": lambda x, y: x * y,
    "x/(y^2 + 1)": lambda x, y: x / (y * y + 1.0),
    "-(x - 2 y)": lambda x, y: -(x - 2.0 * y),
    "|x|": lambda x, _: size(x),
    "sign": lambda x, y: signed(x, y),
    "sqrt": lambda x, _: sqrt(size(x)),
    "larger": lambda x, y: larger(x, y),
    "smaller": lambda x, y: smaller(x, y),
    "larger than 0": lambda x, _: larger(x, 0.0),
    "x if x > y": lambda x, y: choose(x > y, x, y),
    "inf if x == y": lambda x, y: choose(equal(x, y), math.inf, 1.0),
    "both": lambda x, y: choose(both(x > 0.0, y > 0.0), x, -y),
}
ROUNDED: dict[str, Callable[[Any, Any], Any]] = {
    "cos": lambda x, _: cos(x),
    "sin": lambda _, y: sin(y),
    "tanh": lambda x, _: tanh(x),
    "power": lambda x, _: power(size(x), 1.7),
}
NUMBERS = (0.0, -0.0, 1.0, -2.5, 3e-9, 7e8)


@pytest.mark.parametrize("name", [*EXACT, *ROUNDED])
def test_an_operation_is_what_it_is_of_numbers_to_the_last_bit_or_to_rounding(name: str) -> None:
    function = (EXACT | ROUNDED)[name]
    for x, y in product(NUMBERS, NUMBERS):
        (found,) = run(lambda a, b, _: [function(a, b)], (x, y, 0.0))
        expected = float(function(np.float64(x), np.float64(y)))
        assert found == pytest.approx(expected, rel=4e-16 if name in ROUNDED else 0.0, abs=0.0), (x, y)


@pytest.mark.parametrize("name", ["larger", "smaller", "x if x > y", "inf if x == y"])
def test_what_is_no_number_goes_through_as_in_numbers(name: str) -> None:
    """A step that fails has infinities and worse, which are to be found in its condition."""
    for x, y in product((1.0, math.inf, -math.inf, math.nan), repeat=2):
        (found,) = run(lambda a, b, _: [EXACT[name](a, b)], (x, y, 0.0))
        assert found == pytest.approx(EXACT[name](x, y), nan_ok=True), (x, y)


@pytest.mark.parametrize("period", [0.0, 2.0])
def test_a_table_is_looked_up_as_in_numbers(period: float) -> None:
    rows = tuple(x for k in range(5) for x in (0.4 * k - 0.3, 1.0 + k, 0.5, -0.2 * k, 0.1))
    table = PiecewiseCubic(rows, period)
    tape = Tape()
    results = [*replace(table.placed(), place=tape.input("place", known=True)).at(tape.input("x")), 1.0]
    parameters: dict[Node, int] = {}
    text = FunctionText("of", tape, results, lambda _: ("y", 0), parameters).text
    p = np.array([*rows, *known_numbers(parameters, {"place": table.placed().place})])
    of, out = compile_text(HEAD + text, ["of"])["of"], np.zeros(3)
    for x in (-7.3, -0.3, -0.25, 0.1, 0.5, 1.3, 1.69, 1.7, 9.9):
        of(p.ctypes.data + 8 * len(rows), 0, 0.0, np.array([x]), out)
        assert out == pytest.approx(table.at(x), rel=1e-14), x


def test_dependent_constraints_are_not_ok() -> None:
    for B in ([[1.0, 1.0], [1.0, 1.0]], [[2.0, 3.0], [4.0, 6.0]], [[0.0, 0.0]]):
        factors = Factors(np.eye(2), np.array(B), 1e-12)
        assert not factors.ok
        assert np.isfinite(factors.solve(np.ones(2), np.zeros(len(B)))[0]).all()


def test_a_pivot_that_is_minus_one_by_chance_is_as_good_as_others() -> None:
    M, B, right = np.eye(2), np.array([[0.6, 0.8], [0.3, 0.5]]), np.array([1.0, 2.0])
    assert B[0] @ B[0] == 1, "what the first constraint leaves is minus one"
    x, y = Factors(M, B).solve(right, right)
    whole = np.block([[M, -B.T], [B, np.zeros((2, 2))]])
    assert [*x, *y] == pytest.approx(np.linalg.solve(whole, [*right, *right]), rel=1e-12)


def test_a_small_matrix_is_eliminated_for_values_as_for_numbers() -> None:
    def solved(a: Any, b: Any, c: Any) -> list[Any]:
        small, pivots = eliminated(array([[2.0 + a, b], [c, 3.0 + b]]), array([a, c]))
        return [*small, *pivots]

    a, b, c = 0.3, -0.8, 0.5
    expected = np.linalg.solve([[2 + a, b], [c, 3 + b]], [a, c])
    for found in (run(solved, (a, b, c)), solved(*np.array([a, b, c]))):
        assert found == pytest.approx([*expected, 2 + a, 3 + b - c * b / (2 + a)], rel=1e-12)


def test_a_lifted_mechanism_has_its_numbers_replaced_in_order_and_keeps_its_structure() -> None:
    mechanism = Mechanism((Body(2.0, 3.0),), (PrescribedMotion(0, ConstantSpeed(0.0)),), gravity_m_s2=9.81)
    numbers: list[float] = []
    other = lifted(mechanism, lambda x: numbers.append(x) or 2.0 * x)  # type: ignore[func-returns-value]
    assert numbers == [2.0, 3.0, 9.81], "a speed of zero is structure"
    assert other == Mechanism(
        (Body(4.0, 6.0),), (PrescribedMotion(0, ConstantSpeed(0.0)),), gravity_m_s2=19.62
    )


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_sums_and_differences_of_negatives_have_their_signs(signs: tuple[int, int]) -> None:
    def function(a: Any, b: Any, _: Any) -> list[Any]:
        one, other = (x if sign > 0 else -x for sign, x in zip(signs, (a, b), strict=True))
        return [one + other, one - other, one + 2.0, 2.0 - one, one * other, one / other, one - 0.5 * other]

    a, b = 3.0 * signs[0], 7.0 * signs[1]
    found = run(function, (3.0, 7.0, 0.0))
    assert found == pytest.approx([a + b, a - b, a + 2, 2 - a, a * b, a / b, a - b / 2])


# Whole mechanisms

#: Parts of the largest number of a function; units in the last place, magnified, are 1e-12.
ROUND_OFF = 1e-10


def alike(recipe: Recipe) -> bool:
    """Return whether anything has been compared: badly conditioned mechanisms are not."""
    with np.errstate(all="ignore"):
        written, readable = outcomes(recipe)
    assert written.keys() == readable.keys()
    for name, numbers in readable.items():
        known = np.isfinite(numbers)
        assert (np.isfinite(written[name]) == known).all(), name
        apart = np.abs(written[name] - numbers)[known].max(initial=0.0)
        # Where constraints leave a body no freedom, its mobility is the round-off of one over its mass.
        scale = np.abs(numbers[known]).max(initial=1e-3 if name == "mobilities" else 0.0)
        assert apart <= ROUND_OFF * scale, f"{name}: {apart:.1e} of {scale:.1e}"
    return bool(readable)


RECIPES = st.builds(
    Recipe,
    st.integers(1, 3),
    st.lists(st.sampled_from(KINDS), max_size=5),
    st.lists(st.sampled_from(LOADS), max_size=4),
    st.lists(
        st.tuples(*(st.integers(0, len(of) - 1) for of in (LAWS, FRICTIONS)), st.booleans()), max_size=2
    ),
    st.sampled_from([*STABILISATIONS]),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)


@settings(max_examples=30, deadline=None)
@given(RECIPES)
def test_what_the_tape_writes_of_a_mechanism_computes_what_its_equations_do(recipe: Recipe) -> None:
    assume(alike(recipe))


@settings(max_examples=100, deadline=None)
@given(RECIPES)
def test_factors_solve_the_equations_of_a_mechanism_as_their_whole_matrix_does(recipe: Recipe) -> None:
    found, dense = solved(recipe)
    assume(len(found))
    np.testing.assert_allclose(found, dense, rtol=0, atol=1e-10 * np.abs(dense).max())


REVOLUTE, GUIDE, MOTION, SLIDE, LINK = KINDS
#: Mechanisms with all there is, in few topologies.
COMPILED = {
    "loads": Recipe(3, (REVOLUTE, GUIDE, SLIDE), LOADS, (), "projection"),
    "ring": Recipe(3, (REVOLUTE, REVOLUTE, LINK, MOTION), LOADS[5:6], (), "baumgarte", seed=4),
    "laws": Recipe(
        2, (MOTION,), (), ((0, 1, False), (1, 2, False), (2, 3, False), (3, 0, False)), "projection"
    ),
    "walls": Recipe(2, (REVOLUTE,), (), ((4, 3, False), (4, 0, False), (0, 0, False)), "baumgarte"),
    "pins on walls": Recipe(2, (LINK,), (), ((4, 1, True), (4, 2, False)), "projection", controlled=True),
}


@pytest.mark.parametrize("called", [False, True], ids=["inline", "called"])
@pytest.mark.parametrize("name", COMPILED)
def test_so_does_code_that_calls_its_parts(name: str, called: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "LARGEST_INLINE", 0 if called else kernel.LARGEST_INLINE)
    kernel.program_of.cache_clear()
    for state in range(6):
        assert alike(replace(COMPILED[name], state=state))
    kernel.program_of.cache_clear()

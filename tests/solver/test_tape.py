"""Code written by a tape computes what its functions compute of numbers, and nothing that is not needed.

So it does of whole mechanisms, of parts at random: as Python for any, as machine code for a few.
"""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from reference_solver.compiled import kernel
from reference_solver.factorisation import Factors, eliminated
from reference_solver.mechanism.lifting import lifted
from reference_solver.mechanism.mechanism import Body, Mechanism, PrescribedSpeed
from reference_solver.tape import Parameters, Tape, Writer, array, cos, sin, sqrt, when
from tests.solver.random_mechanisms import CONSTRAINTS as KINDS
from tests.solver.random_mechanisms import FRICTIONS, LAWS, LOADS, STABILISATIONS, Recipe, outcomes, solved

NAMES = ("a", "b", "c")
FUNCTIONS = {name: getattr(math, name) for name in ("cos", "sin", "sqrt", "tanh", "copysign")}


def written(
    function: Callable[..., list[Any]], known: tuple[str, ...] = ()
) -> tuple[list[str], list[str], Parameters]:
    """Return the lines and results of a function of a, b and c, of which some are known before a run."""
    tape, parameters = Tape(), Parameters()
    writer = Writer(parameters, NAMES)
    results = writer.write(tape, function(*(tape.input(name, name in known) for name in NAMES)))
    return writer.lines, results, parameters


def run(lines: list[str], results: list[str], **values: Any) -> list[float]:
    scope = {**FUNCTIONS, **values}
    exec("\n".join([*lines, f"found = [{', '.join(results)}]"]), scope)
    return list(scope["found"])


def test_zeros_and_ones_fold_equal_operations_are_shared_and_what_nobody_needs_is_not_written() -> None:
    def function(a: Any, b: Any, c: Any) -> list[Any]:
        cos(c)  # nobody needs it
        product = a * b
        return [0.0 * c + 1.0 * product, b * a + sqrt(product), -1.0 * (a + 0.0), a - a, product / -1.0]

    lines, results, _ = written(function)
    text = "\n".join([*lines, *results])
    assert text.count("*") == 1, text
    assert "cos" not in text
    assert "1.0" not in text
    assert results[2:4] == ["-a", "0.0"]


def test_what_a_branch_needs_alone_is_computed_in_it_alone() -> None:
    lines, *_ = written(lambda a, b, c: [when(a > 0.0, lambda: (sqrt(b) * c,), 1)[0]])
    (place,) = (n for n, line in enumerate(lines) if "sqrt" in line)
    assert lines[place].startswith("    ")
    assert lines[place - 1].startswith("if ") or lines[place - 1].startswith("    ")


def test_what_depends_on_parameters_alone_is_computed_before_the_run() -> None:
    lines, results, parameters = written(lambda a, b, c: [sin(a) / b * c, 1.0 / b + c], known=("a", "b"))
    values = {"a": 0.7, "b": 3.0}
    p = {f"p{k}": eval(text, {**FUNCTIONS, **values}) for k, text in enumerate(parameters.texts)}
    assert "sin" not in "\n".join([*lines, *results]), "it is a parameter"
    expected = [math.sin(0.7) / 3.0 * 5.0, 1 / 3.0 + 5.0]
    assert run(lines, results, **p, c=5.0) == pytest.approx(expected, rel=1e-15)


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
    lines, results, _ = written(solved)
    for found in (run(lines, results, a=a, b=b, c=c), solved(*np.array([a, b, c]))):
        assert found == pytest.approx([*expected, 2 + a, 3 + b - c * b / (2 + a)], rel=1e-12)


def test_a_lifted_mechanism_has_its_numbers_replaced_in_order_and_keeps_its_structure() -> None:
    mechanism = Mechanism((Body(2.0, 3.0),), (PrescribedSpeed(0, 0.0),), gravity_m_s2=9.81)
    numbers: list[float] = []
    other = lifted(mechanism, lambda x: numbers.append(x) or 2.0 * x)  # type: ignore[func-returns-value]
    assert numbers == [2.0, 3.0, 9.81], "a speed of zero is structure"
    assert other == Mechanism((Body(4.0, 6.0),), (PrescribedSpeed(0, 0.0),), gravity_m_s2=19.62)


def test_names_of_lines_are_never_used_twice() -> None:
    from reference_solver.tape import named

    def function(a: Any, b: Any, c: Any) -> list[Any]:
        return [named("x", a * b) + named("x", b * c), named("a", a + c)]

    lines, *_ = written(function)
    assigned = [line.split(" = ")[0] for line in lines]
    assert len(set(assigned) | set(NAMES)) == len(assigned) + len(NAMES), assigned
    assert all(re.fullmatch(r"\w+", name) for name in assigned)


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_sums_and_differences_of_negatives_have_their_signs(signs: tuple[int, int]) -> None:
    def function(a: Any, b: Any, _: Any) -> list[Any]:
        one, other = (x if sign > 0 else -x for sign, x in zip(signs, (a, b), strict=True))
        return [one + other, one - other, one + 2.0, 2.0 - one, one * other, one / other, one - 0.5 * other]

    a, b = 3.0 * signs[0], 7.0 * signs[1]
    lines, results, _ = written(function)
    found = run(lines, results, a=3.0, b=7.0, c=0.0)
    assert found == pytest.approx([a + b, a - b, a + 2, 2 - a, a * b, a / b, a - b / 2])


# Whole mechanisms

#: Parts of the largest number of a function; units in the last place, magnified, are 1e-12.
ROUND_OFF = 1e-10


def assert_alike(recipe: Recipe, compiled: bool) -> None:
    with np.errstate(all="ignore"):
        written, readable = outcomes(recipe, compiled)
    if not compiled:
        assume(readable)
    assert readable
    assert written.keys() == readable.keys()
    for name, numbers in readable.items():
        known = np.isfinite(numbers)
        assert (np.isfinite(written[name]) == known).all(), name
        apart = np.abs(written[name] - numbers)[known].max(initial=0.0)
        # Where constraints leave a body no freedom, its mobility is the round-off of one over its mass.
        scale = np.abs(numbers[known]).max(initial=1e-3 if name == "mobilities" else 0.0)
        assert apart <= ROUND_OFF * scale, f"{name}: {apart:.1e} of {scale:.1e}"


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


@settings(max_examples=40, deadline=None)
@given(RECIPES)
def test_what_the_tape_writes_of_a_mechanism_computes_what_its_equations_do(recipe: Recipe) -> None:
    assert_alike(recipe, compiled=False)


@settings(max_examples=100, deadline=None)
@given(RECIPES)
def test_factors_solve_the_equations_of_a_mechanism_as_their_whole_matrix_does(recipe: Recipe) -> None:
    found, dense = solved(recipe)
    assume(len(found))
    np.testing.assert_allclose(found, dense, rtol=0, atol=1e-10 * np.abs(dense).max())


REVOLUTE, SLOT, SAME_ANGLE, SPEED, MOTION, SLIDE, LINK = KINDS
#: Mechanisms with all there is, in few topologies.
COMPILED = {
    "loads": Recipe(3, (REVOLUTE, SLOT, SAME_ANGLE, SLIDE), LOADS, (), "projection"),
    "ring": Recipe(3, (REVOLUTE, REVOLUTE, LINK, SPEED), LOADS[5:6], (), "baumgarte", seed=1),
    "laws": Recipe(
        2, (MOTION,), (), ((0, 1, False), (1, 2, False), (2, 3, False), (3, 0, False)), "projection"
    ),
    "walls": Recipe(2, (REVOLUTE,), (), ((4, 3, False), (4, 0, False), (0, 0, False)), "baumgarte"),
    "pins on walls": Recipe(2, (LINK,), (), ((4, 1, True), (4, 2, False)), "projection", controlled=True),
}


@pytest.mark.parametrize("called", [False, True], ids=["inline", "called"])
@pytest.mark.parametrize("name", COMPILED)
def test_so_does_machine_code(name: str, called: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "LARGEST_INLINE", 0 if called else kernel.LARGEST_INLINE)
    kernel.source_of.cache_clear()
    for state in range(6):
        assert_alike(replace(COMPILED[name], state=state), compiled=True)
    kernel.source_of.cache_clear()

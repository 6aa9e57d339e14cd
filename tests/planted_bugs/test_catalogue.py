"""Planted bugs fit their files and name tests that exist; what tests judge by tells right from wrong."""

import ast

import pytest

from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.helpers.refusals import require_refusal
from tests.planted_bugs.__main__ import ROOT, read_bugs


def test_every_bug_fits_its_file_changes_what_it_means_and_names_tests_that_exist() -> None:
    bugs = read_bugs()
    assert len({bug.name for bug in bugs}) == len(bugs) <= 120
    for bug in bugs:
        before = (ROOT / bug.file).read_bytes()
        after = bug.plant(before)
        if bug.file.endswith(".py"):
            assert ast.dump(ast.parse(before)) != ast.dump(ast.parse(after)), bug.name
        assert bug.tests, bug.name
        for file, _, name in (test.partition("::") for test in bug.tests):
            path, function = ROOT / file, f"def {name.partition('[')[0]}("
            assert path.exists(), f"{bug.name}: {file}"
            assert not name or function in path.read_text(encoding="utf-8"), f"{bug.name}: {name}"


def test_what_is_no_refusal_is_not_taken_for_one() -> None:
    said = "error: x: expected y\n"
    require_refusal("", said, 2, "expected y")
    for of in (("", said, 1), ("", said, 0), ("1,2\n", said, 2), ("", said[7:], 2), ("", f"{said}more\n", 2)):
        with pytest.raises(AssertionError):
            require_refusal(*of, "expected y")
    with pytest.raises(AssertionError):
        require_refusal("", said, 2, "expected z")


def test_an_order_is_told_from_one_a_tenth_off() -> None:
    steps = (1.0, 0.5, 0.25)
    for order in (1.0, 3.9, 4.0):
        assert slope(steps, [h**order for h in steps]) == pytest.approx(order)
    assert ORDER_TOLERANCE <= 0.05

"""Every planted bug still fits its file, means something, and names tests that exist."""

import ast
from collections import Counter
from functools import cache

import pytest

from tests.planted_bugs.catalogue import ROOT, Bug, bugs
from tests.planted_bugs.planting import as_text

#: Fewer are no measure of the suite.
FEWEST = 120


@cache
def _text(file: str) -> str:
    return (ROOT / file).read_text(encoding="utf-8")


@cache
def _tests_of(file: str) -> set[str]:
    return {node.name for node in ast.walk(ast.parse(_text(file))) if isinstance(node, ast.FunctionDef)}


def test_there_are_enough_and_each_has_a_name_of_its_own() -> None:
    names = Counter(bug.name for bug in bugs())
    assert len(names) >= FEWEST
    assert max(names.values()) == 1, names.most_common(1)


@pytest.mark.parametrize("bug", bugs(), ids=lambda bug: bug.name)
def test_a_bug_fits_its_file_and_changes_what_it_means(bug: Bug) -> None:
    path = ROOT / bug.file
    before = as_text(path.read_bytes(), path)
    after = bug.planted(before)
    if bug.file.endswith(".py"):
        assert ast.dump(ast.parse(before)) != ast.dump(ast.parse(after))


@pytest.mark.parametrize("bug", bugs(), ids=lambda bug: bug.name)
def test_the_tests_that_could_see_a_bug_exist(bug: Bug) -> None:
    assert bug.tests
    assert bug.why
    for test in bug.tests:
        file, _, name = test.partition("::")
        assert not name or name.partition("[")[0] in _tests_of(file), test
        assert (ROOT / file).exists(), test

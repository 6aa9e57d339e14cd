"""Every planted bug still fits its file, means something, and names tests that exist."""

import ast
from collections import Counter
from functools import cache

from tests.planted_bugs.catalogue import ROOT, Inapplicable, bugs
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


def test_every_bug_fits_its_file_changes_what_it_means_and_names_tests_that_exist() -> None:
    wrong = []
    for bug in bugs():
        path = ROOT / bug.file
        before = as_text(path.read_bytes(), path)
        try:
            after = bug.planted(before)
        except Inapplicable as reason:
            wrong.append(str(reason))
            continue
        if bug.file.endswith(".py") and ast.dump(ast.parse(before)) == ast.dump(ast.parse(after)):
            wrong.append(f"{bug.name}: changes nothing")
        if not (bug.tests and bug.why):
            wrong.append(f"{bug.name}: no tests or no reason")
        for test in bug.tests:
            file, _, name = test.partition("::")
            if not (ROOT / file).exists() or (name and name.partition("[")[0] not in _tests_of(file)):
                wrong.append(f"{bug.name}: no test {test}")
    assert not wrong, "\n".join(wrong)

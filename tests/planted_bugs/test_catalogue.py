"""Planted bugs fit their files and name tests that exist."""

import ast

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

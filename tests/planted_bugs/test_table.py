"""The published table tells of every bug which test catches it, and is made of what was found."""

import json

from tests.planted_bugs.catalogue import bugs
from tests.planted_bugs.table import FOUND, TABLE, exists, text


def test_every_bug_was_caught_by_a_test_that_there_is() -> None:
    found = json.loads(FOUND.read_text(encoding="utf-8"))
    assert set(found) == {bug.name for bug in bugs()}, "make planted"
    missed = [name for name, of in found.items() if not exists(of["caught_by"])]
    assert not missed, "make planted"


def test_the_table_is_made_of_what_was_found() -> None:
    """Which files catch none is told below, and changes with every file of tests."""
    found = json.loads(FOUND.read_text(encoding="utf-8"))
    assert (
        TABLE.read_text(encoding="utf-8").partition("## By file")[0] == text(found).partition("## By file")[0]
    )

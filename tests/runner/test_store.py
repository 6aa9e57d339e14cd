"""The rows of a folder: held by one run, never lost, torn or doubled, and of one code."""

import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studies.case import Row
from studies.running.store import FILE, Store
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

ROW: Row = {"study": "s", "engine": "e", "status": "ok", "number": 0.1}


def told(store: Store, **codes: str) -> list[str]:
    """Return the cases of the study whose engines' codes are these."""
    store.describe("s", {"engines": codes})
    return [str(row["case"]) for row in store.results("s")[0]]


def test_a_row_comes_back_as_it_was_with_its_curves_and_the_later_one_counts(tmp_path: Path) -> None:
    curves = {"time_s": np.arange(3.0), "x_m": np.array([0.1, np.nan, -np.inf])}
    row: Row = {**ROW, "tiny": 1e-300, "none": None, "text": "µ\n", "flag": True, "count": 3}
    with Store(tmp_path) as store:
        store.keep("a", "1", {**ROW, "status": "failed"}, {})
        store.keep("a", "1", row, curves)
        store.keep("b", "1", ROW, {})
    with Store(tmp_path) as store:
        assert told(store, e="1") == ["a", "b"]
        assert store.results("s")[0][0] == {"case": "a", **row}
        assert store.statuses() == {"a": "ok", "b": "ok"}
        kept = store.curves("a")
        assert all(np.array_equal(kept[name], curve, equal_nan=True) for name, curve in curves.items())
        assert store.curves("b") == {}


def test_rows_of_an_engines_other_code_do_not_count_and_come_back_with_it(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        store.keep("a", "new", ROW, {})
        store.keep("b", "old", {**ROW, "engine": "f"}, {})
        store.keep("c", "new", {**ROW, "engine": "f"}, {})
        store.keep("d", "new", {**ROW, "study": "other"}, {})
        assert told(store, e="new", f="new") == ["a", "c"]
        assert told(store, e="new", f="old") == ["a", "b"]
        assert told(store, e="other") == []


def test_what_was_killed_from_outside_is_no_result(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        store.keep("a", "1", {**ROW, "status": "killed from outside"}, {})
        assert told(store, e="1") == []


def test_a_held_folder_is_refused_before_any_work_and_can_be_read(tmp_path: Path) -> None:
    with Store(tmp_path) as store, store.held():
        store.keep("a", "1", ROW, {})
        done = crankslider("run", "accuracy", "--out", tmp_path)
        require_refusal(
            done.stdout, done.stderr, done.code, f"no other run holds, got {tmp_path}: wait for it"
        )
        with Store(tmp_path) as reader:
            assert reader.statuses() == {"a": "ok"}
    with Store(tmp_path) as store, store.held():
        pass


DAMAGE: dict[str, Any] = {
    "no database": lambda file: file.write_bytes(b"not ours" * 1000),
    "cut": lambda file: file.write_bytes(file.read_bytes()[:5000]),
    "another's": lambda file: _foreign(file),
}


def _foreign(file: Path) -> None:
    file.unlink()
    with sqlite3.connect(file) as other:
        other.execute("create table row (name text)")


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_file_that_is_none_of_ours_or_damaged_is_refused_in_one_line_and_left_alone(
    tmp_path: Path, damage: Any
) -> None:
    with Store(tmp_path) as store:
        for number in range(200):
            store.keep(str(number), "1", ROW, {"time_s": np.arange(100.0)})
    damage(tmp_path / FILE)
    before = (tmp_path / FILE).read_bytes()
    for command in (("run", "accuracy", "--out", tmp_path), ("report", "--results", tmp_path)):
        done = crankslider(*command)
        require_refusal(done.stdout, done.stderr, done.code, str(tmp_path / FILE))
    assert (tmp_path / FILE).read_bytes() == before


def test_a_full_disk_leaves_no_part_of_a_row(tmp_path: Path) -> None:
    with Store(tmp_path) as store:
        store.keep("a", "1", ROW, {})
        pages = next(iter(store._db.execute("pragma page_count")))[0]
        store._db.execute(f"pragma max_page_count = {pages}")
        with pytest.raises(OSError, match="disk is full"):
            store.keep("b", "1", ROW, {"time_s": np.random.default_rng(0).random(10_000)})
        assert store.statuses() == {"a": "ok"}
        store._db.execute("pragma max_page_count = 100000")
        store.keep("c", "1", ROW, {})
    with Store(tmp_path) as store:
        assert store.statuses() == {"a": "ok", "c": "ok"}

"""The rows of a folder: held by one run, never lost, torn or doubled, set aside with other code."""

import errno
import json
import os
from collections.abc import Mapping
from io import FileIO
from pathlib import Path

import numpy as np
import pytest

from reports.results import BrokenResults, read_study
from studies.running.case import Row
from studies.running.finished_cases import DamagedRows, opened
from studies.running.folder_lock import FolderHeld
from studies.running.whole_file import write_whole
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal
from tests.helpers.row_files import read_rows, write_rows

#: Two fingerprints.
NEW, OLD = "0123456789abcdef", "f" * 16
ARM: Row = {"scene": "s", "engine": "e", "arm": "a", "label": "e (a)"}
HEAD: Row = {**ARM, "step_s": 1.0, "status": "ok", "reason": ""}
CURVES = {"time_s": np.arange(3.0)}


def keep(folder: Path, *keys: str, code: str | Mapping[str, str] = NEW, **row: str | float) -> None:
    """Keep rows, of an engine that is called e unless another is named."""
    with opened(folder, {"e": code} if isinstance(code, str) else code) as rows:
        for key in keys:
            rows.keep(key, {**HEAD, "number": 0.1, **row}, {})


def cases_in(folder: Path, code: str | Mapping[str, str] = NEW) -> list[str]:
    with opened(folder, {"e": code} if isinstance(code, str) else code) as rows:
        return list(rows.statuses())


def test_a_held_folder_is_refused_before_any_work_and_who_has_it_is_said(tmp_path: Path) -> None:
    folder = tmp_path / "energy"
    with opened(folder, {"e": NEW}):
        done = crankslider("run", "agreement", "energy", "--out", tmp_path)
        require_refusal(
            done.stdout, done.stderr, done.code, f"got {folder}, held by process {os.getpid()} on "
        )
        assert not (tmp_path / "agreement/rows.jsonl").exists()
        (folder / "rows.lock").write_text("")  # who holds it may not have said so yet
        with pytest.raises(FolderHeld, match="held by another run: wait"):
            cases_in(folder)
    assert cases_in(folder) == []


def test_rows_of_an_engines_other_code_are_set_aside_and_come_back_with_it(tmp_path: Path) -> None:
    new, newer = {"e": NEW, "f": OLD}, {"e": NEW, "f": "a" * 16}
    keep(tmp_path, "a", code=new)
    keep(tmp_path, "b", code=new, engine="f")
    keep(tmp_path, "c", code=newer, engine="f")
    assert sorted(cases_in(tmp_path, newer)) == ["a", "c"], "what is of one engine's other code goes alone"
    assert sorted(cases_in(tmp_path, new)) == ["a", "b"]
    assert cases_in(tmp_path, {"e": "b" * 16}) == []
    assert len(list(tmp_path.glob("rows.*.jsonl"))) == 3
    assert sorted(cases_in(tmp_path, new)) == ["a", "b"], "from as many files as there are engines"


def test_rows_are_set_aside_beside_those_that_are_there(tmp_path: Path) -> None:
    keep(tmp_path, "a", code=OLD)
    (tmp_path / "rows.jsonl").rename(tmp_path / "away")
    keep(tmp_path, "b", code=OLD)
    (tmp_path / "away").rename(tmp_path / f"rows.{OLD}.jsonl")
    assert cases_in(tmp_path, NEW) == []
    assert cases_in(tmp_path, OLD) == ["a", "b"]


@pytest.mark.parametrize("writes", [0, 1])
def test_rows_set_aside_survive_a_failure_at_any_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writes: int
) -> None:
    keep(tmp_path, "a", "b", code=OLD)
    keep(tmp_path, "c", code=NEW)
    left = [None] * writes

    def write_some(path: Path, content: bytes) -> None:
        if not left:
            raise OSError(errno.ENOSPC, "No space left on device")
        left.pop()
        write_whole(path, content)

    with monkeypatch.context() as patch:
        patch.setattr("studies.running.finished_cases.write_whole", write_some)
        with pytest.raises(OSError, match="No space"):
            cases_in(tmp_path, OLD)
    assert cases_in(tmp_path, OLD) == ["a", "b"]
    assert cases_in(tmp_path, NEW) == ["c"]


def test_a_row_counts_once_and_the_later_one_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keep(tmp_path, "a", "b", status="failed")
    keep(tmp_path, "b")
    file = tmp_path / "rows.jsonl"
    assert [(row["case"], row["status"]) for row in read_rows(file)] == [("a", "failed"), ("b", "ok")]
    once = file.read_bytes()
    file.write_bytes(once * 3)
    results, note = read_study(tmp_path), f"{file}: 4 rows are there twice and count once"
    assert (len(results.rows), results.notes) == (2, (note,))
    assert cases_in(tmp_path) == ["a", "b"]
    assert capsys.readouterr().err == f"note: {note}\n"
    assert file.read_bytes() == once
    row, _ = read_rows(file)
    write_rows(file, [row, {**row, "number": 0.2}])
    with pytest.raises(DamagedRows, match=r"rows\.jsonl:2, got another result"):
        cases_in(tmp_path)
    with pytest.raises(BrokenResults, match=r"rows\.jsonl:2: expected one row of each case"):
        read_study(tmp_path)


DAMAGE = {
    "no JSON": b"not json",
    "not UTF-8": b"\x80",
    "not an object": b"3",
    "no key": b"{}",
    "deep nesting": b'{"case":' + b"[" * 100_000,
    "a number of 5,000 digits": b'{"case": ' + b"1" * 5000 + b"}",
    "no checksum": json.dumps({**HEAD, "case": "b", "fingerprint": NEW}).encode(),
}


@pytest.mark.parametrize("junk", DAMAGE.values(), ids=DAMAGE)
def test_a_line_that_is_no_row_is_refused_by_file_and_number_and_left_alone(
    tmp_path: Path, junk: bytes
) -> None:
    keep(tmp_path, "a")
    file = tmp_path / "rows.jsonl"
    file.write_bytes(before := file.read_bytes() + junk + b"\n")
    with pytest.raises(DamagedRows, match=r"a row of results at .*rows\.jsonl:2, got .*: remove the line"):
        cases_in(tmp_path)
    with pytest.raises(BrokenResults, match=r"rows\.jsonl:2: expected a row"):
        read_study(tmp_path)
    assert file.read_bytes() == before


def test_an_edited_number_is_refused_and_told_by_the_command(tmp_path: Path) -> None:
    keep(tmp_path / "agreement", "a", "b")
    file = tmp_path / "agreement/rows.jsonl"
    file.write_text(file.read_text().replace("0.1", "0.2", 1))
    report = ("report", "--results", tmp_path, "--out", tmp_path / "report")
    for command in (("run", "agreement", "--out", tmp_path), report):
        done = crankslider(*command)
        require_refusal(done.stdout, done.stderr, done.code, f"{file}:1", "checksum")


@pytest.mark.parametrize("damage", ["cut", "emptied", "gone", "another's", "as NumPy reads it"])
def test_curves_that_are_not_those_of_their_row_are_made_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], damage: str
) -> None:
    curves = {"a": CURVES, "b": {"time_s": np.arange(4.0)}}
    with opened(tmp_path, {"e": NEW}) as rows:
        for key in curves:
            rows.keep(key, HEAD, curves[key])
    file, other = (tmp_path / "curves" / f"{key}.npz" for key in curves)
    whole = file.read_bytes()
    if damage == "gone":
        file.unlink()
    elif damage == "as NumPy reads it":
        np.savez(file, time_s=np.arange(3.0))
    else:
        file.write_bytes({"cut": whole[:-9], "emptied": b"", "another's": other.read_bytes()}[damage])
    with pytest.raises(BrokenResults, match=r"a\.npz: expected the curves of a finished run"):
        read_study(tmp_path).curve("a", "time_s")
    assert read_study(tmp_path).curve("b", "time_s").tolist() == [0.0, 1.0, 2.0, 3.0]
    with opened(tmp_path, {"e": NEW}) as rows:
        assert (rows.lacks("a", False), rows.lacks("b", False)) == (True, False)
        rows.keep("a", HEAD, curves["a"])
    assert "1 cases have not the curves that they had: they are run again" in capsys.readouterr().err
    assert file.read_bytes() == whole


@pytest.mark.system
def test_a_sidecar_is_of_the_rows_that_a_finished_run_left_and_is_not_trusted(tmp_path: Path) -> None:
    """The smallest study there is, by the command."""
    command = ("run", "agreement", "--engine", "scipy", "--jobs", 1, "--out", tmp_path)
    assert crankslider(*command).code == 0
    folder = tmp_path / "agreement"
    sidecar, rows = folder / "sidecar.json", (folder / "rows.jsonl").read_bytes()
    first = read_study(folder)
    assert (first.notes, first.sidecar and first.sidecar["set"]) == ((), "quick")
    (folder / "rows.jsonl").write_bytes(rows[rows.index(b"\n") + 1 :])
    cut = read_study(folder)
    assert cut.sidecar is None
    assert "rows are not those that the last finished run left; run `crankslider run`" in cut.notes[0]
    written = sidecar.read_bytes()
    for damaged in (written.replace(b"quick", b"quack"), written[:-9], b"[]", b"\xff"):
        sidecar.write_bytes(damaged)
        with pytest.raises(BrokenResults, match=r"sidecar\.json: expected what a run wrote"):
            read_study(folder)
    assert crankslider(*command).code == 0
    again = read_study(folder)
    assert (again.notes, again.sidecar) == ((), first.sidecar)
    assert sorted((folder / "rows.jsonl").read_bytes().splitlines()) == sorted(rows.splitlines())


def test_a_report_leaves_out_what_was_killed_from_outside(tmp_path: Path) -> None:
    keep(tmp_path, "a")
    keep(tmp_path, "b", status="killed from outside")
    results = read_study(tmp_path)
    assert list(results.rows["case"]) == ["a"]
    assert "1 cases were killed from outside" in results.notes[0]


def half(file: FileIO, content: bytes) -> None:
    file.write(content[: len(content) // 2])
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("where", ["finished_cases", "whole_file"])
def test_a_full_disk_leaves_no_part_of_a_row_or_of_its_curves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    with opened(tmp_path, {"e": NEW}) as rows:
        rows.keep("a", HEAD, CURVES)
        before = (tmp_path / "rows.jsonl").read_bytes()
        with monkeypatch.context() as patch:
            patch.setattr(f"studies.running.{where}.write_through", half)
            with pytest.raises(OSError, match="No space"):
                rows.keep("b", HEAD, CURVES)
        assert (tmp_path / "rows.jsonl").read_bytes() == before
        assert list(rows.statuses()) == ["a"]
        assert list(tmp_path.rglob("*.new")) == []
        rows.keep("c", HEAD, CURVES)
    (tmp_path / "curves/d.npz.new").touch()  # as a kill leaves it
    assert cases_in(tmp_path) == ["a", "c"]
    whole = {path.name for path in (tmp_path / "curves").iterdir()}
    assert whole == {"a.npz", "c.npz"} | ({"b.npz"} if where == "finished_cases" else set())

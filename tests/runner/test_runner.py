"""Finished cases are kept, runs resume, and what becomes of a case is a row that says who failed."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from engine_models.arms import Arm
from engine_models.engine import RunSettings
from engine_models.scene.library import ideal_free
from studies import case as cases_module
from studies import extremes
from studies.case import Case, Row, code_of, project_code, run_case
from studies.failures import Failed
from studies.running.runner import Call, lacks
from studies.running.store import LOCK, Store
from studies.running.workers import KILLED
from tests.helpers.mischief import NAME, steady
from tests.helpers.running import gone, rows_in, run_in, started, until

GALLERY = {(case.engine, case.arm.name, case.scene.name): case for case in extremes.cases(full=True)}
CASES = 15


def case(engine: str = "reference", step: float = 1e-3, end: float = 0.02, **settings: int | str) -> Case:
    scene = ideal_free().model_copy(update={"end_time_s": end})
    return Case("accuracy", scene, Arm(engine, "arm", settings), RunSettings(step, 4))


def test_a_run_resumes_with_what_is_new_and_counts_what_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = [case(), case("scipy", max_evaluations=5)]  # of which the last fails
    first = run_in(tmp_path, cases)
    assert capsys.readouterr().err.endswith("accuracy: 2 cases, 1 failed\n")
    again = run_in(tmp_path, [*cases, case(step=5e-4)])
    assert sorted(str(row["status"]) for row in again) == ["failed", "ok", "ok"]
    assert all(row in again for row in first), "with their times: they are not run again"
    row = next(row for row in first if row["status"] == "ok")
    with Store(tmp_path) as store:
        curves = store.curves(str(row["case"]))
    assert curves["slider_position_error_m"].max() == row["slider_position_error_m"]


@pytest.mark.parametrize(
    ("engine", "arm", "scene", "status", "exception", "reason"),
    [
        ("exudyn", "default", "rigid e = 0", "unsupported", "UnsupportedScene", "has no rigid contact"),
        ("scipy", "default", "rigid e = 0.5", "failed", "AdapterCannot", "bounces accumulate at t = "),
        ("pymunk", "tuned", "step at the limit", "failed", "SimulationFailed", "pin through the wall"),
        ("scipy", "default", "rod inertia 0", "unsupported", "ImpossibleScene", "no such scene"),
        ("pymunk", "tuned", "joint A open by 1 mm", "unsupported", "ImpossibleScene", "no such scene"),
    ],
)
def test_a_row_without_a_run_says_who_failed(
    engine: str, arm: str, scene: str, status: str, exception: str, reason: str
) -> None:
    row, curves = run_case(GALLERY[engine, arm, scene])
    assert (row["status"], row["exception"], curves) == (status, exception, {})
    assert reason in str(row["reason"])


def test_a_process_with_other_code_breaks_the_run() -> None:
    call = Call("key", case())
    call.code = "0" * 16
    other = rf"a process has other code or libraries \({code_of('reference')}\) than the run \(0{{16}}\)"
    with pytest.raises(Failed, match=other):
        call.answer()


def test_equal_cases_have_equal_keys_and_every_change_another(monkeypatch: pytest.MonkeyPatch) -> None:
    assert case().key == case().key
    heavier = replace(case(), scene=ideal_free().replace({"end_time_s": 0.02, "rod.mass_kg": 0.3}))
    others = [case("exudyn"), case(step=2e-3), case(iterations=3), case(end=0.03), heavier]
    others += [replace(case(), **changes) for changes in ({"timed": True}, {"limit_s": 1.0})]
    keys = {each.key for each in (case(), *others)}
    assert len(keys) == 8
    monkeypatch.setattr(cases_module, "code_of", lambda _: "other code")
    assert case().key not in keys


def test_the_code_is_every_file_that_decides_a_number_and_the_versions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = code_of("reference")
    for name in cases_module.CODE:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(cases_module.ROOT / name, tmp_path / name, ignore=ignored)
    monkeypatch.setattr(cases_module, "ROOT", tmp_path)

    def now() -> str:
        for each in (project_code, code_of, cases_module.versions):
            each.cache_clear()
        return code_of("reference")

    assert now() == before
    for file in ("reference_solver/equations.py", "studies/judges/metrics.py", "studies/gallery.toml"):
        with (tmp_path / file).open("a", encoding="utf-8") as end:
            end.write("# other\n")
        assert now() != before, file
        before = now()
    monkeypatch.setattr(cases_module, "version", lambda _: "0")
    assert now() != before
    monkeypatch.undo()
    now()


def test_what_is_run_again_depends_on_how_it_ended() -> None:
    """By how a case ended: whether a run that resumes makes it, and one that retries failures."""
    expected: dict[str | None, tuple[bool, bool]] = {
        None: (True, True),
        "ok": (False, False),
        "unsupported": (False, False),
        **dict.fromkeys(("failed", "timed out", "out of memory", "crashed"), (False, True)),
        KILLED: (True, True),
    }
    assert {status: (lacks(status, False), lacks(status, True)) for status in expected} == expected


of_processes = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


def measured(out: Path) -> list[dict[str, Any]]:
    return [steady(row) for row in rows_in(out)]


@pytest.mark.system
def test_a_run_killed_again_and_again_ends_with_the_rows_of_one_left_alone(tmp_path: Path) -> None:
    killed, alone = tmp_path / "killed", tmp_path / "alone"
    earlier: list[Row] = []
    for n in (1, 6):
        with started(killed) as run:
            until(lambda n=n: len(rows_in(killed)) >= n)  # type: ignore[misc]
            run.kill()
        assert all(row in rows_in(killed) for row in earlier)
        earlier = rows_in(killed)
    for out in (killed, alone):
        with started(out) as run:
            _, stderr = run.communicate(timeout=60)
        assert (run.returncode, f"{NAME}: {CASES} cases, 1 crashed\n" in stderr) == (0, True), stderr
    assert all(row in rows_in(killed) for row in earlier), "finished cases are not run again"
    assert measured(killed) == measured(alone)


@contextmanager
def hanging(folder: Path) -> Iterator[tuple["subprocess.Popen[str]", list[int]]]:
    """Start a run of two cases that end and two that never will; give it and its workers when it hangs."""
    files = [folder / f"pid{n}" for n in range(2)]
    with started(folder, HANG_IN=str(folder)) as run:
        until(lambda: len(rows_in(folder)) == 2 and all(file.exists() and file.read_text() for file in files))
        yield run, [int(file.read_text()) for file in files]


@pytest.mark.system
@of_processes
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_that_hangs_with_one_word_and_keeps_what_was_finished(
    tmp_path: Path, number: signal.Signals
) -> None:
    with hanging(tmp_path) as (run, workers):
        os.killpg(run.pid, number)  # as a terminal or a supervisor does: to the workers too
        _, stderr = run.communicate(timeout=30)
    assert run.returncode == 130
    assert stderr.endswith("error: interrupted\n")
    assert "Traceback" not in stderr
    assert all(gone(pid) for pid in workers)
    assert [row["status"] for row in measured(tmp_path)] == ["ok", "ok"]


@pytest.mark.system
@of_processes
def test_workers_that_hang_in_native_code_do_not_survive_their_parent(tmp_path: Path) -> None:
    with hanging(tmp_path) as (run, workers):
        assert not any(gone(pid) for pid in workers)
        held = [os.readlink(file) for pid in workers for file in Path(f"/proc/{pid}/fd").iterdir()]
        assert str(tmp_path / LOCK) not in held, "they do not hold the folder"
        run.kill()
        until(lambda: all(gone(pid) for pid in workers))
    assert [row["status"] for row in measured(tmp_path)] == ["ok", "ok"]

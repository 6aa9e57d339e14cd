"""The runner keeps every finished case and resumes; what becomes of a case is a row that says who failed."""

from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine_models.arms import Arm
from engine_models.engine import RunSettings
from engine_models.scene.library import ideal_free
from studies import extremes
from studies.running import runner
from studies.running.case import Case
from studies.running.execution import CRASHED, CaseEnded, Limits, RunBroken
from studies.running.outcome import ended, run_case
from studies.running.processes import Processes
from studies.running.provenance import fingerprint
from studies.running.runner import run_study
from tests.helpers import mischief
from tests.helpers.row_files import read_rows

GALLERY = {(case.engine, case.arm.name, case.scene.name): case for case in extremes.cases(full=True)}


def in_process() -> Executor:
    return ThreadPoolExecutor(1)


def refused() -> Executor:
    raise AssertionError("there was nothing left to run")


def case(engine: str = "reference", step: float = 1e-3, end: float = 0.02, **settings: int | str) -> Case:
    scene = ideal_free().model_copy(update={"end_time_s": end})
    return Case("agreement", scene, Arm(engine, "arm", settings), RunSettings(step, 4))


def test_a_run_resumes_with_what_is_new_and_what_a_kill_cut_short_and_counts_what_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rows.jsonl"
    cases = [case(), case("pymunk", end=0.5, joints="all", iterations=2)]  # of which the last fails
    for executor in (in_process, refused):
        run_study("agreement", cases, tmp_path, executor)
        assert capsys.readouterr().err.endswith("agreement: 2 cases, 1 failed\n")
    first = file.read_text()
    run_study("agreement", [*cases, case(step=5e-4)], tmp_path, in_process)
    whole = file.read_text()
    assert whole.startswith(first)
    assert [row["status"] for row in read_rows(file)] == ["ok", "failed", "ok"]
    file.write_text(whole[:-40])
    run_study("agreement", [*cases, case(step=5e-4)], tmp_path, in_process)
    assert file.read_text() == whole


def test_a_row_has_its_curves_beside_it_and_its_largest_errors_are_theirs(tmp_path: Path) -> None:
    run_study("agreement", [case()], tmp_path, in_process)
    (row,) = read_rows(tmp_path / "rows.jsonl")
    with np.load(tmp_path / "curves" / f"{row['case']}.npz") as curves:
        assert curves["slider_position_error_m"].max() == row["slider_position_error_m"]
        assert curves["time_s"].shape == (5,)
        assert not [name for name in (*row, *curves) if "torque" in name], "nothing drives it"


@pytest.mark.parametrize(
    ("engine", "arm", "scene", "status", "exception", "reason"),
    [
        ("reference", "plain RK4", "L = r through the fold", "failed", "EngineFailed", "have rank 8 of 9 at"),
        ("exudyn", "default", "rigid e = 0", "unsupported", "UnsupportedScene", "has no rigid contact"),
        ("scipy", "default", "rigid e = 0.5", "failed", "AdapterCannot", "bounces accumulate at t = "),
        ("pymunk", "tuned", "slider mass × 1e-6", "failed", "SimulationFailed", "constraints lost"),
        ("pymunk", "tuned", "step at the limit", "failed", "SimulationFailed", "pin through the wall"),
        ("scipy", "default", "rod inertia 0", "unsupported", "ImpossibleScene", "no such scene"),
        ("pymunk", "tuned", "joint A open by 1 mm", "failed", "ImpossibleStart", "start: ideal joints"),
    ],
)
def test_a_row_without_a_run_says_who_failed(
    engine: str, arm: str, scene: str, status: str, exception: str, reason: str
) -> None:
    row, curves = run_case(GALLERY[engine, arm, scene])
    assert (row["status"], row["exception"], curves) == (status, exception, {})
    assert reason in str(row["reason"])


def test_a_process_that_ended_is_no_exception_of_an_engine() -> None:
    row = ended(CRASHED, CaseEnded(CRASHED, "killed by SIGSEGV"))
    assert row == {"status": CRASHED, "reason": "killed by SIGSEGV", "exception": "CaseEnded"}


def test_a_process_with_other_code_breaks_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "fingerprint", lambda *_: "0" * 16)
    ours = fingerprint("agreement", "reference")
    other = rf"a process has other code or libraries \({ours}\) than the run \(0{{16}}\)"
    with pytest.raises(RunBroken, match=other):
        run_study("agreement", [case()], tmp_path, lambda: Processes(1))


def test_a_bug_of_a_study_breaks_the_run_and_is_named(tmp_path: Path) -> None:
    bug = r"mischief \(bug\) on ideal-free: bug at helpers/mischief.py:\d+: Key"
    with pytest.raises(RunBroken, match=bug):
        run_study(mischief.NAME, [mischief.case("bug")], tmp_path, in_process)


def test_a_row_tells_what_limits_it_had_and_whether_it_was_timed() -> None:
    assert not {"timed", "time_limit_s", "memory_limit_bytes"} & set(case().head())
    head = replace(case(), timed=True, limits=Limits(1.5, 10**8)).head()
    assert (head["timed"], head["time_limit_s"], head["memory_limit_bytes"]) == (True, 1.5, 10**8)


def test_equal_cases_have_equal_keys_and_every_change_another() -> None:
    key: Callable[[Case], str] = lambda c: c.key("code")  # noqa: E731
    assert key(case()) == key(case())
    limits = (Limits(1, 10**8), Limits(2, 10**8), Limits(1, 10**9))
    others = [case("exudyn"), case(step=2e-3), case(iterations=3), replace(case(), timed=True)]
    others += [case(end=0.03), *(replace(case(), limits=limit) for limit in limits)]
    assert len({key(c) for c in (case(), *others)}) == 9
    assert case().key("code") != case().key("other code")

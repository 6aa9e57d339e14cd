"""The runner keeps every finished case, resumes, and records failures as rows."""

import os
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine_models.arms import Arm
from engine_models.engine import RunSettings
from engine_models.scene.library import ideal_free
from engine_models.scene.scene import Clearance, Clearances
from studies import agreement
from studies.running import runner
from studies.running.case import Case
from studies.running.execution import Limits, RunBroken
from studies.running.outcome import run_case
from studies.running.processes import Processes
from studies.running.provenance import fingerprint
from studies.running.runner import Lanes, run_study
from tests.helpers.row_files import read_rows


def in_process() -> Executor:
    return ThreadPoolExecutor(1)


def case(engine: str = "reference", step: float = 1e-3, **settings: int) -> Case:
    scene = ideal_free().model_copy(update={"end_time_s": 0.02})
    return Case("agreement", scene, Arm(engine, "arm", settings), RunSettings(step, 4))


def few_sweeps() -> Case:
    """Return a case that fails."""
    longer = ideal_free().model_copy(update={"end_time_s": 0.5})
    arm = Arm("pymunk", "arm", {"joints": "all", "iterations": 2})
    return Case("agreement", longer, arm, RunSettings(1e-3, 4))


def rows(folder: Path) -> list[dict[str, Any]]:
    return read_rows(folder / "rows.jsonl")


def refused() -> Executor:
    raise AssertionError("there was nothing left to run")


def test_a_second_run_does_nothing_and_a_longer_list_only_what_is_new(tmp_path: Path) -> None:
    cases = [case(step=h) for h in (1e-3, 5e-4)]
    run_study("agreement", cases, tmp_path, in_process)
    first = (tmp_path / "rows.jsonl").read_text()
    run_study("agreement", cases, tmp_path, refused)
    assert (tmp_path / "rows.jsonl").read_text() == first
    run_study("agreement", [*cases, case(step=2.5e-4)], tmp_path, in_process)
    assert (tmp_path / "rows.jsonl").read_text().startswith(first)
    assert [row["status"] for row in rows(tmp_path)] == ["ok"] * 3


def test_a_line_cut_short_by_a_kill_is_run_again_and_gives_the_same_row(tmp_path: Path) -> None:
    run_study("agreement", [case(), case(step=5e-4)], tmp_path, in_process)
    whole = (tmp_path / "rows.jsonl").read_text()
    (tmp_path / "rows.jsonl").write_text(whole[: len(whole) - 40])
    run_study("agreement", [case(), case(step=5e-4)], tmp_path, in_process)
    assert (tmp_path / "rows.jsonl").read_text() == whole


def test_a_process_with_other_code_breaks_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "fingerprint", lambda *_: "0" * 16)
    ours = fingerprint("agreement", "reference")
    other = rf"a process has other code or libraries \({ours}\) than the run \(0{{16}}\)"
    with pytest.raises(RunBroken, match=other):
        run_study("agreement", [case()], tmp_path, lambda: Processes(1))


def test_a_failure_and_a_refusal_are_rows_with_a_reason() -> None:
    row, curves = run_case(few_sweeps())
    assert (row["status"], curves) == ("failed", {})
    assert "t = " in str(row["reason"])
    rigid = Clearance(radial_clearance_m=5e-4, bearing_radius_m=0.01, law="rigid", restitution=0.9)
    scene = ideal_free().model_copy(update={"clearance": Clearances(B=rigid)})
    row, _ = run_case(Case("agreement", scene, Arm("exudyn", "arm"), RunSettings(1e-3, 4)))
    assert row["status"] == "unsupported"
    assert "clearance" in str(row["reason"])


def test_a_row_tells_what_limits_it_had_and_whether_it_was_timed() -> None:
    assert not {"timed", "time_limit_s", "memory_limit_bytes"} & set(case().head())
    head = replace(case(), timed=True, limits=Limits(1.5, 10**8)).head()
    assert (head["timed"], head["time_limit_s"], head["memory_limit_bytes"]) == (True, 1.5, 10**8)


def test_the_last_line_counts_what_failed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):  # run, then found there
        run_study("agreement", [case(), few_sweeps()], tmp_path, in_process)
        assert capsys.readouterr().err.endswith("agreement: 2 cases, 1 failed\n")


def test_a_row_has_its_curves_beside_it_and_its_largest_errors_are_theirs(tmp_path: Path) -> None:
    run_study("agreement", [case()], tmp_path, in_process)
    (row,) = rows(tmp_path)
    with np.load(tmp_path / "curves" / f"{row['case']}.npz") as curves:
        assert curves["slider_position_error_m"].max() == row["slider_position_error_m"]
        assert curves["time_s"].shape == (5,)


def test_equal_cases_have_equal_keys_and_every_change_another() -> None:
    key: Callable[[Case], str] = lambda c: c.key("code")  # noqa: E731
    assert key(case()) == key(case())
    limits = (Limits(1, 10**8), Limits(2, 10**8), Limits(1, 10**9))
    others = [case("exudyn"), case(step=2e-3), case(iterations=3), replace(case(), timed=True)]
    others += [replace(case(), limits=limit) for limit in limits]
    assert len({key(c) for c in (case(), *others)}) == 8
    assert case().key("code") != case().key("other code")


def test_a_free_scene_has_no_driver_torque_and_the_full_set_contains_the_quick_one() -> None:
    row, curves = run_case(case())
    assert not [name for name in (*row, *curves) if "torque" in name]
    quick, full = ({c.key("") for c in agreement.cases(which)} for which in (False, True))
    assert quick < full


def process_of(_: Case) -> int:
    return os.getpid()


def test_studies_run_in_two_lanes_and_the_last_two_in_both() -> None:
    names = ["agreement", "clearance", "energy", "predictability", "stability", "extremes"]
    with Lanes(2, names) as lanes:
        calls = {
            name: [lanes.submit(process_of, replace(case(), study=name)) for _ in range(4)] for name in names
        }
        ran_in = {name: {call.result() for call in of} for name, of in calls.items()}
    assert ran_in["agreement"] == ran_in["energy"] != ran_in["clearance"] == ran_in["predictability"]
    assert len(ran_in["agreement"]) == len(ran_in["clearance"]) == 1
    assert ran_in["stability"] == ran_in["extremes"] == ran_in["agreement"] | ran_in["clearance"]
    with Lanes(2, names[:3]) as lanes:
        calls_of_three = [lanes.submit(process_of, case()) for _ in range(4)]
        assert len({call.result() for call in calls_of_three}) == 2, "an odd one has no lane of its own"

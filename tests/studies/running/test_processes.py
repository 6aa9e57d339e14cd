"""Cases in processes of their own: what an engine does to its process is a row, and no other's affair."""

import os
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Executor, Future
from pathlib import Path
from typing import Any

import pytest

from engine_models.arms import Arm
from engine_models.engine import RunSettings
from studies.running import runner
from studies.running.case import Case
from studies.running.execution import CaseEnded, Limits, RunBroken
from studies.running.outcome import run_case
from studies.running.processes import Processes
from studies.running.runner import run_study
from studies.running.worker import _memory_limited
from tests.helpers.mischief import MEGABYTE, NAME, case
from tests.helpers.row_files import read_rows

pytestmark = pytest.mark.system

AMPLE = Limits(time_limit_s=60, memory_limit_bytes=200 * MEGABYTE)
HASTY = Limits(time_limit_s=0.5, memory_limit_bytes=200 * MEGABYTE)


def two() -> Executor:
    return Processes(2)


def run(folder: Path, *cases: Case) -> list[dict[str, Any]]:
    run_study(NAME, list(cases), folder, two, two)
    return read_rows(folder / "rows.jsonl")


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits are for Linux")
def test_whatever_an_engine_does_within_limits_is_a_row_with_a_reason(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    expected = {
        "abort": ("crashed", "killed by SIGABRT"),
        "segmentation fault": ("crashed", "killed by SIGSEGV"),
        "exit": ("crashed", "ended with exit code 3"),
        "hang": ("timed out", "not finished within the limit of 0.5 s"),
        "eat memory": ("out of memory", "(limit 200000000 bytes)"),
        "bad_alloc": ("out of memory", "killed by SIGABRT: terminate called after throwing"),
        "noise": ("ok", ""),
        "work": ("ok", ""),
    }
    hang = case("hang", limits=HASTY, pid_file=str(tmp_path / "pid"))
    rows = run(tmp_path, *(hang if arm == "hang" else case(arm, limits=AMPLE) for arm in expected))
    outcomes = {row["arm"]: (row["status"], row["reason"]) for row in rows}
    assert set(outcomes) == set(expected)
    for arm, (status, reason) in expected.items():
        assert outcomes[arm][0] == status, outcomes[arm]
        assert reason in outcomes[arm][1]
    assert rows[0]["time_limit_s"] in (0.5, 60)
    out, err = capfd.readouterr()
    assert out == ""
    assert "noise" not in err
    assert f"{NAME}: 8 cases, 3 crashed, 2 out of memory, 1 timed out" in err


def test_a_crash_without_limits_is_a_row_and_the_others_go_on(tmp_path: Path) -> None:
    cases = [case("work", 0), case("abort"), *(case("work", n) for n in range(1, 5))]
    rows = run(tmp_path, *cases)
    assert sorted(row["status"] for row in rows) == ["crashed"] + ["ok"] * 5
    assert rows == run(tmp_path, *cases), "nothing was left to run"


def test_a_case_does_not_answer_for_the_damage_of_another() -> None:
    with Processes(1) as pool:
        futures = [pool.submit(run_case, case(arm)) for arm in ("spoil", "be spoilt", "abort")]
        spoiler, spoilt = (future.result()[0] for future in futures[:2])
        assert (spoiler["status"], spoilt["status"]) == ("ok", "ok")
        assert spoiler["pid"] != spoilt["pid"]
        assert isinstance(futures[2].exception(), CaseEnded)


def test_memory_held_by_one_case_does_not_count_against_another() -> None:
    with Processes(1) as pool:
        cases = [case("hold memory", n, AMPLE) for n in range(3)]
        rows = [pool.submit_within(c.limits, run_case, c).result()[0] for c in cases]
    assert [row["status"] for row in rows] == ["ok"] * 3, "three times 150 MB under a limit of 200 MB"
    assert len({row["pid"] for row in rows}) == 1


def test_timed_cases_run_alone_in_order_in_one_process(tmp_path: Path) -> None:
    timed = [case("work", n, timed=True) for n in (7, 3, 5)]
    rows = run(tmp_path, *timed[:2], case("work"), case("work", 1, AMPLE), case("work", 2), timed[2])
    assert [row["samples"] for row in rows if row.get("timed")] == [8, 4, 6]
    assert [bool(row.get("timed")) for row in rows] == [False] * 3 + [True] * 3
    assert len({row["pid"] for row in rows[3:]} - {os.getpid()}) == 1
    beside = max(row["ended"] for row in rows[:3])
    for row in rows[3:]:
        assert beside <= row["began"]
        beside = row["ended"]


def test_a_bug_of_a_study_stops_the_run_and_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        RunBroken, match=r"mischief \(bug\) on ideal-free: bug at helpers/mischief.py:\d+: Key"
    ):
        run(tmp_path, case("bug"))


def test_every_case_has_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "ROOMY", Limits(1, 200 * MEGABYTE))
    hangs = [case("hang", n, timed=n == 1, pid_file=str(tmp_path / "pid")) for n in range(2)]
    outcomes = [(row["arm"], row["status"]) for row in run(tmp_path, *hangs)]
    assert outcomes == [("hang", "timed out")] * 2


def _soft_limit_under(lower: int) -> int:
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (lower, resource.RLIM_INFINITY))
    with _memory_limited(1000 * lower):
        return resource.getrlimit(resource.RLIMIT_DATA)[0]


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits are for Linux")
def test_a_limit_on_memory_does_not_lift_one_that_is_there() -> None:
    with Processes(1) as pool:
        assert pool.submit(_soft_limit_under, 10_000 * MEGABYTE).result() == 10_000 * MEGABYTE


def test_a_case_killed_once_from_outside_is_run_again_alone(tmp_path: Path) -> None:
    killed = case("be killed once", been_file=str(tmp_path / "been"))
    rows = run(tmp_path, killed, *(case("work", n) for n in range(4)))
    assert {row["status"] for row in rows} == {"ok"}
    assert rows[-1]["arm"] == "be killed once"
    assert max(row["ended"] for row in rows[:-1]) <= rows[-1]["began"]


def test_the_next_run_tries_again_what_was_killed_and_what_failed_if_asked_for(tmp_path: Path) -> None:
    # Not "abort once": behind "work", in a process that is not new, it would be run again at once.
    mended = tmp_path / "mended"
    cases = [
        case("be killed twice", been_file=str(tmp_path / "killed")),
        case("abort until mended", mended_file=str(mended)),
        case("work"),
    ]
    rows = run(tmp_path, *cases)
    first = {row["arm"]: (row["status"], row["reason"]) for row in rows}
    killed, crashed = ("killed from outside", "killed by SIGKILL"), ("crashed", "killed by SIGABRT")
    assert first == {"be killed twice": killed, "abort until mended": crashed, "work": ("ok", "")}
    second = {row["arm"]: (row["status"], row["reason"]) for row in run(tmp_path, *cases)}
    assert second == {**first, "be killed twice": ("ok", "")}
    mended.touch()
    run_study(NAME, cases, tmp_path, two, retry_failed=True)
    third = read_rows(tmp_path / "rows.jsonl")
    assert sorted(row["arm"] for row in third if row["status"] == "ok") == sorted(first)
    assert [row for row in third if row["arm"] == "work"] == [row for row in rows if row["arm"] == "work"]


class _Deadly(Case):
    def __reduce__(self) -> tuple[Callable[[int], None], tuple[int]]:
        return os._exit, (4,)


def deadly(number: int) -> Case:
    return _Deadly(NAME, case("work").scene, Arm("mischief", "deadly"), RunSettings(1e-3, number + 1))


def test_a_process_that_dies_as_it_begins_does_not_end_the_run(tmp_path: Path) -> None:
    rows = run(tmp_path, deadly(0), deadly(1), case("work"))
    outcomes = {row["arm"]: (row["status"], row["reason"]) for row in rows}
    assert outcomes == {"work": ("ok", ""), "deadly": ("not begun", "ended with exit code 4")}


def test_processes_that_cannot_begin_break_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunBroken, match="no process can begin: ended with exit code 4"):
        run(tmp_path, *map(deadly, range(4)))


def test_a_cancelled_executor_kills_what_hangs_and_starts_nothing(tmp_path: Path) -> None:
    pool = Processes(1)
    file = tmp_path / "pid"
    futures: list[Future[Any]] = [pool.submit(run_case, case("hang", pid_file=str(file)))]
    futures.append(pool.submit(run_case, case("work")))
    while not (file.exists() and file.read_text()):
        time.sleep(0.02)
    pool.shutdown(cancel_futures=True)
    assert isinstance(futures[0].exception(timeout=0), CaseEnded | CancelledError)
    assert futures[1].cancelled()
    with pytest.raises(ProcessLookupError):
        os.kill(int(file.read_text()), 0)
    with pytest.raises(RuntimeError, match="after shutdown"):
        pool.submit(run_case, case("work"))


def test_ctrl_c_does_not_reach_the_processes() -> None:
    with Processes(1) as pool:
        assert signal.SIGINT in pool.submit(signal.pthread_sigmask, signal.SIG_BLOCK, []).result()

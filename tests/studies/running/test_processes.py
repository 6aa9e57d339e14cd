"""Cases in processes of their own: what an engine does to its process is a row, and no other's affair."""

import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Executor
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from engine_models.arms import Arm
from engine_models.engine import RunSettings
from studies.running import runner
from studies.running.case import Case
from studies.running.execution import CaseEnded, Limits, RunBroken
from studies.running.outcome import run_case
from studies.running.processes import SAFE_PATH, Processes
from studies.running.runner import run_study
from tests.helpers.mischief import MEGABYTE, NAME, case
from tests.helpers.row_files import read_rows

pytestmark = pytest.mark.system

AMPLE = Limits(time_limit_s=60, memory_limit_bytes=200 * MEGABYTE)
HASTY = Limits(time_limit_s=0.5, memory_limit_bytes=200 * MEGABYTE)


def run(folder: Path, *cases: Case, jobs: int = 1, **how: Any) -> list[dict[str, Any]]:
    def processes() -> Executor:
        return Processes(jobs)

    run_study(NAME, list(cases), folder, processes, processes, **how)
    return read_rows(folder / "rows.jsonl")


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits are for Linux")
def test_whatever_an_engine_does_is_a_row_with_a_reason_and_the_others_go_on(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
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
    out, err = capfd.readouterr()
    assert out == ""
    assert "noise" not in err
    assert f"{NAME}: 8 cases, 3 crashed, 2 out of memory, 1 timed out" in err
    monkeypatch.setattr(runner, "ROOMY", Limits(1, 200 * MEGABYTE))
    hangs = [case("hang", n, timed=n == 1, pid_file=str(tmp_path / "pid")) for n in (1, 2)]
    assert [row["status"] for row in run(tmp_path / "of all", *hangs)] == ["timed out"] * 2, "without limits"


def test_a_case_does_not_answer_for_what_another_did_or_holds() -> None:
    """Three times 150 MB are held under a limit of 200 MB."""
    with Processes(1) as pool:
        futures = [pool.submit(run_case, case(arm)) for arm in ("spoil", "be spoilt", "abort")]
        holding = [case("hold memory", n, AMPLE) for n in range(3)]
        held = [pool.submit_within(c.limits, run_case, c).result()[0] for c in holding]
        spoiler, spoilt = (future.result()[0] for future in futures[:2])
        assert isinstance(futures[2].exception(), CaseEnded)
    assert [row["status"] for row in (spoiler, spoilt, *held)] == ["ok"] * 5
    assert spoiler["pid"] != spoilt["pid"]
    assert len({row["pid"] for row in held}) == 1


def test_timed_cases_run_alone_in_order_in_one_process(tmp_path: Path) -> None:
    timed = [case("work", n, timed=True) for n in (7, 3, 5)]
    rows = run(tmp_path, *timed[:2], case("work"), case("work", 1, AMPLE), case("work", 2), timed[2], jobs=2)
    assert [row["samples"] for row in rows if row.get("timed")] == [8, 4, 6]
    assert [bool(row.get("timed")) for row in rows] == [False] * 3 + [True] * 3
    assert len({row["pid"] for row in rows[3:]} - {os.getpid()}) == 1
    beside = max(row["ended"] for row in rows[:3])
    for row in rows[3:]:
        assert beside <= row["began"]
        beside = row["ended"]


def test_what_was_killed_is_tried_again_and_what_failed_if_asked_for(tmp_path: Path) -> None:
    """Killed once, it runs again at once, alone; killed twice, with the next run."""
    mended = tmp_path / "mended"
    cases = [
        case("be killed once", been_file=str(tmp_path / "once")),
        case("be killed twice", been_file=str(tmp_path / "twice")),
        case("abort until mended", mended_file=str(mended)),
        *(case("work", n) for n in range(3)),
    ]
    rows = run(tmp_path, *cases, jobs=2)
    first = {row["arm"]: (row["status"], row["reason"]) for row in rows}
    killed, crashed = ("killed from outside", "killed by SIGKILL"), ("crashed", "killed by SIGABRT")
    expected = dict.fromkeys(("be killed once", "be killed twice", "abort until mended", "work"), ("ok", ""))
    expected |= {"be killed twice": killed, "abort until mended": crashed}
    assert first == expected
    again = next(row for row in rows if row["arm"] == "be killed once")
    assert max(row["ended"] for row in rows if row["arm"] == "work") <= again["began"]
    second = {row["arm"]: (row["status"], row["reason"]) for row in run(tmp_path, *cases)}
    assert second == {**first, "be killed twice": ("ok", "")}
    mended.touch()
    third = run(tmp_path, *cases, retry_failed=True)
    assert {row["status"] for row in third} == {"ok"}
    assert [row for row in third if row["arm"] == "work"] == [row for row in rows if row["arm"] == "work"]


class _Deadly(Case):
    def __reduce__(self) -> tuple[Callable[[int], None], tuple[int]]:
        return os._exit, (4,)


def deadly(number: int) -> Case:
    return _Deadly(NAME, case("work").scene, Arm("mischief", "deadly"), RunSettings(1e-3, number + 1))


def test_a_process_that_dies_as_it_begins_does_not_end_the_run_unless_all_do(tmp_path: Path) -> None:
    rows = run(tmp_path / "one", deadly(0), case("work"))
    outcomes = {row["arm"]: (row["status"], row["reason"]) for row in rows}
    assert outcomes == {"work": ("ok", ""), "deadly": ("not begun", "ended with exit code 4")}
    with pytest.raises(RunBroken, match="no process can begin: ended with exit code 4"):
        run(tmp_path / "all", *map(deadly, range(4)))


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 cannot keep the folder out")
def test_no_process_takes_a_file_in_the_users_folder_for_a_module_of_pythons(tmp_path: Path) -> None:
    """A file for each says that it was run; the engine that is asked for is there too."""
    for name in sys.stdlib_module_names - {"antigravity", "this"}:
        if find_spec(name):
            code = "import sys; open('executed', 'a').write(__name__); sys.exit(__name__)\n"
            (tmp_path / f"{name}.py").write_text(code)
    mine = "from engine_models.scipy_ivp.engine import ScipyEngine as Mine\n"
    (tmp_path / "my_module.py").write_text(mine)
    script = str(Path(sys.executable).with_name("crankslider"))
    command = [script, "run", "agreement", "--engine", "my_module:Mine", "--jobs", "2", "--out", "results"]
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", SAFE_PATH)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, (tmp_path / "executed").exists()) == (0, False), done.stderr
    rows = read_rows(tmp_path / "results/agreement/rows.jsonl")
    assert {(row["engine"], row["status"]) for row in rows} == {("my_module:Mine", "ok")}

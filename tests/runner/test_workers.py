"""Cases in processes of their own: what an engine does to its process is a row, and no other's affair."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pandas as pd
import pytest

from studies.case import Case, run_case
from studies.failures import Failed
from studies.running.store import Store
from studies.running.workers import Ended, Pool
from tests.helpers.mischief import NAME, case
from tests.helpers.running import run_in

pytestmark = pytest.mark.system


def test_whatever_an_engine_does_is_a_row_with_a_reason_and_the_others_go_on(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    expected = {
        "abort": ("crashed", "killed by SIGABRT"),
        "say and abort": ("crashed", "killed by SIGABRT: last words"),
        "segmentation fault": ("crashed", "killed by SIGSEGV"),
        "exit": ("crashed", "ended with exit code 3"),
        "hang": ("timed out", "not finished within the limit of 0.5 s"),
        "no memory": ("out of memory", ""),
        "noise": ("ok", ""),
        "work": ("ok", ""),
    }
    cases = [case(arm) for arm in expected if arm != "hang"]
    cases.append(case("hang", limit_s=0.5, pid_file=str(tmp_path / "pid")))
    with Pool(2) as pool:
        rows = run_in(tmp_path, cases, pool)
    assert {row["arm"]: (row["status"], row["reason"]) for row in rows} == expected
    out, err = capfd.readouterr()
    assert out == ""
    assert "noise" not in err
    assert f"{NAME}: 8 cases, 4 crashed, 1 " in err


def test_a_case_does_not_answer_for_what_another_did() -> None:
    """The process of a case that died after another is begun anew, once."""
    with Pool(1) as pool:
        (spoiler, _), (spoilt, _) = (
            pool.run(run_case, case(arm), limit_s=60.0) for arm in ("spoil", "be spoilt")
        )
        with pytest.raises(Ended, match="killed by SIGABRT"):
            pool.run(run_case, case("abort"), limit_s=60.0)
    assert (spoiler["status"], spoilt["status"]) == ("ok", "ok")
    assert spoiler["pid"] != spoilt["pid"]


def test_timed_cases_run_alone_and_in_order_in_one_process(tmp_path: Path) -> None:
    timed = [case("work", n, timed=True) for n in (7, 3, 5)]
    with Pool(2) as pool:
        rows = run_in(tmp_path, [*timed[:2], case("work"), case("work", 2), timed[2]], pool)
    others = [row for row in rows if "timed" not in row]
    alone = sorted((row for row in rows if "timed" in row), key=lambda row: float(str(row["began"])))
    assert [row["samples"] for row in alone] == [8, 4, 6]
    assert len({row["pid"] for row in alone} - {os.getpid()}) == 1
    ends = [max(row["ended"] for row in others), *(row["ended"] for row in alone)]  # type: ignore[type-var]
    assert all(end <= row["began"] for end, row in zip(ends, alone, strict=False))  # type: ignore[operator]


def test_what_was_killed_is_tried_again_and_what_failed_if_asked_for(tmp_path: Path) -> None:
    """Killed once, it runs again at once, alone; killed twice, with the next run."""
    mended = tmp_path / "mended"
    cases = [
        case("be killed once", been_file=str(tmp_path / "once")),
        case("be killed twice", been_file=str(tmp_path / "twice")),
        case("abort until mended", mended_file=str(mended)),
        *(case("work", n) for n in range(3)),
    ]

    def statuses(retry: bool = False) -> dict[object, object]:
        with Pool(2) as pool:
            run_in(tmp_path, cases, pool, retry)
        with Store(tmp_path) as store:
            ended = store.statuses()
        return {each.arm.name: ended[each.key] for each in cases}

    first = dict.fromkeys(("be killed once", "abort until mended", "be killed twice", "work"), "ok")
    first |= {"be killed twice": "killed from outside", "abort until mended": "crashed"}
    assert statuses() == first
    assert statuses() == {**first, "be killed twice": "ok"}
    mended.touch()
    assert set(statuses(retry=True).values()) == {"ok"}


class Deadly:
    """What ends the process that reads it."""

    limit_s = 60.0

    def __reduce__(self) -> tuple[object, tuple[int]]:
        return os._exit, (4,)


@pytest.mark.parametrize(
    ("item", "message"),
    [
        (Deadly(), "no process can begin: ended with exit code 4"),
        (case("bug"), r"mischief \(bug\) on ideal-free: bug at helpers/mischief.py:\d+: KeyError"),
        (case("unpicklable bug"), r"mischief \(unpicklable bug\) on ideal-free: bug at .* Unpicklable"),
    ],
    ids=["no beginning", "bug", "unpicklable bug"],
)
def test_what_no_case_could_go_on_after_ends_the_run_in_one_line(item: Case, message: str) -> None:
    with Pool(2) as pool, pytest.raises(Failed, match=message):
        list(pool.results(run_case, [item, case("work")]))


def test_no_process_takes_a_file_in_the_users_folder_for_a_module_of_pythons(tmp_path: Path) -> None:
    """A file for each says that it was run; the engine that is asked for is there too."""
    for name in sys.stdlib_module_names - {"antigravity", "this"}:
        if find_spec(name):
            code = "import sys; open('executed', 'a').write(__name__); sys.exit(__name__)\n"
            (tmp_path / f"{name}.py").write_text(code)
    mine = "from engine_models.minimal.engine import ScipyEngine as Mine\n"
    (tmp_path / "my_module.py").write_text(mine)
    script = str(Path(sys.executable).with_name("crankslider"))
    some = ["clearance-driven-0.5mm", "--vary", "crank.length_m=40mm,50mm", "--revolutions", "0.1"]
    command = [script, "sweep", *some, "--engine", "my_module:Mine", "--jobs", "2", "--out", "rows.csv"]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, (tmp_path / "executed").exists()) == (0, False), done.stderr
    assert pd.read_csv(tmp_path / "rows.csv")["status"].tolist() == ["ok", "ok"]

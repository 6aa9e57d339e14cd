"""Runs that are killed or interrupted, for real: finished cases are kept and no process is left."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.mischief import NAME, steady
from tests.helpers.running import HEAR, IGNORE, add_line, copied, gone, lines, started, until

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc"),
]

CASES = 15
#: A comment in what the study imports, and code that it does not.
MEANS_NOTHING_TO_IT = {
    "engine_models/scene/scene.py": "# why",
    "studies/judges/energy_rates.py": "AND_MORE = 1",
    "engine_models/pymunk/engine.py": "AND_MORE = 1",
}


def measured(out: Path) -> list[dict[str, Any]]:
    return [steady(json.loads(line)) for line in lines(out)]


def test_a_run_killed_again_and_again_ends_with_the_rows_of_one_left_alone(tmp_path: Path) -> None:
    killed, alone = tmp_path / "killed", tmp_path / "alone"
    earlier: list[str] = []
    for n in (1, 6):
        with started(killed) as run:
            until(lambda n=n: len(lines(killed)) >= n)  # type: ignore[misc]
            run.kill()
        assert [line for line in earlier if line.endswith("\n")] == lines(killed)[: len(earlier)]
        earlier = [line for line in lines(killed) if line.endswith("\n")]
        assert len(earlier) >= n
    for out in (killed, alone):
        with started(out) as run:
            _, stderr = run.communicate(timeout=60)
        assert (run.returncode, f"{NAME}: {CASES} cases, 1 crashed\n" in stderr) == (0, True), stderr
    assert lines(killed)[: len(earlier)] == earlier, "finished cases are not run again"
    by_case = itemgetter("case")
    assert sorted(measured(killed), key=by_case) == sorted(measured(alone), key=by_case)
    assert [row["samples"] for row in measured(killed)[-2:]] == [99, 100], "timed cases are last, in order"


@contextmanager
def hanging(folder: Path, first: str = HEAR) -> Iterator[tuple["subprocess.Popen[str]", list[int]]]:
    """Start a run of two cases that end and two that never will; give it and its workers when it hangs."""
    files = [folder / f"pid{n}" for n in range(2)]
    with started(folder, first, HANG_IN=str(folder)) as run:
        until(lambda: len(lines(folder)) == 2 and all(file.exists() and file.read_text() for file in files))
        yield run, [int(file.read_text()) for file in files]


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


def test_a_run_whose_shell_ignores_ctrl_c_goes_on_and_its_workers_do_not_survive_it(tmp_path: Path) -> None:
    with hanging(tmp_path, IGNORE) as (run, workers):
        os.killpg(run.pid, signal.SIGINT)
        time.sleep(0.5)
        assert run.poll() is None
        assert not any(gone(pid) for pid in workers)
        held = [os.readlink(file) for pid in workers for file in Path(f"/proc/{pid}/fd").iterdir()]
        assert str(tmp_path / NAME / "rows.lock") not in held, "they do not hold the folder"
        run.kill()
        until(lambda: all(gone(pid) for pid in workers))
    assert [row["status"] for row in measured(tmp_path)] == ["ok", "ok"]


def test_a_run_whose_code_changes_stops_and_keeps_what_was_finished(tmp_path: Path) -> None:
    copied(tmp_path)
    results = tmp_path / "results"
    with started(results, cwd=tmp_path) as run:
        until(lambda: len(lines(results)) >= 1)
        for path, line in MEANS_NOTHING_TO_IT.items():
            add_line(tmp_path / path, line)
        until(lambda: len(lines(results)) >= 3)
        add_line(tmp_path / "engine_models/engine.py", "AND_MORE = 1")
        _, stderr = run.communicate(timeout=30)
    assert run.returncode == 1
    assert stderr.splitlines()[-1] == (
        "error: the code changed under the run (engine_models/engine.py): "
        "what was finished is kept, run it again"
    )
    assert 3 <= len(lines(results)) < CASES
    assert "Traceback" not in stderr

"""Runs that are killed, run against each other or out of room: no row is lost, torn or doubled.

Linux: it looks into /proc.
"""

import json
import os
import signal
import subprocess
import time
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from studies.running.execution import NO_RESULT
from studies.running.finished_cases import checksum
from tests.helpers.mischief import NAME, steady
from tests.helpers.running import gone, lines, started, until

KILLS, PAIRS, FULL_DISKS = 100, 10, 20
#: How runs may end: as asked, and by the signal itself before Python listens or after it has stopped to.
ENDS = (0, 130, -signal.SIGINT, -signal.SIGTERM, -signal.SIGKILL)
#: A moment is at most so long after a run began, in s, while its workers import or work.
LATEST_S = 5.0
#: Kills of workers in one run, and kinds of kill with how often each is drawn.
MOST_WORKERS = 3
PARENT_KILLED, PARENT_STOPPED, WORKER_KILLED = "parents killed", "parents interrupted", "workers killed"
#: All rows of the study together are shorter than this, in bytes.
ALL_ROWS = 7000

Rows = dict[str, dict[str, Any]]


def kills(random: Random, folder: Path) -> Counter[str]:
    """Kill parents and workers of run after run; each goes on where the one before was, until all is done."""
    done = Counter({PARENT_KILLED: 0, PARENT_STOPPED: 0, WORKER_KILLED: 0, "runs": 0, "rows compared": 0})
    alone = _reference(folder / "alone")
    out, before = folder / "0", Rows()
    while sum(done[kind] for kind in (PARENT_KILLED, PARENT_STOPPED, WORKER_KILLED)) < KILLS:
        kind = random.choice([PARENT_KILLED, PARENT_STOPPED, WORKER_KILLED])
        with started(out) as run:
            workers = _disturb(random, run, kind, out, done)
            _, stderr = run.communicate(timeout=120)
        until(lambda workers=workers: all(gone(pid) for pid in workers))  # type: ignore[misc]
        assert "Traceback" not in stderr, stderr
        assert "Exception" not in stderr, stderr
        assert run.returncode in ENDS, f"{run.returncode}: {stderr}"
        before = _require_whole(out, before)
        done["runs"] += 1
        if run.returncode == 0 and _measured(before) == alone:
            done["rows compared"] += len(before)
            out, before = folder / str(done["runs"]), Rows()
    _finish(out, alone, done)
    return done


def pairs(random: Random, folder: Path) -> Counter[str]:
    """Start two runs into one folder: the second one is refused, or does what the first has left."""
    done, alone = Counter({"refused": 0, "not refused": 0, "rows compared": 0}), _reference(folder / "alone")
    for n in range(PAIRS):
        out = folder / str(n)
        with started(out) as first:
            time.sleep(random.uniform(0, LATEST_S / 2))
            with started(out) as second:
                said = [run.communicate(timeout=120)[1] for run in (first, second)]
        codes = first.returncode, second.returncode
        assert codes in ((0, 0), (0, 2), (2, 0)), said
        for code, stderr in zip(codes, said, strict=True):
            if code == 2:
                assert stderr.startswith("error: --out: expected a folder that no other run holds"), stderr
                assert stderr.count("\n") == 1, stderr
        done["refused" if 2 in codes else "not refused"] += 1
        _require_whole(out, {})
        _finish(out, alone, done)
    return done


def full_disk(random: Random, folder: Path) -> Counter[str]:
    """Let no file grow beyond a random size: the run ends with one line, and one with room finishes it."""
    done, alone = (
        Counter({"runs without room": 0, "rows kept": 0, "rows compared": 0}),
        _reference(folder / "alone"),
    )
    while done["runs without room"] < FULL_DISKS:
        out, room = folder / str(done["runs without room"]), random.randrange(ALL_ROWS)
        first = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}));"
        with started(out, first) as run:
            _, stderr = run.communicate(timeout=120)
        last = stderr.splitlines()[-1]
        if run.returncode:
            place = f"error: --out: expected a place that can be written, got {out} (File too large)"
            assert (run.returncode, last) == (2, place), stderr
            assert stderr.count("error") == 1, stderr
        assert "Traceback" not in stderr, stderr
        before = _require_whole(out, {})
        done["rows kept"] += len(before)
        done["runs without room"] += 1
        _finish(out, alone, done, before)
    return done


def _disturb(
    random: Random, run: "subprocess.Popen[str]", kind: str, out: Path, done: Counter[str]
) -> list[int]:
    """Do to a run what the kind says at random moments; return the workers it had then."""
    if kind == WORKER_KILLED:
        for _ in range(random.randint(1, MOST_WORKERS)):
            time.sleep(random.uniform(0, LATEST_S / MOST_WORKERS))
            if workers := _workers(run.pid):
                os.kill(random.choice(workers), random.choice([signal.SIGKILL, signal.SIGTERM]))
                done[kind] += 1
        return []
    if kind == PARENT_STOPPED:  # before it holds its folder it is no run but a program that begins
        lock = out / NAME / "rows.lock"
        until(lambda: lock.exists() and f'"pid": {run.pid},' in lock.read_text())
    time.sleep(random.uniform(0, LATEST_S))
    workers = _workers(run.pid)
    if run.poll() is None:
        number = random.choice([signal.SIGINT, signal.SIGTERM]) if kind == PARENT_STOPPED else signal.SIGKILL
        run.send_signal(number)
        done[kind] += 1
    return workers


def _workers(parent: int) -> list[int]:
    """Return the worker processes of a run."""
    found = []
    for place in Path("/proc").iterdir():
        if place.name.isdigit():
            try:
                family = int((place / "stat").read_text().rpartition(")")[2].split()[1])
                if family == parent and b"spawn_main" in (place / "cmdline").read_bytes():
                    found.append(int(place.name))
            except (OSError, IndexError):  # it ended
                continue
    return found


def _reference(out: Path) -> Rows:
    """Return the rows of a run that is left alone."""
    with started(out) as run:
        _, stderr = run.communicate(timeout=120)
    assert run.returncode == 0, stderr
    return _measured(_require_whole(out, {}))


def _finish(out: Path, alone: Rows, done: Counter[str], before: Rows | None = None) -> None:
    """Run what is left to do in a folder and compare its rows with those of a run left alone."""
    with started(out) as run:
        _, stderr = run.communicate(timeout=120)
    assert run.returncode == 0, stderr
    rows = _require_whole(out, before or {})
    assert _measured(rows) == alone
    done["rows compared"] += len(rows)


def _require_whole(out: Path, before: Rows) -> Rows:
    """Return the rows of a folder by case if each is whole, with its curves, and those before are there."""
    rows: Rows = {}
    for line in lines(out):
        if not line.endswith("\n"):
            assert line == lines(out)[-1], f"{out}: torn"
            continue
        row = json.loads(line)
        assert row["checksum"] == checksum(row), f"{out}: torn"
        assert row["case"] not in rows, f"{out}: doubled"
        rows[row["case"]] = row
        if row["status"] == "ok":
            with np.load(out / NAME / "curves" / f"{row['case']}.npz") as curves:
                assert len(curves["time_s"]) == 100
    for key, row in before.items():
        assert rows.get(key) == row or row["status"] in NO_RESULT, f"{out}: lost"
    return rows


def _measured(rows: Rows) -> Rows:
    return {key: steady(row) for key, row in rows.items()}

"""Cases on a Dask cluster: a real scheduler and two real workers of this machine."""

import socket
import sys
from collections.abc import Iterator
from importlib import reload
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster

from engine_models.engines import ENGINES
from studies.running import cluster as execution_cluster
from studies.running import provenance, runner
from studies.running.cluster import cluster
from studies.running.execution import Limits
from studies.running.processes import Processes
from studies.running.runner import run_study
from tests.helpers.command import crankslider
from tests.helpers.mischief import MEGABYTE, NAME, case, steady
from tests.helpers.refusals import require_refusal
from tests.helpers.row_files import read_rows

pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def local() -> Iterator[LocalCluster]:
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:  # type: ignore[no-untyped-call]
        yield cluster


@pytest.fixture
def client(local: LocalCluster) -> Iterator[Client]:
    with Client(local.scheduler_address, set_as_default=False) as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(2, timeout=60)  # those that a test killed come back
        yield client


def rows(folder: Path) -> list[dict[str, Any]]:
    return sorted(read_rows(folder / "rows.jsonl"), key=lambda row: str(row["case"]))


def test_a_cluster_gives_the_rows_that_processes_give(local: LocalCluster, tmp_path: Path) -> None:
    cases = [case("simulate", 4, engine=engine) for engine in ENGINES]
    # A process has room for one of Exudyn's builds.
    cases += [case("simulate", number, engine="exudyn", fast=number % 2 == 0) for number in range(12, 16)]
    run_study(NAME, cases, tmp_path / "processes", lambda: Processes(2))
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, cases, tmp_path / "cluster", executor)
    there, here = ([steady(row) for row in rows(tmp_path / name)] for name in ("cluster", "processes"))
    assert there == here
    assert [row["status"] for row in there] == ["ok"] * len(cases)


def children() -> set[int | None]:
    return {child.pid for child in active_children()}


def test_crashes_and_hangs_are_rows_of_theirs_and_what_is_timed_or_limited_stays_on_this_machine(
    local: LocalCluster, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    works = [case("work"), case("work", 1, timed=True), case("work", 2, Limits(60, 500 * MEGABYTE))]
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, works, tmp_path / "works", executor)
    there = set().union(*client.run(children).values())
    assert [row["status"] for row in rows(tmp_path / "works")] == ["ok"] * 3
    of_workers = {row["samples"]: row["pid"] in there for row in rows(tmp_path / "works")}
    assert of_workers == {1: True, 2: False, 3: False}
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, [case("abort"), *(case("work", n) for n in range(4))], tmp_path / "crash", executor)
    outcomes = {(row["arm"], row["status"], row["reason"]) for row in rows(tmp_path / "crash")}
    assert outcomes == {("work", "ok", ""), ("abort", "crashed", "killed by SIGABRT")}
    monkeypatch.setattr(runner, "ROOMY", Limits(10, 1000 * MEGABYTE))
    before = set(client.scheduler_info()["workers"])
    hangs = [case("hang", n, pid_file=str(tmp_path / f"pid{n}")) for n in range(2)]
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, [*hangs, case("work", 7)], tmp_path / "hangs", executor)
    outcomes = {(row["arm"], row["status"], row["reason"]) for row in rows(tmp_path / "hangs")}
    assert outcomes == {("work", "ok", ""), ("hang", "timed out", "not finished within the limit of 10 s")}
    assert set(client.scheduler_info()["workers"]) == before


def pretend(code: str) -> str:
    """Make a worker say that its code is this; return the fingerprint of all that it then has."""
    provenance.fingerprint = lambda *_: code  # type: ignore[assignment]
    return provenance.overall_fingerprint()


def be_honest() -> None:
    reload(provenance)


def test_workers_with_other_code_are_refused(local: LocalCluster, client: Client, tmp_path: Path) -> None:
    theirs = set(client.run(pretend, "other").values())
    try:
        done = crankslider("run", "--scheduler", local.scheduler_address, "--out", tmp_path / "out")
    finally:
        client.run(be_honest)
    ours = provenance.overall_fingerprint()
    expected = f"--scheduler: expected workers with our code and libraries (fingerprint {ours})"
    require_refusal(done.stdout, done.stderr, done.code, expected, f"got {theirs.pop()}")
    assert not list(tmp_path.iterdir())


def test_what_is_no_scheduler_is_refused(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution_cluster, "CONNECT_S", 0.5)
    worker, expected = (
        next(iter(client.scheduler_info()["workers"])),
        "--scheduler: expected the address of a",
    )
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        for address in (worker, f"tcp://127.0.0.1:{port}", "tcp://127.0.0.1:1", "nonsense", ""):
            got = "got that of a Worker" if address == worker else f"got {address}"
            done = crankslider("run", "--scheduler", address)
            require_refusal(done.stdout, done.stderr, done.code, expected, got)
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = crankslider("run", "--scheduler", "tcp://127.0.0.1:1")
    require_refusal(done.stdout, done.stderr, done.code, "the package distributed", "crankslider[cluster]")

"""Cases on a Dask cluster: a real scheduler and two real workers of this machine."""

import os
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

from engine_models.engines import ENGINES
from studies.running import cluster
from studies.running.cluster import Cluster
from studies.running.workers import Pool
from tests.helpers.command import crankslider
from tests.helpers.mischief import case, steady
from tests.helpers.refusals import require_refusal
from tests.helpers.running import run_in

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


def test_a_cluster_gives_the_rows_that_processes_give(local: LocalCluster, tmp_path: Path) -> None:
    cases = [case("simulate", 4, engine=engine) for engine in ENGINES]
    with Pool(2) as pool, Cluster(local.scheduler_address) as workers:
        here = run_in(tmp_path / "here", cases, pool)
        there = run_in(tmp_path / "there", cases, workers)
    assert [*map(steady, there)] == [*map(steady, here)]
    assert [row["status"] for row in there] == ["ok"] * len(cases)


def test_crashes_and_hangs_are_rows_of_theirs_and_what_is_timed_stays_on_this_machine(
    local: LocalCluster, client: Client, tmp_path: Path
) -> None:
    before = set(client.scheduler_info()["workers"])
    hangs = [case("hang", n, limit_s=3.0, pid_file=str(tmp_path / f"pid{n}")) for n in range(2)]
    works = [case("work"), case("work", 1, timed=True)]
    with Cluster(local.scheduler_address) as workers:
        rows = run_in(tmp_path, [case("abort"), *hangs, *works], workers)
    hung = ("hang", "timed out", "not finished within the limit of 3 s")
    outcomes = {(row["arm"], row["status"], row["reason"]) for row in rows}
    assert outcomes == {("work", "ok", ""), ("abort", "crashed", "killed by SIGABRT"), hung}
    assert set(client.scheduler_info()["workers"]) == before
    theirs = set(client.run(os.getpid).values())
    parents = {row["samples"]: row["parent"] for row in rows if row["arm"] == "work"}
    assert parents[1] in theirs
    assert parents[2] == os.getpid()


def test_what_is_no_scheduler_is_refused(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    worker = next(iter(client.scheduler_info()["workers"]))
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        for address in (worker, f"tcp://127.0.0.1:{port}", "tcp://127.0.0.1:1", "nonsense", ""):
            done = crankslider("run", "--scheduler", address)
            require_refusal(done.stdout, done.stderr, done.code, "scheduler: expected ")
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = crankslider("run", "--scheduler", "tcp://127.0.0.1:1")
    require_refusal(done.stdout, done.stderr, done.code, "the package distributed", "crankslider[cluster]")

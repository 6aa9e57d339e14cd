"""Cases on a Dask cluster: a real scheduler and two real workers of this machine."""

import socket
import sys
from collections.abc import Iterator
from importlib import reload
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from distributed import Client, LocalCluster

import crankslider as cs
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


def measured(folder: Path) -> list[dict[str, Any]]:
    return [steady(row) for row in rows(folder)]


def test_a_cluster_gives_the_rows_that_processes_give(local: LocalCluster, tmp_path: Path) -> None:
    cases = [case("simulate", 4, engine=engine) for engine in ENGINES]
    cases += [case("simulate", 8, engine=engine) for engine in ENGINES]
    # A process has room for one of Exudyn's builds.
    cases += [case("simulate", number, engine="exudyn", fast=number % 2 == 0) for number in range(12, 16)]
    run_study(NAME, cases, tmp_path / "processes", lambda: Processes(2))
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, cases, tmp_path / "cluster", executor)
    assert measured(tmp_path / "cluster") == measured(tmp_path / "processes")
    assert [row["status"] for row in rows(tmp_path / "cluster")] == ["ok"] * len(cases)


def test_timed_and_limited_cases_stay_on_this_machine(
    local: LocalCluster, client: Client, tmp_path: Path
) -> None:
    cases = [case("work"), case("work", 1, timed=True), case("work", 2, Limits(60, 500 * MEGABYTE))]
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, cases, tmp_path, executor)
    children = set().union(*client.run(_children).values())
    assert {row["samples"]: row["pid"] in children for row in rows(tmp_path)} == {1: True, 2: False, 3: False}


def _children() -> set[int | None]:
    return {child.pid for child in active_children()}


def test_a_crash_on_the_cluster_is_the_row_of_the_case_that_did_it(
    local: LocalCluster, tmp_path: Path
) -> None:
    cases = [case("abort"), *(case("work", n) for n in range(4))]
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, cases, tmp_path, executor)
    statuses = {(row["arm"], row["status"], row["reason"]) for row in rows(tmp_path)}
    assert statuses == {("work", "ok", ""), ("abort", "crashed", "killed by SIGABRT")}


def test_a_hang_on_the_cluster_is_a_row_and_its_worker_goes_on(
    local: LocalCluster, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "ROOMY", Limits(3, 1000 * MEGABYTE))
    before = set(client.scheduler_info()["workers"])
    hangs = [case("hang", n, pid_file=str(tmp_path / f"pid{n}")) for n in range(2)]
    with cluster(local.scheduler_address) as executor:
        run_study(NAME, [*hangs, case("work", 7)], tmp_path, executor)
    outcomes = {(row["arm"], row["status"], row["reason"]) for row in rows(tmp_path)}
    assert outcomes == {("work", "ok", ""), ("hang", "timed out", "not finished within the limit of 3 s")}
    assert set(client.scheduler_info()["workers"]) == before


def _pretend(code: str) -> str:
    """Make a worker say that its code is this; return the fingerprint of all that it then has."""
    provenance.fingerprint = lambda *_: code  # type: ignore[assignment]
    return provenance.overall_fingerprint()


def _be_honest() -> None:
    reload(provenance)


def test_workers_with_other_code_are_refused(local: LocalCluster, client: Client, tmp_path: Path) -> None:
    theirs = set(client.run(_pretend, "other").values())
    try:
        done = crankslider("run", "--scheduler", local.scheduler_address, "--out", tmp_path / "out")
    finally:
        client.run(_be_honest)
    ours = provenance.overall_fingerprint()
    expected = f"--scheduler: expected workers with our code and libraries (fingerprint {ours})"
    require_refusal(done.stdout, done.stderr, done.code, expected, f"got {theirs.pop()}")
    assert not list(tmp_path.iterdir())


def test_a_worker_is_not_taken_for_a_scheduler(client: Client) -> None:
    worker = next(iter(client.scheduler_info()["workers"]))
    done = crankslider("run", "--scheduler", worker)
    require_refusal(done.stdout, done.stderr, done.code, "--scheduler: expected", "got that of a Worker")


def test_an_address_where_no_scheduler_answers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(execution_cluster, "CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = silent.getsockname()[1]
        for address in (f"tcp://127.0.0.1:{port}", "tcp://127.0.0.1:1", "nonsense", ""):
            done = crankslider("run", "--scheduler", address)
            expected = f"--scheduler: expected the address of a Dask scheduler, got {address}"
            require_refusal(done.stdout, done.stderr, done.code, expected)


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = crankslider("run", "--scheduler", "tcp://127.0.0.1:1")
    require_refusal(done.stdout, done.stderr, done.code, "the package distributed", "crankslider[cluster]")


def test_a_cluster_gives_the_rows_of_a_sweep_that_processes_give(local: LocalCluster, tmp_path: Path) -> None:
    def swept(name: str, **how: Any) -> pd.DataFrame:
        vary = {"clearance.B.radial_clearance_m": "1e-5:1e-3:log:8"}
        out = tmp_path / f"{name}.parquet"
        return cs.sweep("clearance-driven-0.5mm", vary, "pymunk", out=out, revolutions=0.02, **how).frame

    there, here = swept("cluster", scheduler=local.scheduler_address), swept("here", jobs=2)
    pd.testing.assert_frame_equal(there, here, check_exact=True)

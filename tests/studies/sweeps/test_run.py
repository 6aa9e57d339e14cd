"""Sweeps keep every finished chunk, give the same rows wherever they run, and are refused if too long."""

import json
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from engine_models.reference.watch import Watch
from engine_models.scene.library import SCENES
from studies.predictability.sweeps import run as running
from studies.predictability.sweeps.chunk import Chunk, Trial, run_chunk, try_out
from studies.predictability.sweeps.run import Sweep, run_sweep
from studies.predictability.sweeps.task import Task
from studies.running.execution import CRASHED, CaseEnded
from studies.running.failures import BadInput
from tests.helpers.running import Here

FIELD, MEMBERS, CHUNK = "clearance.B.radial_clearance_m", 40, 8
#: For two processes, in members: a quarter of what is left, 8 at most.
CHUNKS = (8, 8, 6, 4, 3, 2, 2, 1, 1, 1, 1, 1, 1, 1)
#: One value of no scene, which the command line refuses and a sweep has a row for.
NO_SCENE = 17


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "MOST_IN_CHUNK", CHUNK)


def sweep(engine: str = "pymunk", revolutions: float = 0.02) -> Sweep:
    values = np.geomspace(1e-5, 1e-3, MEMBERS)
    values[NO_SCENE] = 0.5
    task = Task(SCENES["clearance-driven-0.5mm"](), engine, {}, 1e-5, Watch(0.0, revolutions))
    return Sweep(task, {FIELD: values}, (FIELD,))


def swept(folder: Path, pool: Callable[[], Here] = Here, hours: float = 1.0) -> pd.DataFrame:
    """Return the rows of a sweep, run here."""
    folder.mkdir(exist_ok=True)
    run_sweep(sweep(), folder / "rows.parquet", {}, 2, pool, hours)
    return pd.read_parquet(folder / "rows.parquet")


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return swept(tmp_path_factory.mktemp("whole"))


def test_there_is_a_row_for_each_member_in_order_and_one_that_fails_has_its_reason(
    rows: pd.DataFrame,
) -> None:
    assert rows["member"].tolist() == list(range(MEMBERS))
    assert rows["status"].tolist() == ["ok"] * NO_SCENE + ["failed"] + ["ok"] * (MEMBERS - NO_SCENE - 1)
    assert rows["reason"][NO_SCENE].startswith(f"{FIELD}: expected a number < bearing_radius_m = 0.01")
    numbers = rows.drop(columns=["exponent_1_s", "impulse_N_s", "impact_speed_m_s"]).select_dtypes("number")
    assert numbers.drop(index=NO_SCENE).notna().to_numpy().all()


def test_what_was_finished_before_an_interrupt_is_not_run_again(rows: pd.DataFrame, tmp_path: Path) -> None:
    def interrupt(call: int) -> None:
        if call == 5:  # a trial and three chunks are done
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        swept(tmp_path, lambda: Here(interrupt))
    assert not (tmp_path / "rows.parquet").exists()
    again = Here()
    pd.testing.assert_frame_equal(swept(tmp_path, lambda: again), rows, check_exact=True)
    assert again.calls < 1 + len(CHUNKS)
    assert [file.name for file in tmp_path.iterdir()] == ["rows.parquet"]


def test_a_sweep_that_is_there_is_not_run_again(tmp_path: Path) -> None:
    first, again = Here(), Here()
    swept(tmp_path, lambda: first)
    assert first.calls == 1 + len(CHUNKS)
    swept(tmp_path, lambda: again)
    assert again.calls == 0


def test_chunks_shrink_so_that_no_process_waits_long_for_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunks = list[Chunk]()

    def noted(task: Task, chunk: Chunk) -> pa.Table:
        chunks.append(chunk)
        return run_chunk(task, chunk)

    monkeypatch.setattr(running, "run_chunk", noted)
    swept(tmp_path)
    assert tuple(map(len, chunks)) == CHUNKS
    assert [chunk.first for chunk in chunks] == [sum(CHUNKS[:k]) for k in range(len(CHUNKS))]


def test_of_a_chunk_whose_process_dies_one_member_fails_and_the_others_go_on(
    rows: pd.DataFrame, tmp_path: Path
) -> None:
    """The first chunk's process dies, and that of its fourth member, which runs alone after all chunks."""

    def die(call: int) -> None:
        if call in (2, 1 + len(CHUNKS) + 4):
            raise CaseEnded(CRASHED, "killed by SIGSEGV")

    found = swept(tmp_path, lambda: Here(die))
    assert found["reason"][3] == "killed by SIGSEGV"
    pd.testing.assert_frame_equal(found.drop(index=3), rows.drop(index=3), check_exact=True)


def test_parts_of_another_sweep_are_refused(tmp_path: Path) -> None:
    (tmp_path / "rows.parquet.parts").mkdir()
    (tmp_path / "rows.parquet.parts" / "sweep.json").write_text(json.dumps({"sweep": "another"}))
    with pytest.raises(BadInput, match=r"--out: expected a file without parts of another sweep"):
        swept(tmp_path)


def test_whatever_decides_a_row_makes_it_another_sweep() -> None:
    one = sweep()
    task, values = one.task, one.changes[FIELD]
    tasks = [
        replace(task, scene=task.scene.replace("rod.mass_kg", 0.2)),
        replace(task, engine_name="scipy"),
        replace(task, settings={"iterations": 30}),
        replace(task, step_s=2e-5),
        replace(task, watch=Watch(0.0, 0.03)),
        replace(task, watch=Watch(0.01, 0.02)),
        replace(task, watch=Watch(0.0, 0.02, exponent=True)),
    ]
    others = [replace(one, task=other) for other in tasks]
    others += [replace(one, changes={FIELD: 2 * values}), replace(one, varied=())]
    others += [replace(one, directions=("up",)), replace(one, directions=("down",))]
    assert len({each.identity() for each in (one, *others)}) == 1 + len(others)
    assert sweep().identity() == one.identity()


@pytest.mark.parametrize("hours", [0.9, 1.1])
def test_what_a_sweep_takes_is_said_before_and_its_processor_time_is_bounded(
    hours: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Forty members of 90 s are an hour; their rows of a megabyte are there twice as parts become a file."""
    monkeypatch.setattr(running, "try_out", lambda *_: Trial(90.0, 1e6, 2 * 10**8))
    monkeypatch.setattr(running, "Processes", lambda _: Here())
    refused = pytest.raises(BadInput, match=r"--hours: expected at least 1 for 40 members of 90 s, got 0\.9")
    with refused if hours < 1 else nullcontext():
        run_sweep(sweep(), tmp_path / "rows.parquet", {}, 2, None, hours)
    said = "members of 9e+04 ms each, 60 min of processor time on 2 cores: about 30 min; up to 80 MB of disk"
    assert f"40 {said}, 0.4 GB of memory" in capsys.readouterr().err


def test_a_trial_tells_of_one_member() -> None:
    task, chunk = sweep().task, Chunk(0, {FIELD: np.geomspace(1e-5, 1e-3, 8)})
    trial = try_out(task, chunk)
    assert trial.row_bytes == run_chunk(task, chunk).nbytes / 8
    assert 0 < trial.member_s < 1
    assert trial.process_bytes > 10**7


def test_a_sweep_that_would_take_too_long_is_refused_before_it_begins(tmp_path: Path) -> None:
    trial = Here()
    with pytest.raises(BadInput, match=r"--hours: expected at least .* for 40 members of .* s, got 1e-09"):
        swept(tmp_path, lambda: trial, hours=1e-9)
    assert trial.calls == 1


def test_the_file_tells_what_made_it_and_no_time(tmp_path: Path) -> None:
    swept(tmp_path)
    schema = parquet.read_schema(tmp_path / "rows.parquet")
    assert json.loads(schema.metadata[b"varied"]) == [FIELD]
    assert not [name for name in schema.names if "time" in name]

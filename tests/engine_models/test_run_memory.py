"""What a run keeps grows with its samples, and one too large for the memory is refused before it starts."""

import tracemalloc
from pathlib import Path

import pytest

from engine_models import memory
from engine_models.engine import RunSettings, Trajectory, UnsupportedScene
from engine_models.exudyn.engine import ExudynEngine
from engine_models.pymunk import workspace
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.library import SCENES
from tests.helpers.arrays import arrays
from tests.helpers.command import crankslider

#: Runs of like blocks hold the same but for small change; one that kept its steps held 3 times as much.
ALIKE = 1.5


def short_run(name: str, steps: int, samples: int) -> Trajectory:
    scene = SCENES[name]().model_copy(update={"end_time_s": 1e-5 * steps})
    return PymunkEngine().simulate(scene, RunSettings(1e-5, samples))


@pytest.mark.parametrize("name", ["ideal-free", "ideal-driven", "clearance-driven-AB", "rigid-driven-AB"])
@pytest.mark.parametrize("block", [5, 37])
def test_the_blocks_of_a_pymunk_run_change_no_bit_of_it(
    name: str, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = short_run(name, 1200, 6)
    monkeypatch.setattr(workspace, "BLOCK_KICKS", block)
    assert arrays(short_run(name, 1200, 6)) == arrays(whole)


@pytest.mark.parametrize("name", ["ideal-driven", "clearance-driven-0.1mm"])
def test_memory_of_a_pymunk_run_does_not_grow_with_its_steps(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workspace, "BLOCK_KICKS", 250)
    peaks = []
    for steps in (1000, 1000, 3000):  # the first imports and caches
        tracemalloc.start()
        short_run(name, steps, 4)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] < ALIKE * peaks[1], f"peaks {peaks} bytes"


@pytest.mark.parametrize(
    ("options", "refusal"),
    [
        (("--samples", "90000"), "--samples: expected at most"),
        (("--engine", "exudyn", "--step", "1e-9"), "--step: expected at least"),
    ],
)
def test_a_run_too_large_for_the_memory_is_refused_in_one_line(
    options: tuple[str, ...], refusal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "free_bytes", lambda: 5_000_000)
    done = crankslider("simulate", "ideal-driven", *options)
    assert done.code == 2
    assert done.stderr.startswith(f"error: {refusal}")
    assert done.stderr.count("\n") == 1


def test_a_study_gets_the_refusal_of_a_run_too_large_as_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_bytes", lambda: 1_000)
    with pytest.raises(UnsupportedScene, match="GB of memory"):
        ExudynEngine().simulate(SCENES["ideal-free"](), RunSettings(1e-4, 10))


def test_what_a_run_leaves_grows_with_its_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand samples of one contact are 1.75 MB."""
    scene, settings = SCENES["clearance-driven-0.5mm"](), RunSettings(1e-4, 999)
    monkeypatch.setattr(memory, "free_bytes", lambda: 1_750_000)
    memory.require_memory(scene, settings)
    monkeypatch.setattr(memory, "free_bytes", lambda: 1_740_000)
    with pytest.raises(memory.TooLarge, match=r"samples: expected at most 993 .* got 999"):
        memory.require_memory(scene, settings)


def test_free_memory_is_a_number_of_bytes() -> None:
    assert 1e6 < memory.free_bytes() < 1e15


@pytest.mark.parametrize(("limit", "free"), [("1000000000", 10**9), ("max", 4_096_000_000)])
def test_a_group_has_no_more_memory_than_it_may(
    limit: str, free: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {"meminfo": "MemTotal: 9000000 kB\nMemAvailable: 4000000 kB\n", "memory.max": f"{limit}\n"}
    monkeypatch.setattr(Path, "read_text", lambda path, **_: files[path.name])
    assert memory.free_bytes() == free

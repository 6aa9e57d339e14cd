"""What an engine says that compiling takes, against the machine code that is there before and after."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from engine_models.arms import NAMED
from engine_models.engine import Engine, RunSettings, Trajectory
from engine_models.engines import engine_class, make_engine
from engine_models.kernels import CompiledEngine
from engine_models.scene.library import ideal_driven
from engine_models.scene.parts import AnyScene
from reference_solver.compiled.store import compiled_anew, kernel_folder, load_kernel

SETTINGS = RunSettings(1e-4, 10)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("CRANKSLIDER_CACHE", str(tmp_path))
    load_kernel.cache_clear()  # of other tests
    yield tmp_path
    load_kernel.cache_clear()


def machine_code() -> set[Path]:
    return set(kernel_folder().rglob("*.nbc"))


class Watched(CompiledEngine):
    """An engine, and how many functions each of its runs compiled."""

    def __init__(self, engine: Engine) -> None:
        self.engine, self.compiled = engine, list[int]()

    def check(self, scene: AnyScene) -> None:
        self.engine.check(scene)

    def simulate(self, scene: AnyScene, settings: RunSettings) -> Trajectory:
        before = machine_code()
        trajectory = self.engine.simulate(scene, settings)
        self.compiled.append(len(machine_code() - before))
        return trajectory


def test_engines_that_compile_say_so() -> None:
    saying = {name for name in NAMED if engine_class(name).compiles}
    assert saying == {"reference", "scipy", "pymunk"}


@pytest.mark.parametrize("name", ["reference", "scipy", "pymunk"])
def test_of_two_runs_the_first_compiles_and_the_kernels_kept_are_left_alone(name: str, cache: Path) -> None:
    scene, engine = ideal_driven(), Watched(make_engine(name))
    engine.simulate(scene, SETTINGS)
    times_before = {path: path.stat().st_mtime_ns for path in cache.rglob("*")}
    assert engine.compile_time_s(scene, SETTINGS) > 0.0
    before, first, second = engine.compiled
    assert (first, second) == (before, 0)
    assert before > 0
    assert {path: path.stat().st_mtime_ns for path in cache.rglob("*")} == times_before


def test_the_folder_of_what_is_compiled_anew_goes_afterwards(cache: Path) -> None:
    with compiled_anew():
        folder = kernel_folder()
        make_engine("reference").simulate(ideal_driven(), SETTINGS)
        assert list(folder.iterdir())
    assert not folder.parent.exists()
    assert os.environ["CRANKSLIDER_CACHE"] == str(cache)

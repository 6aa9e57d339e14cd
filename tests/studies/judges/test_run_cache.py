"""Converged runs are made once: kept on disk by all that decides them, and made again when damaged."""

from pathlib import Path

import pytest

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from reference_solver.kept_files import VARIABLE, kernel_folder
from studies.judges import run_cache
from studies.judges.run_cache import kept_run
from tests.helpers.arrays import arrays

SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-10)
SCENE = SCENES["ideal-driven"]()
SETTINGS = RunSettings(SCENE.end_time_s, 10)


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Scene]:
    """Give the scenes that are really run, in an empty folder."""
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    scenes: list[Scene] = []
    simulate = ReferenceEngine.simulate

    def counted(engine: ReferenceEngine, scene: Scene, settings: RunSettings) -> object:
        scenes.append(scene)
        return simulate(engine, scene, settings)

    monkeypatch.setattr(ReferenceEngine, "simulate", counted)
    return scenes


def test_a_run_is_made_once_and_comes_back_bit_for_bit(runs: list[Scene]) -> None:
    first, second = (kept_run(SHARP, SCENE, SETTINGS) for _ in range(2))
    assert len(runs) == 1
    assert arrays(first) == arrays(second)
    for name in ("step_s", "steps", "solve_time_s"):
        assert getattr(first, name) == getattr(second, name)


def test_whatever_decides_a_run_makes_another_and_a_study_s_code_does_not(
    runs: list[Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    for asked in (
        (SHARP, SCENE, SETTINGS),
        (SHARP.sharper(), SCENE, SETTINGS),
        (SHARP, SCENE.model_copy(update={"gravity_m_s2": 1.62}), SETTINGS),
        (SHARP, SCENE, RunSettings(SCENE.end_time_s, 11)),
    ):
        kept_run(*asked)
    assert len(runs) == 4
    assert {"reference_solver", "engine_models", "studies/judges"} == set(run_cache.CODE)
    assert "studies" not in run_cache.CODE
    monkeypatch.setattr(run_cache, "project_code", lambda folders: f"other code of {folders}")
    kept_run(SHARP, SCENE, SETTINGS)
    assert len(runs) == 5


def test_a_damaged_file_is_made_again(runs: list[Scene]) -> None:
    first = kept_run(SHARP, SCENE, SETTINGS)
    (file,) = kernel_folder().glob("run-*.pickle")
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    again = kept_run(SHARP, SCENE, SETTINGS)
    assert len(runs) == 2
    assert (again.position == first.position).all()

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


def test_a_run_is_made_once_until_something_that_decides_it_is_another_or_its_file_is_damaged(
    runs: list[Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = (kept_run(SHARP, SCENE, SETTINGS) for _ in range(2))
    assert len(runs) == 1
    assert arrays(first) == arrays(second)
    (file,) = kernel_folder().glob("run-*.pickle")
    file.write_bytes(file.read_bytes()[:-1] + b"!")
    assert arrays(kept_run(SHARP, SCENE, SETTINGS)) == arrays(first)
    assert len(runs) == 2
    kept_run(SHARP.sharper(), SCENE, SETTINGS)
    kept_run(SHARP, SCENE.model_copy(update={"gravity_m_s2": 1.62}), SETTINGS)
    kept_run(SHARP, SCENE, RunSettings(SCENE.end_time_s, 11))
    monkeypatch.setattr(run_cache, "project_code", lambda folders: f"other code of {folders}")
    kept_run(SHARP, SCENE, SETTINGS)
    assert len(runs) == 6

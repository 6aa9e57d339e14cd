"""Converged runs are made once: kept on disk by all that decides them, and made again when damaged."""

from pathlib import Path
from unittest import mock

import pytest

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES
from reference_solver.kept_files import VARIABLE, kernel_folder
from studies.judges import run_cache
from studies.judges.run_cache import kept_run
from tests.helpers.arrays import arrays

SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-10)
SCENE = SCENES["ideal-driven"]()
SETTINGS, SIMULATE = RunSettings(SCENE.end_time_s, 10), ReferenceEngine.simulate


def test_a_run_is_made_once_until_something_that_decides_it_is_another_or_its_file_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    with mock.patch.object(ReferenceEngine, "simulate", autospec=True, side_effect=SIMULATE) as runs:
        first, second = (kept_run(SHARP, SCENE, SETTINGS) for _ in range(2))
        assert runs.call_count == 1
        assert arrays(first) == arrays(second)
        (file,) = kernel_folder().glob("run-*.pickle")
        file.write_bytes(file.read_bytes()[:-1] + b"!")
        assert arrays(kept_run(SHARP, SCENE, SETTINGS)) == arrays(first)
        assert runs.call_count == 2
        kept_run(SHARP.sharper(), SCENE, SETTINGS)
        kept_run(SHARP, SCENE.model_copy(update={"gravity_m_s2": 1.62}), SETTINGS)
        kept_run(SHARP, SCENE, RunSettings(SCENE.end_time_s, 11))
        monkeypatch.setattr(run_cache, "project_code", lambda folders: f"other code of {folders}")
        kept_run(SHARP, SCENE, SETTINGS)
        assert runs.call_count == 6

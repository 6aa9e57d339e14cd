"""What an engine says that compiling takes, against the kernels that are there before and after."""

import os
from pathlib import Path

import pytest

from engine_models.engine import RunSettings
from engine_models.engines import ENGINES, engine_class, make_engine
from engine_models.scene_library import ideal_driven
from reference_solver.compiled import compiled_anew, kernel_folder, load_kernel

SETTINGS = RunSettings(1e-3, 10)


def test_engines_that_compile_say_so() -> None:
    assert [name for name in ENGINES if hasattr(engine_class(name), "compile_time_s")] == [
        "reference",
        "scipy",
    ]


@pytest.mark.parametrize("name", ["reference", "scipy"])
def test_compiling_takes_time_and_leaves_the_kept_kernels_alone(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CRANKSLIDER_CACHE", str(tmp_path))
    scene, engine = ideal_driven(), make_engine(name)
    engine.simulate(scene, SETTINGS)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    # Seconds against the millisecond of a run: of two runs with kernels the second is as often longer.
    assert engine.compile_time_s(scene, SETTINGS) > 0.0  # type: ignore[attr-defined]
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    assert os.environ["CRANKSLIDER_CACHE"] == str(tmp_path)


def test_nothing_compiled_is_found_inside_and_the_folder_goes_afterwards() -> None:
    source = "entry = 1\n"
    kept = load_kernel(source)
    with compiled_anew():
        folder = kernel_folder()
        assert not folder.exists()
        assert load_kernel(source) is not kept
        assert list(folder.glob("*.py"))
    assert not folder.parent.exists()
    assert kernel_folder() != folder

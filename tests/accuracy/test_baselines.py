"""The baselines: every number is within its band, and what is not is told, refused or written."""

import math
from pathlib import Path

import pandas as pd
import pytest

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engines import make_engine
from studies import baselines
from studies.baselines import FLOORS, FOLDER, differences, measure_all, read
from studies.failures import BadInput

RUNS = {
    "loose": ("clearance-x", "step 1 s"),
    "smooth": ("ideal-x", "step 1 s"),
    "by": ("rigid-x", "tolerance 1"),
}


def table(kind: str = "smooth", **numbers: float) -> pd.DataFrame:
    scene, setting = RUNS[kind]
    run = {"scene": scene, "engine": "e", "configuration": "c", "setting": setting}
    return pd.DataFrame([{**dict.fromkeys(FLOORS, math.nan), **run, **numbers}])


@pytest.mark.accuracy
def test_every_number_is_within_its_band() -> None:
    lines = differences(measure_all(), read(FOLDER))
    assert not lines, "\n".join(lines)


@pytest.mark.parametrize(
    ("number", "kind", "was", "inside", "outside"),
    [
        ("position_error_m", "smooth", 1e-6, (0.81e-6, 1.24e-6), (0.79e-6, 1.26e-6, math.nan, math.inf)),
        ("position_error_m", "loose", 1e-6, (0.51e-6, 1.99e-6), (0.49e-6, 2.01e-6)),
        ("position_error_m", "by", 1e-6, (0.13e-6, 7.9e-6), (0.12e-6, 8.1e-6)),
        ("position_error_m", "smooth", 2e-13, (0.0, 1e-12), (1.3e-12,)),  # round-off
        ("order", "smooth", 4.0, (3.93, 4.07), (3.9, 4.1, math.nan)),
        ("steps", "by", 1000, (910, 1099), (908, 1101)),
        ("steps", "smooth", math.nan, (math.nan,), (1.0,)),
    ],
)
def test_a_number_has_a_band_to_both_sides(
    number: str, kind: str, was: float, inside: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    before = table(kind, **{number: was})
    assert [differences(table(kind, **{number: value}), before) for value in inside] == [[]] * len(inside)
    for value in outside:
        (line,) = differences(table(kind, **{number: value}), before)
        scene, setting = RUNS[kind]
        assert line.startswith(
            f"{number} of e (c) on {scene}, {setting}: got {value:.4g} (baseline {was:.4g}, band"
        )


def test_every_configuration_has_numbers() -> None:
    accepted = read(FOLDER)
    assert accepted[[*FLOORS]].drop(columns=["order", "peak_force_error_N"]).notna().all(axis=None)
    there = set(zip(accepted["engine"], accepted["configuration"], strict=True))
    own = {make_engine(arm.engine, **arm.settings) for arm in (*baselines.IDEAL, *baselines.LOOSE)}
    catalogue = [arm for arm in vars(arms).values() if isinstance(arm, Arm)]
    for arm in catalogue:
        assert make_engine(arm.engine, **arm.settings) in own, arm.label
    assert {arm.engine for arm in catalogue} == {engine for engine, _ in there}


def test_a_table_comes_back_as_it_was_written_and_is_left_by_other_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = table(steps=1000, position_error_m=1.23456e-7)
    monkeypatch.setattr(baselines, "measure_all", lambda _: measured)
    baselines.compare_or_accept(["e"], tmp_path, "two\nlines")
    assert (tmp_path / baselines.FILE).read_text().startswith("# two lines\n")
    assert baselines.compare_or_accept(["e"], tmp_path, None) == []
    measured["steps"] = 2000
    (line,) = baselines.compare_or_accept(["e"], tmp_path, None)
    assert line.startswith("steps of e (c) on ideal-x, step 1 s: got 2000 (baseline 1000, ")


def test_a_damaged_table_is_refused(tmp_path: Path) -> None:
    for text in ("", "scene,engine\na,b\n", '"'):
        (tmp_path / baselines.FILE).write_text(text)
        with pytest.raises(BadInput, match=r"folder: expected .*baselines\.csv, got"):
            read(tmp_path)

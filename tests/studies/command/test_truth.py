"""The true motion that users hold their own solvers to: certain as far as it goes, and no further."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

import crankslider as cs
from crankslider.reference_solutions import write_reference_solutions
from engine_models.scene.library import MECHANISMS, SCENES
from studies.judges.converged_truth import POINTWISE_M
from studies.judges.metrics import COVERAGE
from tests.helpers.command import crankslider, table_of

PUBLISHED = Path(__file__).parents[3] / "reports/published/truth"


def test_a_table_ends_where_two_solutions_part_and_has_no_impact_past_it(tmp_path: Path) -> None:
    files = "--out", tmp_path / "t.csv", "--impacts", tmp_path / "i.csv"
    told = crankslider("truth", "clearance-driven-0.5mm", "--end", 0.06, "--samples", 120, *files)
    assert told.code == 0
    table, impacts = pd.read_csv(tmp_path / "t.csv"), pd.read_csv(tmp_path / "i.csv")
    end = table["time_s"].iloc[-1]
    assert 0.02 < end < 0.06
    assert (impacts["time_s"] + impacts["duration_s"]).max() <= end
    assert f"warning: two solutions diverge after t = {end:.6g} s; samples end there" in told.stderr
    assert "by independent equations" in told.stderr


def test_the_columns_are_those_of_simulate(tmp_path: Path) -> None:
    for name in ("ideal-driven", "clearance-pendulum"):
        short = (name, "--end", 0.004, "--samples", 4, "--quiet", "--out", "-")
        own, simulated = crankslider("truth", *short), crankslider("simulate", *short)
        assert (own.code, own.stderr) == (0, "")
        assert list(table_of(own.stdout)) == list(table_of(simulated.stdout))
    assert crankslider("truth", *short, "--out", tmp_path / "t.json").code == 0
    made_by = json.loads((tmp_path / "t.json").read_text())["made_by"]
    assert (made_by["engine"], made_by["settings"], made_by["by"]) == ("truth", {}, "independent equations")
    assert 0 < made_by["certain_m"] < 1e-9


def test_what_is_published_is_what_is_solved_here(tmp_path: Path) -> None:
    names = ["ideal-free", "clearance-driven-damped"]
    write_reference_solutions(tmp_path, names)
    for name in names:
        here, there = (
            pd.read_csv(folder / f"{name}.csv.xz", index_col=0) for folder in (tmp_path, PUBLISHED)
        )
        pd.testing.assert_frame_equal(here, there, rtol=1e-6, atol=1e-9)
    certainty = pd.read_csv(PUBLISHED / "certainty.csv").set_index("scene")
    assert set(certainty.index) == set(SCENES)
    by_reference = certainty.index[~certainty["solved_by"].str.startswith("independent")]
    assert all(name.startswith("rigid") for name in by_reference), "pins follow rigid walls"
    assert certainty["slider_position_uncertainty_m"].max() <= COVERAGE * POINTWISE_M
    for name, row in certainty.iterrows():
        times = pd.read_csv(PUBLISHED / f"{name}.csv.xz")["time_s"]
        assert times.iloc[-1] == pytest.approx(row["certain_until_s"], rel=1e-13)  # of fourteen digits


def test_the_truth_of_a_general_scene_says_of_what_it_is_certain(tmp_path: Path) -> None:
    told = crankslider("truth", "four-bar", "--end", 0.02, "--samples", 5, "--out", tmp_path / "true.csv")
    assert told.code == 0, told.stderr
    assert re.search(r"B\.x is certain to \d\.\de-1\d m until t = 0\.02 s, by independent eq", told.stderr)
    of_angle = cs.truth(MECHANISMS["four-bar"]().replace("observe", "rocker.angle"), end=0.02, samples=5)
    assert re.match(r"rocker\.angle is certain to \d\.\de-1\d rad until", of_angle.notes()[0])
    assert of_angle.certain_m < 1e-14
    assert {"observed_rocker_angle_rad", "coupler_x_m"} < {*of_angle.frame.columns}

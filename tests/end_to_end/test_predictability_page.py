"""The predictability chapter on rows with round numbers: every cell, sentence and point worked out here."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reports.chapters import answer
from reports.chapters.predictability import CHAPTER, horizon_turns
from reports.parts import Contradiction, Figure, Finding, Studies, Table
from reports.results import Results
from tests.end_to_end.student import student_quantile
from tests.end_to_end.written_rows import results_of, row

#: Impacts per revolution of four members.
HITS = (8.0, 10.0, 11.0, 11.0)
END_S = {"scene-a": 0.03, "scene-b": 0.02, "scene-c": 0.5}


def horizons(first: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """One scene of three revolutions, one on which nothing parts, one without revolutions."""
    of_scene: dict[str, dict[str, Any]] = {
        "scene-a": {"revolutions": 3.0, "horizon_1nm_s": 0.004, "horizon_1nm_least_s": 0.003},
        "scene-b": {"revolutions": 2.0, "largest_distance_perturbed_m": 2e-12},
        "scene-c": {"revolutions": 0.0, "horizon_halved_1nm_s": 1.25},
    }
    of_scene["scene-a"] |= {"horizon_1nm_largest_s": 0.0052, "horizon_halved_1nm_s": 0.006}
    of_scene["scene-a"] |= {
        "horizon_1um_s": 0.012,
        "horizon_1um_least_s": 0.01,
        "horizon_halved_1um_s": 0.015,
        "horizon_100um_s": 0.02,
        "horizon_100um_least_s": 0.018,
        "horizon_100um_largest_s": 0.024,
        "horizon_halved_100um_s": 0.021,
    }
    rows: list[dict[str, Any]] = []
    curves = {}
    for scene, columns in of_scene.items():
        for end_s in (END_S[scene], END_S[scene] / 2):  # the longer one counts
            common: dict[str, Any] = {
                "part": "horizon",
                "end_time_s": end_s,
                "perturbations": 3,
                "perturbation_rad": 2e-10,
            }
            common |= {"largest_distance_perturbed_m": 1e-4, "largest_distance_halved_m": 1e-12}
            short: dict[str, Any] = (
                {"revolutions": 1.0, "horizon_1nm_s": 1e-5} if end_s != END_S[scene] else {}
            )
            rows.append(
                row(first + len(rows), scene, "reference", "default", 1e-5, **{**common, **columns, **short})
            )
            curves[rows[-1]["case"]] = {
                "time_s": [0.0, end_s / 3, end_s],
                "perturbed_0_m": [0.0, 1e-9, 1e-7],
                "perturbed_1_m": [0.0, -4e-9, 2e-9],
                "perturbed_2_m": [0.0, 2e-9, 3e-8],
                "halved_m": [0.0, 5e-10, -6e-10],
            }
    return rows, curves


def ensembles(first: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Four members of the reference and one of an engine, on one scene; one more has failed."""
    rows: list[dict[str, Any]] = []
    for member, hits in enumerate(HITS):
        columns: dict[str, Any] = {"part": "reference (DOP853)", "member": member, "end_time_s": 0.144}
        columns |= {"impacts_per_revolution": hits, "impact_speed_m_s": 0.5, "rms_slider_deviation_m": 2e-4}
        rows.append(row(first + len(rows), "scene-a", "reference", "DOP853", 1e-5, **columns))
    alone = {"part": "pymunk (as the scene)", "member": 0, "impacts_per_revolution": 7.0}
    rows.append(row(first + len(rows), "scene-a", "pymunk", "as the scene", 1e-5, **alone))
    failed = {"part": "reference (DOP853)", "member": 4, "status": "failed", "reason": "singular"}
    rows.append(row(first + len(rows), "scene-a", "reference", "DOP853", 1e-5, **failed))
    return rows, {}


def written(folder: Path, part: Callable[[int], tuple[list[dict[str, Any]], dict[str, Any]]]) -> Results:
    rows, curves = part(0)
    return results_of(folder / "predictability", rows, curves)


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    rows: list[dict[str, Any]] = []
    curves: dict[str, Any] = {}
    for part in (horizons, ensembles):
        more, of_more = part(len(rows))
        rows, curves = rows + more, curves | of_more
    return {"predictability": results_of(tmp_path_factory.mktemp("results") / "predictability", rows, curves)}


def table(studies: Studies, name: str) -> Table:
    return next(each for each in CHAPTER.tables(studies) if each and each.name == f"predictability-{name}")


def figure(studies: Studies, name: str) -> Figure:
    return next(each for each in CHAPTER.figures(studies) if each and each.name == f"predictability-{name}")


def finding(studies: Studies, name: str) -> Finding:
    return next(each for each in CHAPTER.findings(studies) if each.name == name)


def test_horizons_are_told_in_ms_of_the_longest_run(studies: Studies) -> None:
    shown = table(studies, "horizons")
    columns = [
        f"{at}: {how} [ms]" for at in ("1 nm", "1 µm", "100 µm") for how in ("perturbed", "step halved")
    ]
    assert shown.head == ("scene", "length of the run", *columns, "growth per revolution")
    of_a = "4 (3 to 5.2)", "6", "12 (10 to later)", "15", "20 (18 to 24)", "21"
    assert shown.rows == (  # from 1 nm to 100 µm in 1.6 of three revolutions: ln(1e5) / 1.6
        ("scene-a", "3 revolutions", *of_a, "7.2"),
        ("scene-b", "2 revolutions", *["–"] * 7),
        ("scene-c", "0.5 s", "–", "1250", *["–"] * 5),
    )


def test_the_horizon_is_told_in_revolutions_with_its_ends(studies: Studies) -> None:
    # 18, 20 and 24 of 30 ms, in three revolutions.
    told = finding(studies, "horizon")
    assert told == (
        "A 2.0×10⁻¹⁰ rad change of the initial crank angle grows to 100 µm in 2 revolutions on scene-a, in "
        "the median of the changes; beyond that compare statistics only. No distance exceeds 2 pm on scene-b."
    )
    _, turns, largest = told.numbers
    assert (turns.value, turns.low, turns.high) == pytest.approx((2.0, 1.8, 2.4))
    assert (largest.value, largest.unit) == (2e-12, "m")
    assert horizon_turns(studies["predictability"].rows) == pytest.approx({"scene-a": 2.0})


def test_the_first_screen_warns_of_the_shortest_horizon(studies: Studies) -> None:
    """On scene-b 15 of 20 ms are 1.5 of 2 revolutions; on scene-a it is two."""
    (results,) = studies.values()
    rows = results.rows.copy()
    rows.loc[(rows["scene"] == "scene-b") & (rows["part"] == "horizon"), "horizon_100um_s"] = 0.015
    horizon, *_ = answer.limits({name: replace(results, rows=rows) for name in studies})
    assert (
        "on scene-b a 2.0×10⁻¹⁰ rad change of the initial crank angle grows to 100 µm in 1.5 rev" in horizon
    )


def test_runs_that_part_where_no_horizon_is_seen_contradict_the_chapter(tmp_path: Path) -> None:
    results = written(tmp_path, horizons)
    rows = results.rows.assign(largest_distance_halved_m=2e-9)
    with pytest.raises(Contradiction, match="No distance exceeds 2 nm"):
        finding({"predictability": replace(results, rows=rows)}, "horizon")


def test_distances_of_perturbed_runs_are_drawn_as_the_largest_so_far(studies: Studies) -> None:
    drawing = figure(studies, "growth").drawing
    ends = {"scene-a": (3.0, "crank revolutions"), "scene-b": (2.0, "crank revolutions")}
    ends["scene-c"] = (0.5, "time [s]")
    for panel, (scene, (end, label)) in zip(drawing.axes, ends.items(), strict=True):
        assert (panel.get_title(), panel.get_xlabel()) == (scene, label)
        assert panel.get_ylabel() == "largest distance so far [m]"
        median, least, most, halved = (np.asarray(line.get_xydata()) for line in panel.lines[:4])
        assert median[:, 0] == pytest.approx([0.0, end / 3, end])
        assert median[1:, 1] == pytest.approx([2e-9, 3e-8])
        assert (least[-1, 1], most[-1, 1]) == pytest.approx((4e-9, 1e-7))
        assert halved[1:, 1] == pytest.approx([5e-10, 6e-10])
    marks = [np.asarray(line.get_xydata()) for line in drawing.axes[0].lines if line.get_color() == "#D55E00"]
    # 4, 12 and 20 of 30 ms are 0.4, 1.2 and 2 of three revolutions.
    expected = [[[0.4, 1e-9]], [[1.2, 1e-6]], [[2.0, 1e-4]]]
    assert marks == [pytest.approx(np.array(each)) for each in expected]


def test_means_have_students_interval_over_members(studies: Studies) -> None:
    mean = sum(HITS) / 4
    half = student_quantile(0.025, 3) * math.sqrt(sum((hits - mean) ** 2 for hits in HITS) / 3) / 2
    shown = table(studies, "means-scene-a")
    assert shown.head[:4] == ("ensemble", "members", "impacts per revolution", "impact speed [m/s]")
    assert [line[:4] for line in shown.rows] == [
        ("reference (DOP853)", "4", f"{mean:.3g} ± {half:.1g}", "0.5 ± 0"),
        ("pymunk (as the scene)", "1", "7", "–"),
    ]
    assert shown.rows[0][shown.head.index("slider deviation from ideal [mm]")] == "0.2 ± 0"
    told = finding(studies, "ensemble-scene-a")
    assert told == (
        "Over 4 starts on scene-a, reference (DOP853) has 10 impacts per revolution at 0.5 m/s, in the mean."
    )
    _, hits, _ = told.numbers
    assert (hits.low, hits.high) == pytest.approx((mean - half, mean + half))


def test_without_curves_the_figures_of_curves_are_left_out(studies: Studies) -> None:
    bare = replace(studies["predictability"], store=None)
    assert not bare.has_curves
    assert list(CHAPTER.figures({"predictability": bare})) == []
    names = [each.name for each in CHAPTER.findings({"predictability": bare})]
    assert names == ["horizon", "ensemble-scene-a", "reliability"]

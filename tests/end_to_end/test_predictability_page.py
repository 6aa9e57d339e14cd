"""The predictability chapter on rows with round numbers: every cell, sentence and point worked out here."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from reports.analysis import sweeps
from reports.chapters import answer
from reports.chapters.predictability import CHAPTER, horizon_turns
from reports.parts import Contradiction, Figure, Finding, Studies, Table
from reports.results import Results
from tests.end_to_end.student import student_quantile
from tests.end_to_end.written_rows import results_of, row

#: Exponents per revolution of four starts, and the parts of them that half and a quarter of the run give.
EXPONENTS, HALF, QUARTER = (3.0, 3.5, 4.0, 4.5), 0.9, 0.5
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


def exponents(first: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """A scene with an exponent from every start, one where all settle, one where one does, one cut short."""
    rows: list[dict[str, Any]] = []
    curves = {}
    name = "lyapunov_exponent_per_revolution"
    for scene in ("scene-a", "scene-b", "scene-c", "scene-d"):
        for k, exponent in enumerate(EXPONENTS):
            columns: dict[str, Any] = {"part": "Lyapunov exponent", "end_time_s": 1.0, "revolutions": 9.0}
            columns["settled"] = scene == "scene-b" or (scene, k) == ("scene-c", 0)
            if not columns["settled"] and (scene, k) != ("scene-d", 3):
                parts = {"_quarter": QUARTER, "_half": HALF, "": 1.0}
                columns |= {name + part: times * exponent for part, times in parts.items()}
            rows.append(row(first + len(rows), scene, "reference", "default", 1e-5, **columns))
            # Nothing grows in the first of nine revolutions, and later as the exponent says.
            grown = [0.0, 0.0, 8 * exponent]
            curves[rows[-1]["case"]] = {"time_s": [0.0, 1 / 9, 1.0], "log_growth": grown}
    return rows, curves


#: The diagram: values in m, impacts in a revolution, and where the slider is once a turn.
VALUES_M, IMPACTS, SPEED_RAD_S = (1e-5, 1e-4, 2e-4, 5e-4), (0.0, 1.0, 2.0, 3.0), 200 * math.pi
STROBES_M = (
    [1e-6] * 6,
    [2e-5] * 6,
    [3e-5, 4e-5] * 3,
    [1e-5, 5e-5, 2e-5, 4e-5, 3e-5, 6e-5],
)
#: Per second, of turns that take 10 ms: -0.5 and 2.5 in a revolution, and from half of the turns.
MEASURED = {1e-4: (-50.0, -40.0), 5e-4: (250.0, 240.0)}


def diagram(first: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    curves = {}
    for k in (0, 2):
        columns: dict[str, Any] = {"part": "diagram over clearance", "columns": 4, "in_case": 2, "first": k}
        columns |= {"crank_speed_rad_s": SPEED_RAD_S, "revolutions": 6, "end_time_s": 0.1}
        rows.append(row(first + len(rows), "set R", "reference", "DOP853", 1e-5, **columns))
        found = {value: pair for value, pair in MEASURED.items() if value in VALUES_M[k : k + 2]}
        curves[rows[-1]["case"]] = {
            "value": VALUES_M[k : k + 2],
            "impacts_per_revolution": IMPACTS[k : k + 2],
            "strobe_m": [*STROBES_M[k], *STROBES_M[k + 1]],
            "exponent_value": list(found),
            "exponent_1_s": [whole for whole, _ in found.values()],
            "exponent_half_1_s": [half for _, half in found.values()],
        }
    return rows, curves


#: Of the map's slowest members.
FORCE_N = 2000.0


def exponents_map(first: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """A map of 3 speeds and 100 clearances: exponents of 1 in a revolution, but for a -2 and two of 30.

    Forces go with the third power of the speed, and are twice as large with the widest clearance.
    """
    rows: list[dict[str, Any]] = []
    curves = {}
    for k, odd in enumerate((-2.0, 30.0, 30.0)):
        speed_rad_s = 200 * math.pi * (1 + k)  # a turn in 10 ms, 5 ms, ...
        columns: dict[str, Any] = {"part": "map of exponents", "crank_speed_rad_s": speed_rad_s}
        columns |= {"columns": 100, "in_case": 100, "first": 0, "revolutions": 2, "end_time_s": 0.1}
        rows.append(row(first + k, "set R", "reference", "DOP853", 1e-5, **columns))
        per_s = [100 * (1 + k) * exponent for exponent in (odd, *99 * (1.0,))]
        clearances = np.geomspace(1e-5, 1e-3, 100).tolist()
        curves[rows[-1]["case"]] = {
            "value": clearances,
            "strobe_m": [1e-6] * 200,
            "largest_contact_force_N": [FORCE_N * (1 + k) ** 3 * (1 + (c > 9.9e-4)) for c in clearances],
            "exponent_value": clearances,
            "exponent_1_s": per_s,
            "exponent_half_1_s": per_s,
        }
    return rows, curves


def written(folder: Path, part: Callable[[int], tuple[list[dict[str, Any]], dict[str, Any]]]) -> Results:
    rows, curves = part(0)
    return results_of(folder / "predictability", rows, curves)


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    rows: list[dict[str, Any]] = []
    curves: dict[str, Any] = {}
    for part in (horizons, exponents, diagram, exponents_map):
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
    assert shown.head == ("scene", "length of the run", *columns)
    assert shown.rows == (
        ("scene-a", "3 revolutions", "4 (3 to 5.2)", "6", "12 (10 to later)", "15", "20 (18 to 24)", "21"),
        ("scene-b", "2 revolutions", "–", "–", "–", "–", "–", "–"),
        ("scene-c", "0.5 s", "–", "1250", "–", "–", "–", "–"),
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
    # 3, 4 and 5.2 of 30 ms are 0.3, 0.4 and 0.52 of three revolutions; a last one that is open ends the run.
    expected = [
        *([[0.3, 1e-9], [0.52, 1e-9]], [[0.4, 1e-9]], [[1.0, 1e-6], [3.0, 1e-6]], [[1.2, 1e-6]]),
        *([[1.8, 1e-4], [2.4, 1e-4]], [[2.0, 1e-4]]),
    ]
    assert marks == [pytest.approx(np.array(each)) for each in expected]


def test_exponents_have_students_interval_over_starts(studies: Studies) -> None:
    mean = sum(EXPONENTS) / 4
    scatter = math.sqrt(sum((x - mean) ** 2 for x in EXPONENTS) / 3)
    half = student_quantile(0.025, 3) * scatter / 2
    shown = table(studies, "exponents")
    parts = ("exponent from the first quarter", "exponent from the first half", "exponent from all")
    assert shown.head == ("scene", "starts", "settled", "revolutions", *parts, "motion")
    cells = [f"{times * mean:.3g} ± {times * half:.1g}" for times in (QUARTER, HALF, 1.0)]
    assert shown.rows[0] == ("scene-a", "4", "0", "9", *cells, "chaotic")
    settles = "settles to continuous contact"
    assert shown.rows[1] == ("scene-b", "4", "4", "9", "–", "–", "–", settles)
    assert [(*line[:4], line[-1]) for line in shown.rows[2:]] == [
        ("scene-c", "4", "1", "9", "not decided, because some starts settle"),
        ("scene-d", "4", "0", "9", "not decided, because starts were not followed to the end"),
    ]
    told = finding(studies, "lyapunov-exponents")
    assert told == (
        "The motion is chaotic, by a converged positive Lyapunov exponent per revolution, on scene-a "
        f"({mean:.2g}). Settles to continuous contact: scene-b. Not decided, because some starts settle: "
        "scene-c. Not decided, because starts were not followed to the end: scene-d."
    )
    (number,) = told.numbers
    assert (number.value, number.low, number.high) == pytest.approx((mean, mean - half, mean + half))


def test_the_diagram_shows_strobe_and_exponents_over_the_clearance(studies: Studies) -> None:
    drawing = figure(studies, "diagram-clearance").drawing
    above, below = drawing.axes
    assert above.get_ylabel() == "slider's deviation once a turn / clearance"
    assert below.get_ylabel() == "exponent in a revolution"
    assert (below.get_xlabel(), below.get_xscale()) == ("radial clearance at B [µm]", "log")
    points = np.asarray(above.lines[0].get_xydata())
    strobes = zip(VALUES_M, STROBES_M, strict=True)
    expected = np.array([(1e6 * value, place / value) for value, places in strobes for place in places])
    assert points == pytest.approx(expected)
    whole, _, half = (np.asarray(line.get_xydata()) for line in below.lines)
    assert whole == pytest.approx(np.array([[100.0, -0.5], [500.0, 2.5]]))
    assert half == pytest.approx(np.array([[100.0, -0.4], [500.0, 2.4]]))
    (legend,) = drawing.legends
    colours = [to_hex(handle.get_color()) for handle in legend.legend_handles if isinstance(handle, Line2D)]
    names = [text.get_text() for text in legend.get_texts()]
    assert dict(zip(names, colours, strict=True)) == {
        "exponent from all revolutions": "#000000",
        "from half of them": "#0072b2",
    }
    assert finding(studies, "diagrams") == (
        "The Lyapunov exponent has converged and is above 1 per revolution over clearance at 1 of 2 values, "
        "from 500 µm to 500 µm."
    )


@pytest.mark.parametrize(
    ("whole", "half", "chaotic"),
    [(1.1, 1.3, True), (1.1, 1.4, False), (0.9, 0.9, False), (-2.0, -2.0, False)],
)
def test_chaos_is_claimed_of_a_large_exponent_that_half_of_the_revolutions_give_as_well(
    whole: float, half: float, chaotic: bool
) -> None:
    members = pd.DataFrame({sweeps.EXPONENT: [whole, np.nan], sweeps.HALF: [half, np.nan]})
    assert sweeps.chaotic(members).tolist() == [chaotic]


def test_the_map_of_forces_shows_them_in_kN(studies: Studies) -> None:
    drawing = figure(studies, "map-force").drawing
    (cells,) = drawing.axes[0].collections
    forces = np.asarray(cells.get_array(), dtype=float)
    assert forces[:, 0] == pytest.approx([2.0, 16.0, 54.0])
    assert forces[:, -1] == pytest.approx([4.0, 32.0, 108.0])
    assert [axes.get_ylabel() for axes in drawing.axes] == [
        "crank speed [rad/s]",
        "largest contact force [kN]",
    ]
    (cells,) = figure(studies, "map-exponent").drawing.axes[0].collections
    exponents = np.asarray(cells.get_array(), dtype=float)
    assert exponents[:, 0] == pytest.approx([-2.0, 30.0, 30.0])
    assert exponents[:, 1:] == pytest.approx(np.ones((3, 99)))


def test_without_curves_the_figures_of_curves_are_left_out(studies: Studies, tmp_path: Path) -> None:
    bare = replace(studies["predictability"], folder=tmp_path)
    assert not bare.has_curves
    assert list(CHAPTER.figures({"predictability": bare})) == []
    names = [each.name for each in CHAPTER.findings({"predictability": bare})]
    assert names == ["horizon", "lyapunov-exponents", "reliability"]

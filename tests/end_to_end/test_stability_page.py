"""The stability study on rows with round numbers: every cell, finding and letter of a map worked out here.

The first impact's ω is 1e5 or 2e5 rad/s, so that ωh goes from 1 to 8 or from 2 to 16 as steps are doubled.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure as Drawing

from reports.chapters.limits import CHAPTER, STABILITY
from reports.parts import Contradiction, Finding, Studies, Table
from reports.plots.series import marked
from tests.end_to_end.written_rows import mixed, results_of, row

STEPS_S = (1e-5, 2e-5, 4e-5, 8e-5)
#: What varies by its column: its values with ω, its figure, its axis and what is written there.
MAPS: dict[str, tuple[dict[float, float], str, str, list[str]]] = {
    "contact_stiffness_N_m1_5": (
        {2e10: 1e5, 8e10: 2e5},
        "stability-map-contact-stiffness",
        "contact stiffness [N/m$^{1.5}$]",
        ["$2.0\\cdot 10^{10}$", "$8.0\\cdot 10^{10}$"],
    ),
    "radial_clearance_m": (
        {2e-4: 2e5, 5e-4: 1e5},
        "stability-map-clearance",
        "clearance [mm]",
        ["0.2", "0.5"],
    ),
    "crank_speed_rpm": ({3000.0: 1e5}, "stability-map-crank-speed", "crank speed [rpm]", ["3000"]),
}
#: Configurations in the order of legends with method, theory's limit ωh, and a letter for each step in each
#: row of the three maps: accurate, inaccurate, growing, diverged, timed out, refused.
ARMS: dict[tuple[str, str], tuple[str | None, float | None, tuple[str, ...]]] = {
    ("reference", "located"): (None, None, ("····", "···I", "··II", "···I", "····")),
    ("exudyn", "trapezoidal"): ("trapezoidal", None, ("·IIG", "·III", "·III", "·GII", "IIII")),
    ("exudyn", "RK44"): ("RK4", 2.5, ("·IGD", "··ID", "·GGD", "··GG", "·IID")),
    ("pymunk", "tuned"): ("semi-implicit Euler", 2.0, ("····", "GGDT", "··ID", "···R", "IIGG")),
}
LETTERS = "·IGDTR"
COLOURS = ("#f3f1e4", "#f2c46d", "#d27328", "#8a1c1c", "#20122e", "#ffffff")
BOUNDS = {
    "position_bound_per_clearance": 0.01,
    "constraint_bound_per_clearance": 0.02,
    "energy_bound_per_impact": 0.05,
    "compared_impacts": 5,
}
FINE = {
    "energy_gain_per_impact": 0.04,
    "energy_loss_per_impact": 0.04,
    "constraint_violation_per_clearance": 0.015,
    "position_error_per_clearance": 0.009,
}


def cells() -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    places = [(column, value, omega) for column, (of, *_) in MAPS.items() for value, omega in of.items()]
    for (engine, arm), (method, limit, lines) in ARMS.items():
        for (column, value, omega), letters in zip(places, lines, strict=True):
            for step, letter in zip(STEPS_S, letters, strict=True):
                columns: dict[str, Any] = {column: value, "limit_frequency_step": limit, "method": method}
                columns |= {"impact_frequency_rad_s": omega, **BOUNDS}
                if letter in "TR":
                    columns |= {"status": {"T": "timed out", "R": "unsupported"}[letter], "reason": "so"}
                else:
                    taken = (0.1 if engine == "reference" else 1.0) * step
                    columns |= {"verdict_severity": LETTERS.index(letter), "mean_step_s": taken, **FINE}
                rows.append(row(len(rows), f"{column}-{value}", engine, arm, step, **columns))
    return rows


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    return {STABILITY: results_of(tmp_path_factory.mktemp("results") / STABILITY, cells(), {})}


@pytest.fixture(scope="module")
def findings(studies: Studies) -> dict[str, Finding]:
    return {finding.name: finding for finding in CHAPTER.findings(studies)}


@pytest.fixture(scope="module")
def maps(studies: Studies) -> dict[str, Drawing]:
    """Return the maps by their figures' names."""
    return {figure.name: figure.drawing for figure in CHAPTER.figures(studies) if figure}


def test_boundaries_lie_between_the_last_step_without_and_the_first_with(studies: Studies) -> None:
    tables: list[Table] = [one for one in CHAPTER.tables(studies) if one and one.shown]
    (shown,) = tables
    assert shown.name == "stability-boundaries"
    assert shown.head == (
        *("map", "engine", "configuration", "theory ωh", "growth from ωh", "growth per theory"),
        *("divergence from ωh", "accurate up to ωh"),
    )
    # Between ωh = 2 and 4 lies 2.83, between 4 and 8 5.66, between 8 and 16 11.3; what is met at the shortest
    # step begins there. A time-out is no better than a divergence.
    none = ("–", "–", "–")
    rk44, tuned = ("exudyn", "RK44", "2.5000"), ("pymunk", "tuned", "2.0000")
    located, trapezoidal = ("reference", "located", "none"), ("exudyn", "trapezoidal", "none")
    stiffness, clearance, speed = "contact stiffness", "clearance", "crank speed"
    assert shown.rows == (
        (stiffness, *located, *none, "8"),
        (stiffness, *trapezoidal, "5.7 (1 of 2)", "–", "–", "1 to 2"),
        (stiffness, *rk44, "2.8 to 11", "1.1 to 4.5", "5.7 to 11", "1 to 4"),
        (stiffness, *tuned, "2 (1 of 2)", "1 (1 of 2)", "5.7 (1 of 2)", "8 (1 of 2)"),
        (clearance, *located, *none, "4"),
        (clearance, *trapezoidal, "1.4 (1 of 2)", "–", "–", "1 to 2"),
        (clearance, *rk44, "2.8", "1.1", "11 (1 of 2)", "2"),
        (clearance, *tuned, "11 (1 of 2)", "5.7 (1 of 2)", "11 (1 of 2)", "4"),
        (speed, *located, *none, "8"),
        (speed, *trapezoidal, *none, "–"),
        (speed, *rk44, "5.7", "2.3", "5.7", "1"),
        (speed, *tuned, "2.8", "1.4", "–", "–"),
    )


def test_the_findings_tell_who_gains_energy_and_what_accurate_means(findings: dict[str, Finding]) -> None:
    """RK44 gains energy or diverges in 9 of 20 runs, Pymunk in 7, and the trapezoidal rule in 2."""
    called = sum(line.count("·") for *_, lines in ARMS.values() for line in lines)
    assert findings["energy-growth"] == (
        "No run of reference (located) gains energy beyond its bound or diverges (20 runs). exudyn (RK44) "
        "does so most often: in 45 % of 20 runs."
    )
    assert findings["accurate"] == (
        f"{called} of 80 runs in the maps are called accurate: energy is balanced within 5 % of the first "
        "impact's, gaps of ideal joints are within 2 % of the clearance. The slider is within 1 % of the "
        "clearance through 5 impacts."
    )


@pytest.mark.parametrize("column", FINE)
def test_a_cell_called_accurate_beyond_a_bound_breaks_the_chapter(studies: Studies, column: str) -> None:
    rows = studies[STABILITY].rows
    rows = rows.assign(**{column: rows[column].mask(rows.index == rows.index[0], 1.0)})
    with pytest.raises(Contradiction, match="are called accurate"):
        list(CHAPTER.findings({STABILITY: replace(studies[STABILITY], rows=rows)}))


@pytest.mark.parametrize("column", MAPS)
def test_a_map_has_its_letter_and_colour_at_every_step_and_value(
    maps: dict[str, Drawing], column: str
) -> None:
    values, name, axis, ticks = MAPS[column]
    first = 0 if column.startswith("contact") else 2 if column.startswith("radial") else 4
    panels = maps[name].axes
    titles = ("shortens steps", "no limit", "linear limit ωh = 2.5", "linear limit ωh = 2")
    for place, (panel, (engine, arm), title) in enumerate(zip(panels, ARMS, titles, strict=True)):
        _, limit, lines = ARMS[engine, arm]
        assert panel.get_title() == f"{engine} ({arm})\n{title}"
        assert panel.get_ylabel() == (axis if place % 3 == 0 else "")
        assert panel.get_xlabel() == ("step, or longest step [s]" if place else "")
        assert [text.get_text() for text in panel.get_yticklabels()] == (
            ticks if place % 3 == 0 else [""] * len(values)
        )
        rows = list(zip(values, lines[first : first + len(values)], strict=True))
        expected = [
            (step, value, letter) for value, of in rows for step, letter in zip(STEPS_S, of, strict=True)
        ]
        assert [(*text.get_position(), text.get_text()) for text in panel.texts] == expected
        (mesh,) = panel.collections
        assert isinstance(mesh, QuadMesh)
        drawn = np.asarray(mesh.to_rgba(np.ravel(np.ma.asarray(mesh.get_array()))))
        colours = ["#" + "".join(f"{round(255 * part):02x}" for part in cell[:3]) for cell in drawn]
        assert colours == [COLOURS[LETTERS.index(letter)] for _, _, letter in expected]
        drawn_lines = [line for line in panel.lines if line.get_linestyle() != "None"]
        assert len(drawn_lines) == (limit is not None)
        for line in drawn_lines:
            points = np.asarray(line.get_xydata())[1:-1]
            assert limit is not None
            assert points[:, 0] == pytest.approx([limit / omega for omega in values.values()])
            assert points[:, 1].tolist() == list(values)


def test_the_cells_of_a_map_tell_their_verdicts(maps: dict[str, Drawing]) -> None:
    names = ("accurate", "inaccurate", "energy-growing", "diverged", "timed out", "refused")
    for each, (engine, arm) in zip(marked(maps["stability-map-crank-speed"]), ARMS, strict=True):
        letters = ARMS[engine, arm][2][4]
        assert each.label == f"{engine} ({arm})"
        assert sorted(each.notes) == sorted(names[LETTERS.index(letter)] for letter in letters)


def test_a_figure_has_one_quantity(studies: Studies) -> None:
    assert mixed(one for one in CHAPTER.figures(studies) if one) == []

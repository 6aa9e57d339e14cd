"""The stability study on rows with round numbers: every cell, finding and letter of a map worked out here.

The first impact's ω is 1e5 or 2e5 rad/s, so that ωh goes from 1 to 8 or from 2 to 16 as steps are doubled.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from reports.chapters.limits import CHAPTER, STABILITY
from reports.parts import Contradiction, Finding, Studies, Table, View
from reports.plots.series import marked
from tests.end_to_end.written_rows import mixed, results_of, row

STEPS_S = (1e-5, 2e-5, 4e-5, 8e-5)
#: What varies by its column: its values with ω, its words, its axis and what is written there.
MAPS: dict[str, tuple[dict[float, float], str, str, list[str]]] = {
    "contact_stiffness_N_m1_5": (
        {2e10: 1e5, 8e10: 2e5},
        "contact stiffness",
        "contact stiffness [N/m$^{1.5}$]",
        ["$2.0\\cdot 10^{10}$", "$8.0\\cdot 10^{10}$"],
    ),
    "radial_clearance_m": (
        {2e-4: 2e5, 5e-4: 1e5},
        "clearance",
        "clearance [mm]",
        ["0.2", "0.5"],
    ),
    "crank_speed_rpm": ({3000.0: 1e5}, "crank speed", "crank speed [rpm]", ["3000"]),
}
#: Configurations in the order of legends with theory's limit ωh, and a letter for each of the steps in each
#: row of the three maps: accurate, inaccurate, growing, diverged, timed out, refused.
ARMS: dict[tuple[str, str], tuple[float | None, tuple[str, ...]]] = {
    ("reference", "located"): (None, ("····", "···I", "··II", "···I", "····")),
    ("exudyn", "trapezoidal"): (None, ("·IIG", "·III", "·III", "·GII", "IIII")),
    ("exudyn", "RK44"): (2.5, ("·IGD", "··ID", "·GGD", "··GG", "·IID")),
    ("pymunk", "tuned"): (2.0, ("····", "GGDT", "··ID", "···R", "IIGG")),
}
LETTERS = "·IGDTR"
COLOURS = ("#f3f1e4", "#f2c46d", "#d27328", "#8a1c1c", "#20122e", "#ffffff")
SETTINGS: dict[str, dict[str, Any]] = {
    "trapezoidal": {"setting_solver": "TrapezoidalIndex2"},
    "RK44": {"setting_solver": "RK44", "setting_iterations": 12},
}
BOUNDS = {
    "position_bound_per_clearance": 0.01,
    "constraint_bound_per_clearance": 0.02,
    "energy_bound_per_impact": 0.05,
    "compared_impacts": 5,
}
CHANGES = [
    f"{what}_{how}"
    for what in ("position", "constraint", "energy", "impacts")
    for how in ("halved", "doubled")
]
#: The scalar problem: engine, arm, damping ratio, theory's limit and the measured one ...
LIMITS: tuple[tuple[str, str, float, float | None, float | None], ...] = (
    ("exudyn", "RK44", 0.0, 2.828427, 2.836912),
    ("pymunk", "tuned", 0.5, 1.236068, 1.236068),
    ("exudyn", "trapezoidal", 2.0, None, None),
)
#: ... and ωh with what a step loses: measured, exact, and by the leading term.
LOSSES = (
    ("exudyn", "RK44", 0.5, 2.2e-4, 2.16e-4, 2.17e-4, 0.0045),
    ("exudyn", "trapezoidal", 0.25, 3e-15, 0.0, None, None),
)


def cells() -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for (engine, arm), (limit, lines) in ARMS.items():
        places = [
            (column, value, omega) for column, (values, *_) in MAPS.items() for value, omega in values.items()
        ]
        for (column, value, omega), letters in zip(places, lines, strict=True):
            for k, letter in enumerate(letters):
                severity = LETTERS.index(letter)
                columns: dict[str, Any] = {column: value, "limit_frequency_step": limit, **BOUNDS}
                columns |= {"impact_frequency_rad_s": omega, **SETTINGS.get(arm, {})}
                if letter in "TR":
                    columns |= {"status": {"T": "timed out", "R": "unsupported"}[letter], "reason": "so"}
                else:
                    # Steps within contact are 0.1 to 0.3 µs, one of the four left out.
                    loose = engine == "reference"
                    columns |= {
                        "mean_step_s": (0.1 if loose else 1.0) * STEPS_S[k],
                        "verdict_severity": severity,
                    }
                    columns |= {"contact_step_s": (1e-7, 2e-7, 3e-7, None)[k] if loose else None}
                    columns |= dict.fromkeys(("energy_gain_per_impact", "energy_loss_per_impact"), 0.04)
                    columns |= {
                        "constraint_violation_per_clearance": 0.015,
                        "position_error_per_clearance": 0.009,
                    }
                    columns |= {f"severity_if_{name}": severity for name in CHANGES}
                    if letter == "I":
                        columns["severity_if_position_doubled"] = 0
                    if letter == "·" and arm == "trapezoidal":
                        columns["severity_if_position_halved"] = 1
                    if letter == "G" and engine == "pymunk":
                        columns["severity_if_energy_doubled"] = 1
                rows.append(row(len(rows), f"{column}-{value}", engine, arm, STEPS_S[k], **columns))
    return rows


def scalar(first: int) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for engine, arm, ratio, known, found in LIMITS:
        columns: dict[str, Any] = {"damping_ratio": ratio, "limit_frequency_step": known}
        columns["measured_limit_frequency_step"] = found
        columns["relative_difference"] = None if known is None or found is None else found / known - 1
        columns |= SETTINGS.get(arm, {})
        rows.append(row(first + len(rows), "scalar", engine, arm, 1e-4, **columns))
    for engine, arm, at, measured, exact, leading, off in LOSSES:
        columns = {"frequency_step": at, "energy_loss_per_step": measured, "relative_difference": off}
        columns |= {"expected_energy_loss_per_step": exact, "leading_energy_loss_per_step": leading}
        columns |= SETTINGS.get(arm, {})
        rows.append(row(first + len(rows), "scalar", engine, arm, 1e-4, **columns))
    return rows


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    rows = cells()
    folder = tmp_path_factory.mktemp("results") / STABILITY
    return {STABILITY: results_of(folder, rows + scalar(len(rows)), {})}


def table(studies: Studies, name: str) -> Table:
    return next(one for one in CHAPTER.tables(studies) if one and one.name == f"stability-{name}")


@pytest.fixture(scope="module")
def findings(studies: Studies) -> dict[str, Finding]:
    return {finding.name: finding for finding in CHAPTER.findings(studies)}


@pytest.fixture(scope="module")
def maps(studies: Studies) -> dict[str, View]:
    """Return the views of the maps by the parameter that varies."""
    (figure,) = CHAPTER.figures(studies)
    assert figure
    assert (figure.name, figure.pickers, figure.dense) == ("stability-maps", ("varied parameter",), True)
    return {view.choice[0]: view for view in figure.views}


def test_limits_and_losses_of_the_scalar_problem_stand_beside_theorys(studies: Studies) -> None:
    limits = table(studies, "scalar-limits")
    head = ("engine", "configuration", "theory ωh", "measured ωh", "relative difference")
    assert limits.head == ("damping ratio ζ", *head)
    assert limits.rows == (
        ("0", "exudyn", "RK44", "2.8284", "2.8369", "3.0e-03"),
        ("0.5", "pymunk", "tuned", "1.2361", "1.2361", "0.0e+00"),
        ("2", "exudyn", "trapezoidal", "none", "none", "–"),
    )
    undamped = table(studies, "undamped-limits")
    assert (undamped.shown, limits.shown) == (True, False)
    assert (undamped.head, undamped.rows) == (head, (limits.rows[0][1:],))
    losses = table(studies, "scalar-damping")
    assert losses.head == (
        "ωh",
        "engine",
        "configuration",
        "measured",
        "exact",
        "leading term",
        "relative difference",
    )
    assert losses.rows == (
        ("0.25", "exudyn", "trapezoidal", "0", "0", "0", "–"),
        ("0.5", "exudyn", "RK44", "2.2000e-04", "2.1600e-04", "2.1700e-04", "4.5e-03"),
    )


def test_what_theory_knows_is_recovered(findings: dict[str, Finding]) -> None:
    """Of two limits and one loss the loss is the furthest off, by 0.0045."""
    assert findings["scalar-limits"] == (
        "All 3 stability limits and energy losses per step that theory gives for the scalar test problem are "
        "recovered within 0.45 %. Methods without a limit in theory have none up to ωh = 64: exudyn "
        "(trapezoidal)."
    )


@pytest.mark.parametrize("column", ["relative_difference", "measured_limit_frequency_step"])
def test_a_limit_that_theory_does_not_know_breaks_the_chapter(studies: Studies, column: str) -> None:
    rows = studies[STABILITY].rows
    rows = rows.assign(**{column: rows[column].fillna(3.0) + 0.02})
    with pytest.raises(Contradiction, match="that theory gives"):
        list(CHAPTER.findings({STABILITY: replace(studies[STABILITY], rows=rows)}))


def test_boundaries_lie_between_the_last_step_without_and_the_first_with(
    studies: Studies,
) -> None:
    shown = table(studies, "boundaries")
    assert shown.head == (
        *("map", "engine", "configuration", "theory ωh", "growth from ωh", "growth per theory"),
        *("divergence from ωh", "divergence per theory", "accurate up to ωh", "steps in contact [µs]"),
    )
    # Between ωh = 2 and 4 lies 2.83, between 4 and 8 5.66, between 8 and 16 11.3; what is met at the shortest
    # step begins there. A time-out is no better than a divergence.
    none, contact = ("–", "–", "–", "–"), "0.1 to 0.3"
    rk44, tuned = ("exudyn", "RK44", "2.5000"), ("pymunk", "tuned", "2.0000")
    located, trapezoidal = ("reference", "located", "none"), ("exudyn", "trapezoidal", "none")
    stiffness, clearance, speed = "contact stiffness", "clearance", "crank speed"
    assert shown.rows == (
        (stiffness, *located, *none, "8", contact),
        (stiffness, *trapezoidal, "5.7 (1 of 2)", "–", "–", "–", "1 to 2", "–"),
        (stiffness, *rk44, "2.8 to 11", "1.1 to 4.5", "5.7 to 11", "2.3 to 4.5", "1 to 4", "–"),
        (stiffness, *tuned, "2 (1 of 2)", "1 (1 of 2)", "5.7 (1 of 2)", "2.8 (1 of 2)", "8 (1 of 2)", "–"),
        (clearance, *located, *none, "4", contact),
        (clearance, *trapezoidal, "1.4 (1 of 2)", "–", "–", "–", "1 to 2", "–"),
        (clearance, *rk44, "2.8", "1.1", "11 (1 of 2)", "4.5 (1 of 2)", "2", "–"),
        (clearance, *tuned, "11 (1 of 2)", "5.7 (1 of 2)", "11 (1 of 2)", "5.7 (1 of 2)", "4", "–"),
        (speed, *located, *none, "8", contact),
        (speed, *trapezoidal, *none, "–", "–"),
        (speed, *rk44, "5.7", "2.3", "5.7", "2.3", "1", "–"),
        (speed, *tuned, "2.8", "1.4", "–", "–", "–", "–"),
    )


def counted(letter: str) -> int:
    return sum(line.count(letter) for _, lines in ARMS.values() for line in lines)


def test_the_findings_tell_who_gains_energy_and_what_accurate_means(findings: dict[str, Finding]) -> None:
    """RK44 gains energy or diverges in 9 of 20 runs, Pymunk in 7, and the trapezoidal rule in 2."""
    assert findings["energy-growth"] == (
        "No run of reference (located) gains energy beyond its bound or diverges (20 runs). exudyn (RK44) "
        "does so most often: in 45 % of 20 runs."
    )
    assert findings["accurate"] == (
        f"{counted('·')} of 80 runs in the maps are called accurate: energy is balanced within 5 % of the "
        "first impact's, gaps of ideal joints are within 2 % of the clearance. The slider is within 1 % of "
        "the clearance through 5 impacts. The most verdicts change with the bound on position doubled: "
        f"{counted('I')}."
    )


def test_verdicts_that_hang_on_a_bound_are_counted_by_arm(studies: Studies) -> None:
    shown = table(studies, "bounds")
    names = {"position": "bound on position", "constraint": "bound on joints"}
    names |= {"energy": "bound on energy", "impacts": "number of impacts compared"}
    changes = tuple(f"{name} {how}" for name in names.values() for how in ("halved", "doubled"))
    assert shown.head == ("engine", "configuration", "verdicts", "accurate", *changes)
    expected = []
    for (engine, arm), (_, lines) in ARMS.items():
        letters = "".join(lines)
        growing = letters.count("G") if engine == "pymunk" else 0
        close = letters.count("·") if arm == "trapezoidal" else 0
        of_change = {
            "position halved": close,
            "position doubled": letters.count("I"),
            "energy doubled": growing,
        }
        numbers = [of_change.get(name.replace("_", " "), 0) for name in CHANGES]
        expected.append((engine, arm, *map(str, (20, letters.count("·"), *numbers))))
    assert list(shown.rows) == expected


@pytest.mark.parametrize("column", MAPS)
def test_a_map_has_its_letter_and_colour_at_every_step_and_value(maps: dict[str, View], column: str) -> None:
    values, words, axis, ticks = MAPS[column]
    first = 0 if column.startswith("contact") else 2 if column.startswith("radial") else 4
    panels = maps[words].drawing.axes
    titles = (
        "no limit; 0.1 to 0.3 µs in contact",
        "no limit",
        "linear limit ωh = 2.5",
        "linear limit ωh = 2",
    )
    for place, (panel, (engine, arm), title) in enumerate(zip(panels, ARMS, titles, strict=True)):
        limit, lines = ARMS[engine, arm]
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


def test_the_cells_of_a_map_tell_their_verdicts(maps: dict[str, View]) -> None:
    names = ("accurate", "inaccurate", "energy-growing", "diverged", "timed out", "refused")
    for each, (engine, arm) in zip(marked(maps["crank speed"].drawing), ARMS, strict=True):
        letters = ARMS[engine, arm][1][4]
        assert each.label == f"{engine} ({arm})"
        assert sorted(each.notes) == sorted(names[LETTERS.index(letter)] for letter in letters)


def test_a_figure_has_one_quantity(studies: Studies) -> None:
    assert mixed(one for one in CHAPTER.figures(studies) if one) == []

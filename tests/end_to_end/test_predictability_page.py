"""The predictability chapter on rows with round numbers: every cell, sentence and point worked out here."""

import math
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from reports.chapters import predictability
from reports.parts import Figure, Section, Table
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
        "scene-c": {"revolutions": 0.0, "horizon_halved_1nm_s": 0.25},
    }
    of_scene["scene-a"] |= {"horizon_1nm_largest_s": 0.0052, "horizon_halved_1nm_s": 0.006}
    of_scene["scene-a"] |= {
        "horizon_1um_s": 0.012,
        "horizon_1um_least_s": 0.01,
        "horizon_halved_1um_s": 0.015,
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
        columns |= {"exponent_revolutions": 24.0, "end_time_s": 0.1}
        rows.append(row(first + k, "set R", "reference", "DOP853", 1e-5, **columns))
        per_s = [100 * (1 + k) * exponent for exponent in (odd, *99 * (1.0,))]
        clearances = np.geomspace(1e-5, 1e-3, 100).tolist()
        curves[rows[-1]["case"]] = {
            "largest_contact_force_N": [FORCE_N * (1 + k) ** 3 * (1 + (c > 9.9e-4)) for c in clearances],
            "exponent_value": clearances,
            "exponent_1_s": per_s,
            "exponent_half_1_s": per_s,
        }
    return rows, curves


@pytest.fixture(scope="module")
def sections(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Section]:
    rows: list[dict[str, Any]] = []
    curves: dict[str, Any] = {}
    for part in (horizons, exponents, diagram, exponents_map):
        more, of_more = part(len(rows))
        rows, curves = rows + more, curves | of_more
    results = results_of(tmp_path_factory.mktemp("results") / "predictability", rows, curves)
    return {section.name: section for section in predictability.sections(results)}


def table(sections: dict[str, Section], name: str) -> Table:
    found = (one for section in sections.values() for one in section.tables)
    return next(one for one in found if one.name == f"predictability-{name}")


def figure(sections: dict[str, Section], name: str) -> Figure:
    found = (one for section in sections.values() for one in section.figures)
    return next(one for one in found if one.name == f"predictability-{name}")


def test_horizons_are_told_in_ms_of_the_longest_run(sections: dict[str, Section]) -> None:
    shown = table(sections, "horizons")
    columns = [
        f"{at}: {how} [ms]" for at in ("1 nm", "1 µm", "100 µm") for how in ("perturbed", "step halved")
    ]
    assert shown.head == ("scene", "followed for", *columns)
    assert shown.rows == (
        ("scene-a", "3 revolutions", "4 (3 to 5.2)", "6", "12 (10 to later)", "15", "–", "–"),
        ("scene-b", "2 revolutions", "–", "–", "–", "–", "–", "–"),
        ("scene-c", "0.5 s", "–", "250", "–", "–", "–", "–"),
    )
    # 12 of 30 ms, in three revolutions.
    assert sections["horizons"].text == (
        "Nothing parts on scene-b: all twins stay within 2.0×10⁻¹² m of the reference.",
        "Elsewhere runs part whose start is moved by 2.0×10⁻¹⁰ rad, or whose step is halved.",
        "On scene-a the slider is off by 1 µm after 1.2 revolutions.",
        "On scene-c the slider is off by 1 nm after 0.25 s.",
    )


def test_distances_of_twins_are_drawn_as_the_largest_so_far(sections: dict[str, Section]) -> None:
    panels = figure(sections, "growth").drawing.axes
    ends = {
        "scene-a": (3.0, "crank revolutions"),
        "scene-b": (2.0, "crank revolutions"),
        "scene-c": (0.5, "time [s]"),
    }
    for panel, (scene, (end, label)) in zip(panels, ends.items(), strict=True):
        assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == (
            scene,
            label,
            "distance so far [m]",
        )
        median, halved = (np.asarray(line.get_xydata()) for line in panel.lines[:2])
        assert median[:, 0] == pytest.approx([0.0, end / 3, end])
        assert median[1:, 1] == pytest.approx([2e-9, 3e-8])
        assert halved[1:, 1] == pytest.approx([5e-10, 6e-10])
    marks = [
        np.asarray(line.get_xydata()).tolist() for line in panels[0].lines if line.get_color() == "#D55E00"
    ]
    # 3, 4 and 5.2 of 30 ms are 0.3, 0.4 and 0.52 of three revolutions; a last one that is open ends the run.
    bars = ([[0.3, 1e-9], [0.52, 1e-9]], [[0.4, 1e-9]], [[1.0, 1e-6], [3.0, 1e-6]], [[1.2, 1e-6]])
    assert [np.array(each) for each in marks] == [pytest.approx(np.array(each)) for each in bars]


def test_exponents_have_students_interval_over_starts(sections: dict[str, Section]) -> None:
    mean = sum(EXPONENTS) / 4
    scatter = math.sqrt(sum((x - mean) ** 2 for x in EXPONENTS) / 3)
    half = student_quantile(0.025, 3) * scatter / 2
    shown = table(sections, "exponents")
    parts = ("from a quarter", "from half", "from all")
    assert shown.head == ("scene", "starts", "settled", "with an exponent", "revolutions", *parts)
    cells = [f"{times * mean:.3g} ± {times * half:.1g}" for times in (QUARTER, HALF, 1.0)]
    assert shown.rows[0] == ("scene-a", "4", "0", "4", "9", *cells)
    assert shown.rows[1] == ("scene-b", "4", "4", "0", "9", "–", "–", "–")
    assert [line[:5] for line in shown.rows[2:]] == [
        ("scene-c", "4", "1", "3", "9"),
        ("scene-d", "4", "0", "3", "9"),
    ]
    assert sections["exponents"].text[1:] == (
        f"On scene-a neighbouring motions part with an exponent of {mean:.2f} ± {half:.2f} per "
        "revolution, which is "
        "chaos.",
        f"From half of each run it is {HALF * mean:.2f} ± {HALF * half:.2f}.",
        "On scene-c 1 of 4 starts settle to continuous contact: what is chaotic there may all be "
        "transient, and "
        "nothing is claimed.",
        "On scene-d only 3 of 4 starts could be followed for half of the run, and nothing is claimed.",
        "No exponent is given where every start settles to continuous contact: scene-b (within 9 "
        "revolutions).",
    )
    (panel,) = figure(sections, "exponents").drawing.axes
    labels = (panel.get_title(), panel.get_xlabel(), panel.get_ylabel())
    assert labels == ("scene-a", "revolutions used", "exponent per revolution")
    *starts, middle, _ = (np.asarray(line.get_xydata()) for line in panel.lines)
    assert [start[-1].tolist() for start in starts] == [pytest.approx([8.0, x]) for x in EXPONENTS]
    assert middle[:, 1] == pytest.approx([mean] * 8)


def test_the_diagram_tells_what_settles_repeats_and_is_chaotic(sections: dict[str, Section]) -> None:
    assert sections["diagrams"].text == (
        "Over the clearance, the pin stays at the wall at all values up to 0.01 mm.",
        "With impacts, the motion repeats every turn: at 0.1 mm.",
        "With impacts, the motion repeats after 2 turns: at 0.2 mm.",
        "The motion is chaotic at all values from 0.5 mm on.",
        "There the exponent is more than 1 in a revolution, and half of the revolutions give it within 20 %. "
        "It was measured at 2 values.",
        "Of 300 members over clearance and speed the hardest contact has 108 kN. "
        "It is found with 1 mm at 1885 rad/s.",
        "At four of five clearances the largest force grows as the speed to the power of 3.0 to 3.0; in "
        "ideal joints it would be 2.",
    )
    above, below = figure(sections, "diagram-over-clearance").drawing.axes
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
    (legend,) = figure(sections, "diagram-over-clearance").drawing.legends
    colours = [to_hex(handle.get_color()) for handle in legend.legend_handles if isinstance(handle, Line2D)]
    names = [text.get_text() for text in legend.get_texts()]
    assert dict(zip(names, colours, strict=True)) == {
        "exponent from all revolutions": "#000000",
        "from half of them": "#0072b2",
    }


def test_the_map_of_forces_shows_them_in_kN(sections: dict[str, Section]) -> None:
    drawing = figure(sections, "map-of-forces").drawing
    (cells,) = drawing.axes[0].collections
    shown = np.asarray(cells.get_array(), dtype=float)
    assert shown[:, 0] == pytest.approx([2.0, 16.0, 54.0])
    assert shown[:, -1] == pytest.approx([4.0, 32.0, 108.0])
    assert [axes.get_ylabel() for axes in drawing.axes] == [
        "crank speed [rad/s]",
        "largest contact force [kN]",
    ]


def test_the_caption_of_the_map_says_where_colours_end_and_what_lies_beyond(
    sections: dict[str, Section],
) -> None:
    reading = figure(sections, "map-of-exponents").reading
    # Of 300 sizes all but one in a hundred are within the third largest, which is that of the -2.
    assert reading.endswith("after a transient. Colours end at -2 and 2; 2 members lie beyond.")

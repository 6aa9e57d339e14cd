"""The gallery of motions on curves with round numbers: every line, cell, sentence and unit worked out "
"here."""

import json
import math
import re
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.lines import Line2D

from reports import gallery
from reports.parts import Figure, Section
from tests.end_to_end.written_motions import ARMS, IDEAL, LOOSE, SAMPLES, SIGNALS, TURNED_DEG, motions
from tests.end_to_end.written_rows import mixed


@pytest.fixture(scope="module")
def sections(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Section]:
    results = motions(tmp_path_factory.mktemp("results") / "motions")
    return {section.name: section for section in gallery.sections(results)}


def figure(sections: dict[str, Section], name: str) -> Figure:
    found = (one for section in sections.values() for one in section.figures)
    return next(one for one in found if one.name == name)


def points(line: Line2D) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.asarray(line.get_xydata())


def corners(area: Collection) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.asarray(area.get_paths()[0].vertices)


def labels(panel: Axes) -> tuple[str, str]:
    return panel.get_xlabel(), panel.get_ylabel()


@pytest.mark.parametrize("column", SIGNALS)
def test_a_signal_and_its_error_are_drawn_over_the_cranks_turn(
    sections: dict[str, Section], column: str
) -> None:
    size, name, axis, unit, factor = SIGNALS[column]
    (left,) = figure(sections, f"motions-{name}-ideal").drawing.axes
    (right,) = figure(sections, f"motions-{name}-error-ideal").drawing.axes
    assert (left.get_title(), right.get_title()) == (IDEAL, IDEAL)
    assert (labels(left), labels(right)) == (
        ("crank's turn [°]", axis),
        ("crank's turn [°]", f"error [{unit}]"),
    )
    assert right.get_yscale() == "log"
    truth = np.array([[turn, factor * size * (k + 1)] for k, turn in enumerate(TURNED_DEG)])
    first, *runs = left.lines
    assert points(first) == pytest.approx(truth)
    for run, error, (off, colour) in zip(runs, right.lines, ARMS.values(), strict=True):
        assert (run.get_color(), error.get_color()) == (colour, colour)
        assert points(run) == pytest.approx(truth * (1.0, 1 + off))
        assert points(error) == pytest.approx(truth * (1.0, off / factor))


def test_the_deviation_is_drawn_in_micrometres_on_scenes_with_clearance(sections: dict[str, Section]) -> None:
    (left,) = figure(sections, "motions-deviation-clearance").drawing.axes
    (right,) = figure(sections, "motions-deviation-error-clearance").drawing.axes
    assert (left.get_title(), left.get_ylabel()) == (LOOSE, "slider's\ndeviation [µm]")
    assert right.get_ylabel() == "error [m]"
    assert [points(line)[-1].tolist() for line in left.lines] == [
        pytest.approx([360.0, top]) for top in (120.0, 120.12, 121.2)
    ]
    # Errors are those of the position, whose truth ends at 13 times 10 mm.
    assert [points(line)[-1, 1] for line in right.lines] == pytest.approx([1.3e-4, 1.3e-3])


def test_the_contact_force_is_drawn_in_kn_and_who_misses_it_by_most_is_told(
    sections: dict[str, Section],
) -> None:
    # A millimetre deep at the end, at 4e6 N/m, of which one in a hundred.
    assert sections["clearance"].text == (
        f"On {LOOSE} the pin of joint B is pressed with up to 4 kN; exudyn (trapezoidal) is the furthest "
        "from the "
        "truth's force at the same time, by 40 N.",
    )
    drawing = figure(sections, f"motions-contact-force-{LOOSE}-B").drawing
    assert drawing.get_supylabel() == "contact force in joint B [kN]"
    assert drawing.axes[-1].get_xlabel() == "crank's turn [°]"
    for panel, ((engine, arm), (off, colour)) in zip(drawing.axes, ARMS.items(), strict=True):
        assert panel.get_title(loc="left") == f"{engine} ({arm})"
        truth, run = (points(line) for line in panel.lines)
        assert truth[:, 0].tolist() == pytest.approx(TURNED_DEG)
        assert truth[[4, 12], 1] == pytest.approx([0.0, 4.0])
        assert run[12, 1] == pytest.approx(4.0 * (1 + off))
        assert panel.lines[1].get_color() == colour


def test_an_impact_is_drawn_from_its_touch_over_time_and_depth(sections: dict[str, Section]) -> None:
    over_time, over_depth = figure(sections, "motions-impact").drawing.axes
    assert labels(over_time) == ("time since touch [µs]", "contact force [kN]")
    assert over_depth.get_xlabel() == "penetration [µm]"
    factors = [1.0, *(1 + off for off, _ in ARMS.values())]
    for line, factor in zip(over_time.lines, factors, strict=True):
        # The wall is met at the fourth sample, and a sample is 1000 µs.
        assert points(line)[:, 0] == pytest.approx([1000.0 * (k - 4) for k in range(SAMPLES)])
        assert points(line)[-1, 1] == pytest.approx(4.0 * factor)
    for line, factor in zip(over_depth.lines, factors, strict=True):
        assert points(line)[[0, -1]] == pytest.approx(
            np.array([[125.0, 0.5 * factor], [1000.0, 4.0 * factor]])
        )
    (panel,) = figure(sections, "motions-impact-error").drawing.axes
    assert labels(panel) == ("time since touch [µs]", "size of the error of\nthe contact force [N]")
    assert [points(line)[-1, 1] for line in panel.lines] == pytest.approx([4.0, 40.0])


def test_a_legend_explains_the_truth_where_it_is_drawn(sections: dict[str, Section]) -> None:
    engines = [f"{engine} ({arm})" for engine, arm in ARMS]
    for name, truth in (
        ("impact", ["truth"]),
        ("impact-error", []),
        ("slider-position-ideal", ["truth"]),
        ("slider-position-error-ideal", []),
    ):
        (legend,) = figure(sections, f"motions-{name}").drawing.legends
        assert [text.get_text() for text in legend.get_texts()] == [*truth, *engines]


def test_laws_stand_in_the_order_of_their_loss_going_in_and_out(sections: dict[str, Section]) -> None:
    shown = figure(sections, "motions-laws")
    assert "at restitution 0.5" in shown.reading
    labels = (shown.drawing.get_supxlabel(), shown.drawing.get_supylabel())
    assert labels == ("penetration [µm]", "contact force [kN]")
    panels = shown.drawing.axes
    assert [panel.get_title() for panel in panels] == ["hertz", "gonthier", "flores"]
    for panel, less in zip(panels, (1.0, 0.9, 0.8), strict=True):
        way_in, way_out = panel.lines[-2:]
        assert [line.get_label() for line in (way_in, way_out)] == ["pin going in", "pin going out"]
        assert points(way_in) == pytest.approx(np.array([[0, 0], [10, 2.0], [20, 4.0], [30, 6.0]]))
        assert points(way_out) == pytest.approx(np.array([[30, 6.0], [20, 4 * less], [10, 2 * less], [0, 0]]))


def test_the_pin_goes_its_way_in_a_circle_of_the_clearance(sections: dict[str, Section]) -> None:
    drawing = figure(sections, f"motions-orbit-{LOOSE}-B").drawing
    assert (drawing.get_supxlabel(), drawing.get_supylabel()) == ("x of the pin [µm]", "y of the pin [µm]")
    every_third = np.array([[100.0 * k, 75.0 * k] for k in range(0, SAMPLES, 3)])
    for panel, (engine, arm) in zip(drawing.axes, ARMS, strict=False):
        assert panel.get_title() == f"{engine}\n({arm})"
        (circle,) = panel.patches
        assert circle.get_transform().transform((1.0, 0.0)) == pytest.approx(
            panel.transData.transform((500.0, 0.0))
        )
        assert points(panel.lines[1]) == pytest.approx(every_third)


def test_energies_are_stacked_on_what_was_there_and_came_in(sections: dict[str, Section]) -> None:
    whole, part = figure(sections, "motions-energy").drawing.axes
    assert labels(whole) == labels(part) == ("crank's turn [°]", "energy [J]")
    titles = (whole.get_title(loc="left"), part.get_title(loc="left"))
    assert titles == (LOOSE, "contacts alone")
    names = ["kinetic", "height, above the lowest", "dissipated in contacts", "elastic in contacts"]
    assert [area.get_label() for area in whole.collections] == names
    # At the end 34, 0 (it began 1.2 J higher), 0.6 and 0.36 J, on each other.
    heights = ((0.0, 34.0), (34.0, 34.0), (34.0, 34.6), (34.6, 34.96))
    for area, (low, high) in zip(whole.collections, heights, strict=True):
        ends = [y for x, y in corners(area) if x == pytest.approx(360.0)]
        assert (min(ends), max(ends)) == pytest.approx((low, high))
    for area, top in zip(part.collections, (0.6, 0.96), strict=True):
        assert corners(area)[:, 1].max() == pytest.approx(top)
    (given,) = whole.lines
    # 10 J and a height of 1.2 J at first, and then 1.98 J a sample.
    assert points(given) == pytest.approx(np.array([[0.0, 11.2], [180.0, 23.08], [360.0, 34.96]]))


def test_a_card_tells_the_numbers_of_its_scene(sections: dict[str, Section]) -> None:
    (card,) = sections["scenes"].figures
    assert (card.name, card.title) == (f"scene-{LOOSE}", LOOSE)
    assert card.reading == (
        "Set R with a loose pin. lengths: 50, 120 mm; masses: 0.3, 0.21, 0.14 kg; drive: constant 523.6 "
        "rad/s; "
        "clearance B: 0.5 mm, lankarani-nikravesh, restitution 0.9; lasts: 12 ms; largest force: 5200 N "
        "in joint A. "
        "7 contacts that end; the shortest lasts 24 µs, one part in 500 of the run. By reference (none)."
    )
    _, over_time, orbit = card.drawing.axes
    assert (over_time.get_xlabel(), over_time.get_title()) == ("time [ms]", "slider position [mm]")
    assert points(over_time.lines[0]) == pytest.approx(np.array([[k, 170.0 - k] for k in range(SAMPLES)]))
    assert orbit.get_title() == "pin B [µm]"
    assert points(orbit.lines[0])[-1].tolist() == pytest.approx([1200.0, 900.0])


def test_the_mechanism_is_drawn_in_proportion_with_the_numbers_of_its_scene(
    sections: dict[str, Section],
) -> None:
    mechanism, _, text = figure(sections, "motions-mechanism").drawing.axes
    links = next(line for line in mechanism.lines if line.get_linewidth() == 4)
    crank, rod = np.diff(points(links), axis=0)
    assert (np.hypot(*crank), np.hypot(*rod)) == pytest.approx((50.0, 120.0))
    assert points(links)[-1, 1] == 0.0
    (lines,) = text.texts
    assert lines.get_text().splitlines() == [
        "$r$ = 50 mm, $L$ = 120 mm",
        "masses 0.3, 0.21, 0.14 kg",
        "inertias 0.0001, 0.00025 kg m²",
        "$R$ = 10 mm, $c$ = 0.5 mm",
        "penetration $\\delta$ = |$\\mathbf{d}$| − $c$",
        "$F_n$ = 0 while $\\delta$ < 0: the pin flies",
        "contact law lankarani-nikravesh",
        "restitution 0.9",
        "modulus 207 GPa, Poisson 0.3",
    ]


def test_the_film_has_every_engine_where_it_is_in_mm(sections: dict[str, Section]) -> None:
    found = re.search(r"const film = (.*);\n", sections["film"].markup)
    assert found
    film = json.loads(found[1])
    numbers = {name: film[name] for name in ("crank_mm", "rod_mm", "clearance_mm")}
    assert numbers == {"crank_mm": 50.0, "rod_mm": 120.0, "clearance_mm": 10.0}  # 20 times 0.5 mm
    assert (len(film["times_ms"]), film["times_ms"][-1]) == (240, 12.0)
    assert [(view["label"], view["colour"]) for view in film["views"][1:]] == [
        (f"{engine} ({arm})", colour) for (engine, arm), (_, colour) in ARMS.items()
    ]
    for view, off in zip(film["views"], (0.0, 0.001, 0.01), strict=True):
        slider = 130 * (1 + off)
        gap = (24.0, 18.0)  # 20 times 1.2 and 0.9 mm
        crank = (50 * math.cos(0.5), 50 * math.sin(0.5))
        assert view["pictures"][-1] == pytest.approx(
            [*crank, slider - gap[0], -gap[1], slider, *gap], abs=0.005
        )


def test_settings_and_what_did_not_finish_are_told(sections: dict[str, Section]) -> None:
    (settings,) = sections["runs"].tables
    assert settings.rows == (
        ("reference", "none", "the defaults"),
        ("exudyn", "trapezoidal", "the defaults"),
        ("pymunk", "tuned", "iterations = 30"),
    )
    failures = sections["motions-failures"]
    assert failures.text == (
        "By its own word an engine failed in 0 of 11 runs.",
        "Ended by a check of ours, or by a limit of time or memory: 1.",
    )
    (table,) = failures.tables
    assert table.head == ("scene", "engine", "arm", "step [s]", "status", "said by", "reason")
    failed = (IDEAL, "pymunk", "tuned", "1.0e-03", "failed", "a check of ours", "not finite at t = 0.003 s")
    assert table.rows == (failed,)


def test_a_figure_has_one_quantity(sections: dict[str, Section]) -> None:
    assert mixed(sections) == []

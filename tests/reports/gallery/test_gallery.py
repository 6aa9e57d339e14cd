"""The gallery from small runs: figures hold the curves' numbers, and what is missing leaves no hole."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing
from matplotlib.text import Text

from engine_models.engine import RunSettings
from reports import gallery
from reports.gallery.cards import Card, scene_cards
from reports.gallery.film import PICTURES, film_html
from reports.gallery.markup import equations_html
from reports.parts import Figure
from reports.results import Results, read_study
from reports.style import ENGINES, RC
from studies import motions
from studies.running.case import Case
from studies.running.runner import run_study

CLEARANCE, DRIVEN = "clearance-driven-0.5mm", "ideal-driven"
#: Of a revolution with clearance the first impacts are run, in so many samples.
SHORT_S, SAMPLES = 0.001, 200
WHOLE = ("ideal-free", CLEARANCE, "clearance-pendulum")
#: A film is said to be no larger than this.
FILM_BYTES = 300_000


def shortened(case: Case) -> Case:
    """Return a case of the test: a revolution with clearance cut short."""
    if case.columns["view"] != "revolution" or case.scene.name != CLEARANCE:
        return case
    scene = case.scene.model_copy(update={"end_time_s": SHORT_S})
    return replace(case, scene=scene, run=RunSettings(case.run.step_s, SAMPLES))


def chosen(case: Case) -> bool:
    """Return whether a case of the quick set is run in the test."""
    view, engine, scene = case.columns["view"], case.engine, case.scene.name
    if view == "revolution":
        return (scene, engine) in {
            (DRIVEN, "reference"),
            (DRIVEN, "pymunk"),
            (CLEARANCE, "reference"),
            (CLEARANCE, "pymunk"),
        }
    return {
        "impact": engine in ("reference", "pymunk"),
        "law": case.columns.get("law") in ("hertz", "flores"),
        "whole": scene in WHOLE,
    }[str(view)]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("motions")
    cases = [shortened(case) for case in motions.cases(full=True) if chosen(case)]
    run_study("motions", cases, folder, lambda: ThreadPoolExecutor(1))
    return read_study(folder)


@pytest.fixture(scope="module")
def figures(results: Results) -> dict[str, Figure]:
    with mpl.rc_context(RC):
        return {figure.name: figure for section in gallery.sections(results) for figure in section.figures}


@pytest.fixture(scope="module")
def cards(results: Results) -> list[Card]:
    return scene_cards(results)


def kept(results: Results, view: str, scene: str, engine: str) -> dict[str, np.ndarray]:
    """Return a run's curves as its file has them, read without the reports' code."""
    rows = [json.loads(line) for line in (results.folder / "rows.jsonl").read_text().splitlines()]
    (case,) = [r["case"] for r in rows if (r["view"], r["scene"], r["engine"]) == (view, scene, engine)]
    with np.load(results.folder / "curves" / f"{case}.npz") as file:
        return dict(file)


def lines(drawing: Drawing, panel: int) -> list[np.ndarray]:
    """Return the points of a panel's lines, each (n, 2), in the order drawn."""
    return [np.asarray(line.get_xydata()) for line in drawing.axes[panel].lines]


def test_contact_force_of_each_engine_is_drawn_with_its_peak_on_that_of_the_truth(
    results: Results, figures: dict[str, Figure]
) -> None:
    drawing = figures[f"motions-contact-force-{CLEARANCE}-B"].drawing
    for panel, engine in enumerate(("reference", "pymunk")):
        curves = kept(results, "revolution", CLEARANCE, engine)
        true, run = lines(drawing, panel)
        assert run[:, 1].max() == curves["contact_B_normal_force_N"].max() / 1e3
        assert true[:, 1].max() == curves["true_contact_B_normal_force_N"].max() / 1e3
        turned = np.degrees(curves["crank_angle_rad"][-1] - curves["crank_angle_rad"][0])
        assert run[-1, 0] == pytest.approx(turned)


def test_the_line_of_the_truth_is_the_closed_form(figures: dict[str, Figure]) -> None:
    true, reference, _ = lines(figures["motions-slider-position-ideal"].drawing, 0)
    theta = np.radians(true[:, 0])
    x = 50 * np.cos(theta) + np.sqrt(120**2 - (50 * np.sin(theta)) ** 2)
    # Angle and place are in single precision: 6e-8 of 2 pi rad, at up to 60 mm/rad, and of 170 mm.
    assert np.abs(true[:, 1] - x).max() < 4e-5
    assert np.abs(reference[:, 1] - x).max() < 4e-5


def test_the_error_panel_shows_the_largest_error_of_the_row(
    results: Results, figures: dict[str, Figure]
) -> None:
    rows = results.rows[results.rows["scene"] == DRIVEN].set_index("engine")
    _, pymunk = lines(figures["motions-slider-velocity-error-ideal"].drawing, 0)
    row = rows.loc["pymunk"]
    assert np.nanmax(pymunk[:, 1]) == pytest.approx(row["slider_velocity_error_m_s"], rel=1e-6)


def test_the_loop_of_an_impact_has_the_area_of_the_energy_lost(
    results: Results, figures: dict[str, Figure]
) -> None:
    rows = results.rows[(results.rows["view"] == "impact") & (results.rows["engine"] == "reference")]
    true, reference, _ = lines(figures["motions-impact"].drawing, 1)
    # In kN and µm: mJ. A loop of 104 samples is an inscribed polygon: within a hundredth of its area.
    for loop in (true, reference):
        lost_J = np.trapezoid(loop[:, 1], loop[:, 0]) / 1e3
        assert lost_J == pytest.approx(rows["dissipated_energy_J"].iloc[0], rel=0.02)


def test_the_orbit_is_the_pins_way_in_its_circle(results: Results, figures: dict[str, Figure]) -> None:
    drawing = figures[f"motions-orbit-{CLEARANCE}-B"].drawing
    _, way = lines(drawing, 0)
    deepest = kept(results, "revolution", CLEARANCE, "reference")["contact_B_penetration_m"].max()
    assert np.hypot(*way.T).max() <= (5e-4 + deepest) * 1e6 * (1 + 1e-6)
    assert np.hypot(*way.T).max() > 500  # it has touched
    circle = drawing.axes[0].patches[0]
    assert circle.get_extents().width > 0
    assert circle.radius == pytest.approx(500, rel=1e-5)  # type: ignore[attr-defined]


def test_the_stack_of_energies_ends_on_what_was_there_and_came_in(figures: dict[str, Figure]) -> None:
    ax = figures["motions-energy"].drawing.axes[0]
    top = max(np.asarray(area.get_paths()[0].vertices)[:, 1].max() for area in ax.collections)
    given = np.asarray(ax.lines[0].get_ydata(), dtype=float).max()
    assert top == pytest.approx(given, rel=1e-4)  # the reference's own balance is far below a line's width


def test_no_panel_is_empty_and_every_axis_has_its_unit(figures: dict[str, Figure]) -> None:
    assert len(figures) >= 10
    for name, figure in figures.items():
        for ax in figure.drawing.axes:
            assert ax.has_data() or ax.patches or not ax.axison, name
        texts = [text.get_text() for text in figure.drawing.findobj(Text) if isinstance(text, Text)]
        assert name == "motions-mechanism" or any("[" in text for text in texts), name
        assert figure.reading.endswith(".")
        assert figure.alt.endswith(".")


def test_a_line_has_the_colour_of_its_engine(figures: dict[str, Figure]) -> None:
    ax = figures["motions-impact"].drawing.axes[0]
    assert [line.get_color() for line in ax.lines[1:]] == [ENGINES["reference"][0], ENGINES["pymunk"][0]]


def test_a_card_has_the_numbers_of_its_scene(cards: list[Card], results: Results) -> None:
    assert [card.name for card in cards] == ["ideal-free", CLEARANCE, "clearance-pendulum"]
    facts = dict(cards[1].facts)
    assert facts["lengths"] == "50, 120 mm"
    assert facts["masses"] == "0.3, 0.21, 0.14 kg"
    assert facts["clearance B"] == "0.5 mm, lankarani-nikravesh, restitution 0.9"
    assert facts["drive"] == "constant 523.6 rad/s"
    curves = kept(results, "whole", CLEARANCE, "exudyn")
    shown = float(facts["largest force"].split()[0])
    thinned = max(
        np.hypot(curves[f"joint_{j}_force_x_N"], curves[f"joint_{j}_force_y_N"]).max() for j in "OAB"
    )
    assert shown >= 0.95 * thinned  # two digits of the largest of all samples, of which a part is kept
    assert "clearance B" not in dict(cards[0].facts)
    assert len(cards[0].figure.drawing.axes) == len(cards[1].figure.drawing.axes) - 1


def test_a_card_says_all_of_its_facts(cards: list[Card]) -> None:
    for card in cards:
        figure = card.as_figure()
        assert figure.title == card.name
        assert all(f"{name}: {value}" in figure.reading for name, value in card.facts)


def test_the_film_has_every_engine_and_ends_where_its_run_does(results: Results) -> None:
    html = film_html(results)
    assert len(html.encode()) < FILM_BYTES
    assert "http" not in html
    match = re.search(r"const film = (\{.*\});", html)
    assert match
    film = json.loads(match[1])
    assert [view["label"] for view in film["views"]] == [
        "truth",
        "reference (located)",
        "pymunk (shorter in contact)",
    ]
    for view, engine in zip(film["views"][1:], ("reference", "pymunk"), strict=True):
        assert len(view["pictures"]) == PICTURES
        end = kept(results, "revolution", CLEARANCE, engine)["slider_position_m"][-1]
        assert view["pictures"][-1][4] == pytest.approx(1e3 * end, abs=0.005)  # mm, to two digits


def test_the_equations_are_ten_pieces_of_well_formed_mathml() -> None:
    root = ElementTree.fromstring(equations_html())
    numbers = [row.findall("td")[1].text for row in root.iter("tr")]
    assert numbers == [f"({k})" for k in range(1, 11)]
    maths = [list(row.iter("math")) for row in root.iter("tr")]
    assert all(len(found) == 1 and "=" in "".join(found[0].itertext()) for found in maths)


def test_a_view_that_was_not_run_leaves_no_hole(results: Results) -> None:
    cards = {card.figure.name for card in scene_cards(results)}
    made_of = {"law": {"motions-laws"}, "whole": {"motions-mechanism", *cards}}
    for view, figures in made_of.items():
        less = replace(results, rows=results.rows[results.rows["view"] == view])
        assert {figure.name for section in gallery.sections(less) for figure in section.figures} == figures
        assert not film_html(less)
        assert bool(scene_cards(less)) == (view == "whole")


def test_no_gallery_file_leaves_this_machine() -> None:
    for template in (Path(gallery.__file__).parent).glob("*.jinja"):
        assert "http" not in template.read_text("utf-8"), template.name

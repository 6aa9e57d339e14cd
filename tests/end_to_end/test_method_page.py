"""The chapter on the method: the mechanism, the contact laws, the equations, and what is cited."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

import reports
from reports.chapters.method import CHAPTER
from reports.page.figures import draw
from reports.parts import Studies
from reports.results import FloatArray
from tests.end_to_end.written_motions import LOOSE, motions

PAGE = Path(reports.__file__).parent / "page"
#: The method's text is no longer than this, in words.
MOST_WORDS = 450


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    return {"motions": motions(tmp_path_factory.mktemp("results") / "motions")}


def drawing_of(studies: Studies, name: str) -> Drawing:
    return next(each.views[0].drawing for each in CHAPTER.figures(studies) if each and each.name == name)


def points(line: Line2D) -> FloatArray:
    return np.asarray(line.get_xydata())


def test_the_mechanism_is_drawn_in_proportion_with_the_numbers_of_its_scene(studies: Studies) -> None:
    mechanism, _, text = drawing_of(studies, "motions-mechanism").axes
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
        "$F_n$ = 0 where $\\delta$ < 0: the pin is in flight",
        "contact law lankarani-nikravesh",
        "restitution 0.9",
        "modulus 207 GPa, Poisson 0.3",
    ]
    figure = next(each for each in CHAPTER.figures(studies) if each)
    assert figure.reading.endswith(f"Numbers are those of {LOOSE}.")


def test_the_page_shows_the_numbers_of_a_drawing_with_all_their_digits(studies: Studies) -> None:
    figure = next(each for each in CHAPTER.figures(studies) if each)
    (picture,) = draw(figure).views
    for number in ("0.21", "0.14", "0.0001", "0.00025"):
        assert re.search(rf"{number}\b", picture.svg.markup), number


def test_laws_stand_in_the_order_of_their_loss_loading_and_unloading(studies: Studies) -> None:
    drawing = drawing_of(studies, "motions-laws")
    assert [panel.get_title() for panel in drawing.axes] == ["hertz", "gonthier", "flores"]
    loading = np.array([[0, 0], [10, 2.0], [20, 4.0], [30, 6.0]])
    for panel, less, count in zip(drawing.axes, (1.0, 0.9, 0.8), (2, 4, 4), strict=True):
        assert (panel.get_xlabel(), panel.get_ylabel()) == ("penetration [µm]", "contact force [kN]")
        assert len(panel.lines) == count, "without loss behind each of the others"
        way_in, way_out = panel.lines[-2:]
        assert points(way_in) == pytest.approx(loading)
        assert points(way_out) == pytest.approx(np.array([[30, 6.0], [20, 4 * less], [10, 2 * less], [0, 0]]))
        assert points(panel.lines[0]) == pytest.approx(loading)


def test_without_its_runs_the_chapter_has_neither_figures_nor_tables() -> None:
    assert [*CHAPTER.figures({}), *CHAPTER.tables({}), *CHAPTER.findings({})] == []


def test_settings_and_what_did_not_finish_are_tables(studies: Studies) -> None:
    tables = {each.name: each for each in CHAPTER.tables(studies) if each}
    assert ("pymunk", "tuned", "iterations = 30") in tables["motions-settings"].rows
    (failed,) = tables["motions-failures"].rows
    assert failed[-1] == "not finite at t = 0.003 s"


def test_the_equations_are_well_formed_mathml_with_the_papers_numbers() -> None:
    rows = [*ElementTree.fromstring((PAGE / "equations.html").read_text("utf-8")).iter("tr")]
    numbers = [row.findall("td")[1].text for row in rows]
    assert numbers == [f"({k})" for k in range(1, 14)] + ["(a)", "(b)", "(c)"]
    for row in rows:
        (math,) = row.iter("math")
        assert "=" in "".join(math.itertext())
        assert row.findall("td")[2].text


def test_every_work_that_is_cited_is_in_the_bibliography_and_no_other() -> None:
    texts = [(PAGE / name).read_text("utf-8") for name in ("method.html.jinja", "glossary.json")]
    cited = {name for text in texts for name in re.findall(r"\[@(\w+)\]", text)}
    works = [work["id"] for work in json.loads((PAGE / "bibliography.json").read_text("utf-8"))]
    assert sorted(cited) == sorted(works)


def test_the_method_is_told_in_few_words() -> None:
    text = re.sub(r"<[^>]+>|\[@\w+\]", " ", (PAGE / "method.html.jinja").read_text("utf-8"))
    assert len(text.split()) <= MOST_WORDS


def test_nothing_of_the_method_leaves_this_machine() -> None:
    for template in ("equations.html", "method.html.jinja"):
        assert "http" not in (PAGE / template).read_text("utf-8")

"""The chapter on the method: the mechanism, the contact laws, and the names of configurations."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

import reports
from engine_models import arms as catalogue
from engine_models.arms import MEANINGS, Arm
from reports.chapters.method import CHAPTER
from reports.parts import Studies
from reports.results import FloatArray
from studies.case import load_study
from studies.registry import STUDIES
from tests.end_to_end.written_motions import LOOSE, motions

PAGE = Path(reports.__file__).parent / "page"
#: The method's text is no longer than this, in words.
MOST_WORDS = 450


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    return {"motions": motions(tmp_path_factory.mktemp("results") / "motions")}


def drawing_of(studies: Studies, name: str) -> Drawing:
    return next(each.drawing for each in CHAPTER.figures(studies) if each and each.name == name)


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


def test_configurations_and_what_did_not_finish_are_tables(studies: Studies) -> None:
    tables = {each.name: each for each in CHAPTER.tables(studies) if each}
    shown = tables["configurations"]
    assert (shown.head, shown.shown) == (("configuration", "what it is", "settings"), True)
    assert ("pymunk (tuned)", MEANINGS["pymunk (tuned)"], "iterations = 30") in shown.rows
    (failed,) = tables["motions-failures"].rows
    assert failed[-1] == "not finite at t = 0.003 s"


def test_every_configuration_of_a_study_says_what_it_is_and_no_other_does() -> None:
    arms = [case.arm for study in STUDIES for case in load_study(study).cases(full=True)]
    named = {arm.label for arm in vars(catalogue).values() if isinstance(arm, Arm)}
    assert {arm.label for arm in arms} & named <= set(MEANINGS) == named


def test_the_method_is_told_in_few_words_and_nothing_of_it_leaves_this_machine() -> None:
    text = (PAGE / "method.html").read_text("utf-8")
    assert len(re.sub(r"<[^>]+>", " ", text).split()) <= MOST_WORDS
    assert "http" not in text
    named = re.findall(r"<code>(docs/[\w/-]+\.md)</code>", text)
    assert len(named) == 4
    assert [name for name in named if not (PAGE.parents[1] / name).is_file()] == []

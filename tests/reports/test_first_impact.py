"""The figure of one impact from real runs: its loop is the energy lost, its errors are those of the rows."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from reports.chapters.accuracy_clearance import CHAPTER
from reports.results import Results, read_study
from reports.style import ENGINES
from studies import motions
from tests.helpers.running import run_in

DRAWN = ("reference", "pymunk")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    folder = tmp_path_factory.mktemp("motions")
    cases = [case for case in motions.cases(full=False) if case.columns["view"] == "impact"]
    cases = [case for case in cases if case.engine in DRAWN]
    run_in(folder, cases)
    return read_study(folder, "motions")


@pytest.fixture(scope="module")
def panels(results: Results) -> list[Axes]:
    (figure,) = filter(None, CHAPTER.figures({"motions": results}))
    return figure.drawing.axes


def test_the_loop_of_an_impact_has_the_area_of_the_energy_lost(results: Results, panels: list[Axes]) -> None:
    rows = results.rows.set_index("engine")
    exact, reference, _ = (np.asarray(line.get_xydata()) for line in panels[1].lines)
    # In kN and µm: mJ. A loop of 104 samples is an inscribed polygon: within a hundredth of its area.
    for loop in (exact, reference):
        lost_J = np.trapezoid(loop[:, 1], loop[:, 0]) / 1e3
        assert lost_J == pytest.approx(rows.loc["reference", "dissipated_energy_J"], rel=0.02)


def test_the_largest_error_drawn_is_that_of_the_row(results: Results, panels: list[Axes]) -> None:
    column = "contact_B_normal_force_error_N"
    drawn = [np.nanmax(np.asarray(line.get_ydata(), dtype=float)) for line in panels[2].lines]
    expected = results.rows.set_index("engine").loc[list(DRAWN), column]
    # A row counts the samples between those of the curves too, where an error is at most a part in 1000 more.
    assert drawn == pytest.approx(list(expected), rel=1e-3)


def test_a_line_has_the_colour_of_its_engine(panels: list[Axes]) -> None:
    for panel in panels:
        colours = [line.get_color() for line in panel.lines]
        assert colours[-2:] == [ENGINES[engine][0] for engine in DRAWN]

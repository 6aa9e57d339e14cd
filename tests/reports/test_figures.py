"""Figures can be read: labels lie on nothing else."""

import itertools
import re

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Drawing

from reports.page.figures import as_svg
from reports.plots.axes import set_plainly
from reports.plots.panels import draw_legend, grid
from reports.style import RC, line_styles

#: Ends of logarithmic axes, by powers of ten and decades: such as have overlapped, some by lot, and extremes.
LOT = np.random.default_rng(7).uniform((-9.0, 0.05), (6.0, 4.0), (48, 2)).tolist()
ENDS = [(-1.3, 1.15), (-6.8, 1.2), (-2.5, 0.49), (-4.99, 1.98), (-3.4, 0.02), (-17.0, 15.0), *LOT]
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
LABEL = re.compile(r"(?:([\d.]+)×)?10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")


def number(label: str) -> float:
    """Return the number that a label tells: 2×10⁻³ is 0.002."""
    told = LABEL.fullmatch(label)
    assert told, label
    return float(told[1] or 1) * 10.0 ** int(told[2].translate(RAISED))


def shown(axis: Axis, across: bool) -> list[tuple[float, float]]:
    """Return of the labels of an axis, in their order, where they begin and end along it."""
    low, high = axis.get_view_interval()
    found = []
    for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
        if low <= tick.get_loc() <= high and (text := tick.label1.get_text()):
            assert number(text) == pytest.approx(tick.get_loc(), rel=1e-5)
            box = tick.label1.get_window_extent()
            found.append((box.x0, box.x1) if across else (box.y0, box.y1))
    return sorted(found)


@pytest.mark.parametrize("first", range(0, len(ENDS), 6))
def test_labels_of_a_logarithmic_axis_tell_two_numbers_or_more_and_do_not_overlap(first: int) -> None:
    ends = [(10**power, 10 ** (power + decades)) for power, decades in ENDS[first : first + 6]]
    with mpl.rc_context(RC):
        drawing, axes = grid(len(ends))
        for ax, (low, high) in zip(axes, ends, strict=True):
            ax.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high), xlabel="x", ylabel="y")
        set_plainly(drawing)
        drawing.draw_without_rendering()
    for ax in axes:
        for labels in (shown(ax.xaxis, across=True), shown(ax.yaxis, across=False)):
            assert len(labels) >= 2
            assert all(end < begin for (_, end), (begin, _) in itertools.pairwise(labels)), ax.get_xlim()


def test_labels_that_somebody_has_set_stay() -> None:
    drawing = Drawing()
    ax = drawing.add_subplot()
    ax.set(xscale="log", xlim=(2, 100))
    ax.set_xticks([2, 5, 100], ["two", "five", "hundred"])
    set_plainly(drawing)
    assert [label.get_text() for label in ax.get_xticklabels()] == ["two", "five", "hundred"]


def test_long_titles_lie_neither_on_each_other_nor_beyond_the_edge() -> None:
    long = "clearance-driven-0.5mm-300-turns-and-more"
    with mpl.rc_context(RC):
        drawing, axes = grid(3)
        for ax, title in zip(axes, (long, "short", long), strict=True):
            ax.set(title=title, ylabel="energy gained or lost\nso far [J]")
        size = axes[1].title.get_fontsize()
        as_svg(drawing)
    boxes = [ax.title.get_window_extent() for ax in axes]
    assert boxes[0].x1 < boxes[1].x0 < boxes[1].x1 < boxes[2].x0
    assert all(box.x0 >= 0 and box.x1 <= drawing.bbox.width for box in boxes)
    assert axes[1].title.get_fontsize() == size


#: Arms of engines as they stand in legends together: many engines, many arms.
IDEAL = {
    "reference": ("projection", "none"),
    "exudyn": ("trapezoidal", "generalized-alpha"),
    "pymunk": ("tuned", "out of the box"),
    "scipy": ("ode(dop853)", "odeint", "solve_ivp, DOP853", "solve_ivp, Radau"),
}
LOOSE = {
    "reference": ("DOP853", "located", "located, none", "plain"),
    "exudyn": ("trapezoidal", "DOPRI5"),
    "pymunk": ("as the scene", "native contact", "shorter in contact"),
    "scipy": ("solve_ivp, DOP853", "solve_ivp, LSODA"),
}
MANY = {**IDEAL, "pymunk": tuple(f"{k} iterations" for k in range(12))}


@pytest.mark.parametrize("arms", [IDEAL, LOOSE, MANY], ids=["ideal", "loose", "many"])
def test_a_legend_of_engines_is_no_wider_than_its_figure_and_leaves_the_panels_their_height(
    arms: dict[str, tuple[str, ...]],
) -> None:
    labels = [(engine, arm, f"{engine} ({arm})") for engine, of in arms.items() for arm in of]
    with mpl.rc_context(RC):
        drawing, axes = grid(2)
        draw_legend(drawing, line_styles(pd.DataFrame(labels, columns=["engine", "arm", "label"])))
        drawing.draw_without_rendering()
    (legend,) = drawing.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= drawing.bbox.width
    assert axes[0].get_window_extent().height > 1.5 * drawing.dpi

"""Figures can be read: labels lie on nothing else, and what a page has of a figure is small and whole."""

import itertools
import re
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Drawing

from reports.page.figures import draw
from reports.page.svg import classes_of
from reports.page.svg.paths import TOLERANCE, compact, thinned
from reports.parts import Figure
from reports.plots.axes import set_plainly
from reports.plots.series import mark
from reports.plots.step_figures import engine_legend, grid
from reports.style import RC

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
        draw(Figure("name", "Title", "Reading.", "Alternative.", drawing, dense=True))
    boxes = [ax.title.get_window_extent() for ax in axes]
    assert boxes[0].x1 < boxes[1].x0 < boxes[1].x1 < boxes[2].x0
    assert all(box.x0 >= 0 and box.x1 <= drawing.bbox.width for box in boxes)
    assert axes[1].title.get_fontsize() == size


#: Arms of engines as they stand in legends together: many engines, many arms.
IDEAL = {
    "reference": ("projection", "none"),
    "exudyn": ("trapezoidal", "generalized-alpha"),
    "pymunk": ("tuned", "out of the box"),
    "scipy": ("DOP853", "DOP853 minimal", "Radau", "odeint", "odeint minimal"),
}
LOOSE = {
    "reference": ("DOP853", "located", "located, none", "plain"),
    "exudyn": ("trapezoidal", "DOPRI5"),
    "pymunk": ("as the scene", "native contact", "shorter in contact"),
    "scipy": ("DOP853", "DOP853 minimal", "LSODA", "LSODA minimal"),
    "heyoka": ("Taylor",),
}
MANY = {**IDEAL, "pymunk": tuple(f"{k} iterations" for k in range(12))}


@pytest.mark.parametrize("arms", [IDEAL, LOOSE, MANY], ids=["ideal", "loose", "many"])
def test_a_legend_of_engines_is_no_wider_than_its_figure_and_leaves_the_panels_their_height(
    arms: dict[str, tuple[str, ...]],
) -> None:
    labels = [(engine, arm, f"{engine} ({arm})") for engine, of in arms.items() for arm in of]
    with mpl.rc_context(RC):
        drawing, axes = grid(2)
        engine_legend(drawing, pd.DataFrame(labels, columns=["engine", "arm", "label"]), failures=False)
        drawing.draw_without_rendering()
    (legend,) = drawing.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= drawing.bbox.width
    assert axes[0].get_window_extent().height > 1.5 * drawing.dpi


# The SVG in the page


def points_of(data: str) -> np.ndarray:
    """Return the points (n, 2) of one line of path data."""
    points: list[tuple[float, float]] = []
    for letter, text in re.findall(r"([Mlhv])([^a-zA-Z]*)", data):
        numbers = [float(number) for number in re.findall(r"-?(?:\d+\.?\d*|\.\d+)", text)]
        steps = {"h": [(v, 0.0) for v in numbers], "v": [(0.0, v) for v in numbers]}
        for across, up in steps.get(letter, zip(numbers[::2], numbers[1::2], strict=True)):
            x, y = points[-1] if points else (0.0, 0.0)
            points.append((x + across, y + up))
    return np.array(points)


def off_line(points: np.ndarray, line: np.ndarray) -> float:
    """Return how far at most points lie from a line."""
    start, along = line[:-1], np.diff(line, axis=0)
    share = np.einsum("pki,ki->pk", points[:, None] - start, along) / np.maximum((along**2).sum(1), 1e-12)
    foot = start + np.clip(share, 0.0, 1.0)[..., None] * along
    return float(np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1).max())


def curve(kind: str) -> np.ndarray:
    """Return points of a curve on a figure: smooth, of noise, in steps, or one that comes back."""
    t = np.linspace(0.0, 1.0, 800)
    up = {
        "smooth": 60 * np.sin(9 * t),
        "noise": np.random.default_rng(1).normal(0.0, 8.0, 800),
        "steps": 20 * np.floor(7 * t),
    }
    turn = 40 * t * np.exp(20j * t)
    return np.column_stack([130 * t, up[kind]] if kind in up else [turn.real, turn.imag])


@pytest.mark.parametrize("kind", ["smooth", "noise", "steps", "spiral"])
def test_a_thinned_curve_lies_where_the_whole_one_did(kind: str) -> None:
    whole = curve(kind)
    some = thinned(whole, TOLERANCE)
    assert off_line(whole, some) <= TOLERANCE
    assert {*map(tuple, some)} <= {*map(tuple, whole)}
    assert len(some) < len(whole) * (0.95 if kind == "noise" else 0.2)


@pytest.mark.parametrize("kind", ["smooth", "noise", "steps", "spiral"])
def test_path_data_in_short_draw_what_they_drew_at_length(kind: str) -> None:
    whole = 100 + curve(kind)
    long = "M" + "L".join(f" {x:.2f} {y:.2f} " for x, y in whole)
    short = compact(long)
    assert len(short) < len(long) * (0.75 if kind == "noise" else 0.2)
    assert off_line(whole, points_of(short)) <= 0.2
    assert len(points_of(compact("M 0 0 L 0 3.5 L 0.02 3.6 "))) == 3, "a marker is drawn more finely"


def test_every_marker_of_a_line_is_in_the_page_in_its_colour() -> None:
    with mpl.rc_context(RC):
        drawing, (ax,) = grid(1)
        for count, colour in ((40, "#d55e00"), (1, "#123456")):
            x = np.arange(1.0, 1.0 + count)
            mark(ax.plot(x, np.cos(x), "o", color=colour), colour)
        picture = draw(Figure("name", "Title", "Reading.", "Alternative.", drawing)).svg
    root = ElementTree.fromstring(picture.placed("f0-", classes_of([picture])))
    styles = {name: style for style, name in classes_of([picture]).items()}
    markers = {each.attrib["id"]: styles[each[0].attrib["class"]] for each in root.iter("marker")}
    drawn = []
    for place in range(2):
        group = next(each for each in root.iter() if each.get("id") == f"f0-series-{place}")
        (path,) = (each for each in group.iter("path") if each.get("style", "").startswith("marker"))
        kind, name = path.attrib["style"].removesuffix(")").split(":url(#")
        drawn.append((kind, len(points_of(path.attrib["d"])), markers[name]))
    (whole, many, first), (single, one, second) = drawn
    assert (whole, many) == ("marker", 40)
    assert (single, one) == ("marker-start", 2), "a path that goes nowhere, with a marker at its start alone"
    assert "fill: var(--vermillion)" in first
    assert "fill: #123456" in second


def test_what_a_figure_in_the_page_names_is_in_it() -> None:
    with mpl.rc_context(RC):
        drawing, axes = grid(2)
        for ax in axes:
            ax.plot([1, 2, 3], [1, 4, 9], "s--")
            ax.fill_between([1, 2, 3], [1, 2, 3], hatch="//")
        picture = draw(Figure("name", "Title", "Reading.", "Alternative.", drawing)).svg
    page = picture.placed("f7-", classes_of([picture]))
    names = re.findall(r' id="([^"]*)"', page)
    assert len(names) == len(set(names))
    assert {name for name in names if "series-" not in name} == set(re.findall(r"#(f7-[^\")]*)", page))
    assert set(re.findall(r' class="([^"]*)"', page)) == set(classes_of([picture]).values())
    assert "pattern" in page

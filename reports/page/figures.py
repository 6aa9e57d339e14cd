"""Writes a figure: an SVG, and a CSV of the points of its lines."""

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from reports.parts import Figure
from reports.plots.axes import set_plainly
from reports.plots.series import Series, marked
from reports.style import RC

_COORDINATES = re.compile(r' (d|x|y|transform|points)="([^"]*)"')
_DIGITS = re.compile(r"(-?\d+\.\d\d)\d+")


def write_figure(figure: Figure, folder: Path) -> tuple[str, bool]:
    """Write a figure into figures/ of a folder, and the points of its lines into data/.

    Return in words which panels and series it shows, and whether it has points that are not in a table.
    """
    series = marked(figure.drawing)
    axes: list[Any] = list({id(each.artist.axes): each.artist.axes for each in series}.values())
    panels = ", ".join(ax.get_title() for ax in axes if ax and ax.get_title())
    labels = ", ".join(dict.fromkeys(each.label for each in series if each.label))
    words = (figure.title, panels and f"Panels: {panels}.", labels and f"Series: {labels}.")
    points = [] if figure.data else _points(series)
    if points:
        with (folder / f"data/{figure.name}.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["panel", "series", "x is", "y is", "x", "y", "setting"])
            table.writerows(points)
    (folder / f"figures/{figure.name}.svg").write_text(as_svg(figure.drawing), encoding="utf-8")
    return " ".join(filter(None, words)), bool(points)


def as_svg(drawing: Drawing) -> str:
    """Return a drawing as SVG without a date, to a hundredth of a point; text stays text."""
    for each in marked(drawing):
        each.artist.set_gid(None)  # it would be written as an id
    set_plainly(drawing)
    with mpl.rc_context({**RC, "svg.fonttype": "none"}):
        lay_out(drawing)
        # `Figure.savefig` draws all once more before, for a layout that is there.
        canvas: Any = FigureCanvasSVG(drawing)
        written = io.StringIO()
        canvas.print_svg(written, metadata={"Date": None})
    return _COORDINATES.sub(lambda found: _DIGITS.sub(r"\1", found[0]), written.getvalue())


def lay_out(drawing: Drawing) -> None:
    """Place the panels of a drawing once, and give a long title smaller letters."""
    if engine := drawing.get_layout_engine():
        engine.execute(drawing)
    drawing.set_layout_engine("none")
    wide = drawing.bbox.width
    for ax in drawing.axes:
        spec, title, box = ax.get_subplotspec(), ax.title, ax.title.get_window_extent()
        across, middle = spec.get_gridspec().ncols if spec else 1, (box.x0 + box.x1) / 2
        room = 0.98 * min(wide / across, 2 * middle, 2 * (wide - middle))
        if box.width > room:
            title.set_fontsize(title.get_fontsize() * room / box.width)


def _points(series: Sequence[Series]) -> list[list[str]]:
    """Return every point of every line with its panel, series, axes and note."""
    points = []
    for each in series:
        ax: Any = each.artist.axes
        texts = [ax.get_title(), each.label, ax.get_xlabel(), ax.get_ylabel()]
        if isinstance(each.artist, Line2D):
            for k, (x, y) in enumerate(np.asarray(each.artist.get_xydata(), dtype=float)):
                row = [*texts, f"{x:.6g}", f"{y:.6g}", *(each.notes[k : k + 1] or [""])]
                points.append([text.replace("\n", " ") for text in row])
    return points

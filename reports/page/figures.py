"""Draws a figure: an SVG of each view for the page, a CSV of its points, and files for papers."""

import csv
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from reports.page.formats import as_svg, write_pdf, write_png
from reports.page.svg import NAMED, Inline, inline
from reports.parts import Figure, View
from reports.plots.axes import set_plainly
from reports.plots.series import Series, marked
from reports.results import FloatArray
from reports.style import COLUMN_IN, RC, legend_entries

#: Text stays text, which is found, read aloud and quick to draw; in PDF it is embedded, as publishers ask.
TEXT: Any = {"svg.fonttype": "none", "pdf.fonttype": 42}
#: What a view is for papers, by the ends of its files' names.
FILES = (".svg", ".png", ".pdf")
#: The same for one column of a paper, and with how many panels it still is a figure there.
COLUMN, MOST_PANELS = "-column.pdf", 4
#: Of a curve no more points than these tell their values.
MOST_POINTS = 30


@dataclass(frozen=True)
class Picture:
    """A view in the page: its ``choice``, its ``svg``, and ``data`` of its points as JSON."""

    choice: tuple[str, ...]
    svg: Inline
    data: str


@dataclass(frozen=True)
class Drawn:
    """A figure as the page shows it: its views, whether its points are in a file, and its other files."""

    views: tuple[Picture, ...]
    has_data: bool = False
    files: tuple[str, ...] = ()


def draw(figure: Figure, folder: Path | None = None, paper: bool = False) -> Drawn:
    """Return a figure as the page shows it; write its points into a ``folder``, and files for a ``paper``.

    Each view is laid out once, and for papers once more for one column.
    """
    pictures, points, files = [], list[list[Any]](), list[str]()
    for place, view in enumerate(figure.views):
        series = marked(view.drawing)
        for k, each in enumerate(series):
            each.artist.set_gid(f"series-{k}")
        set_plainly(view.drawing)
        with mpl.rc_context({**RC, **TEXT}):
            lay_out(view.drawing)
            svg = as_svg(view.drawing)
            told = json.dumps(_values(view.drawing, series), separators=(",", ":")).replace("<", "\\u003c")
            points += [[*view.choice, *point] for point in _points_in_full(series)]
            if folder and paper:
                name = f"{figure.name}-{place}" if len(figure.views) > 1 else figure.name
                files += [
                    f"{name}{end}" for end in _write(name, view.drawing, svg, folder / "figures", figure)
                ]
        alt = describe(figure, view, series)
        pictures.append(Picture(view.choice, inline(svg, alt, recoloured=not figure.dense), told))
    has_data = bool(folder and points and not figure.data)
    if folder and has_data:
        _write_points(folder / "data" / f"{figure.name}.csv", figure, points)
    return Drawn(tuple(pictures), has_data, tuple(files))


def describe(figure: Figure, view: View, series: list[Series]) -> str:
    """Return in words what a view shows, for those who do not see it: panels, axes and series."""
    axes: list[Any] = list({id(each.artist.axes): each.artist.axes for each in series}.values())
    panels = ", ".join(ax.get_title() for ax in axes if ax and ax.get_title())
    labels = ", ".join(dict.fromkeys(each.label for each in series if each.label))
    parts = [
        ": ".join([figure.title, ", ".join(view.choice)]) if view.choice else figure.title,
        panels and f"Panels: {panels}.",
        labels and f"Series: {labels}.",
    ]
    return " ".join(filter(None, parts))


def _write(name: str, drawing: Drawing, svg: str, folder: Path, figure: Figure) -> tuple[str, ...]:
    """Write a view in every format and return the ends of the names of its files."""
    (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
    write_png(drawing, folder / f"{name}.png")
    write_pdf(drawing, folder / f"{name}.pdf")
    if figure.dense or len(drawing.axes) > MOST_PANELS:
        return FILES
    _reflow(drawing)
    write_pdf(drawing, folder / f"{name}{COLUMN}")
    return (*FILES, COLUMN)


def lay_out(drawing: Drawing) -> None:
    """Place the panels of a drawing once for all formats."""
    if engine := drawing.get_layout_engine():
        engine.execute(drawing)
    drawing.set_layout_engine("none")
    wide = drawing.bbox.width
    for ax in drawing.axes:  # a long title gets smaller letters
        spec, title, box = ax.get_subplotspec(), ax.title, ax.title.get_window_extent()
        across, middle = spec.get_gridspec().ncols if spec else 1, (box.x0 + box.x1) / 2
        room = 0.98 * min(wide / across, 2 * middle, 2 * (wide - middle))
        if box.width > room:
            title.set_fontsize(title.get_fontsize() * room / box.width)


def _reflow(drawing: Drawing) -> None:
    """Put the panels of a drawing below each other, as wide as a column, and the legend below them."""
    panels = [ax for ax in drawing.axes if ax.get_subplotspec()]
    wide, high = drawing.get_size_inches()
    rows = max((spec.rowspan.stop for ax in panels if (spec := ax.get_subplotspec())), default=1)
    grid = drawing.add_gridspec(len(panels) or 1, 1)
    for place, ax in enumerate(panels):
        ax.set_subplotspec(grid[place])
    drawing.set_size_inches(COLUMN_IN, min(wide, high / rows) * 0.9 * max(1, len(panels)))
    for legend in drawing.legends:
        handles = legend_entries(legend)
        legend.remove()
        drawing.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=6.5, handlelength=2.4)
    drawing.set_layout_engine("constrained")
    lay_out(drawing)


def _values(drawing: Drawing, series: list[Series]) -> dict[str, Any]:
    """Return the panels with their axes, and the points of every series where they lie on the SVG."""
    axes = [ax for ax in drawing.axes if any(each.artist.axes is ax for each in series)]
    place_of: dict[object, int] = {ax: place for place, ax in enumerate(axes)}
    lines = [
        [each.label, colour(each), place, place_of[each.artist.axes], _points(each, drawing)]
        for place, each in enumerate(series)
    ]
    texts = [[ax.get_title(), _flat(ax.get_xlabel()), _flat(ax.get_ylabel())] for ax in axes]
    return {"panels": texts, "lines": lines}


def colour(series: Series) -> str:
    """Return the colour of a line as the page has it, nothing of what is no line."""
    line = series.artist
    code = mpl.colors.to_hex(line.get_color()) if isinstance(line, Line2D) else ""
    return f"var(--{NAMED[code]})" if code in NAMED else code


def _points(series: Series, drawing: Drawing) -> list[list[Any]]:
    """Return a line's points: place on the SVG, value across and up, and the note if there is one."""
    line, data = series.artist, _data(series)
    high = drawing.get_figheight() * 72
    with np.errstate(all="ignore"):  # what is not positive has no place on a logarithmic axis
        places = line.get_transform().transform(data) / drawing.dpi * 72
    there = np.flatnonzero(np.isfinite(places).all(axis=1) & np.isfinite(data).all(axis=1))
    return [
        [
            round(places[k, 0], 1),
            round(high - places[k, 1], 1),
            *(float(f"{v:.3g}") for v in data[k]),
            *series.notes[k : k + 1],
        ]
        for k in there[:: -(-len(there) // MOST_POINTS) or 1]
    ]


def _data(series: Series) -> FloatArray:
    """Return the points of a series, (n, 2); none of what is no line."""
    line = series.artist
    return np.asarray(line.get_xydata() if isinstance(line, Line2D) else np.empty((0, 2)), dtype=float)


def _points_in_full(series: list[Series]) -> Iterator[list[Any]]:
    """Yield every point of every line with its panel, axes, series and note."""
    for each in series:
        ax: Any = each.artist.axes
        texts = [_flat(ax.get_title()), each.label, _flat(ax.get_xlabel()), _flat(ax.get_ylabel())]
        for k, (x, y) in enumerate(_data(each)):
            yield [*texts, f"{x:.6g}", f"{y:.6g}", *(each.notes[k : k + 1] or [""])]


def _write_points(path: Path, figure: Figure, points: list[list[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow([*figure.pickers, "panel", "series", "x is", "y is", "x", "y", "setting"])
        table.writerows(points)


def _flat(text: str) -> str:
    return text.replace("\n", " ")

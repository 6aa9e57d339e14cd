"""Draws a figure: an SVG with the values on it for the page, and files for papers, SVG, PNG and PDF."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

from reports.page.formats import as_svg, write_pdf, write_png
from reports.page.svg import NAMED, Inline, inline
from reports.parts import Figure
from reports.plots.axes import set_plainly
from reports.plots.series import Series, marked
from reports.style import COLUMN_IN, RC, legend_entries

#: Text stays text, which is found, read aloud and quick to draw; in PDF it is embedded, as publishers ask.
TEXT: Any = {"svg.fonttype": "none", "pdf.fonttype": 42}
#: What a figure is for papers, by the ends of its files' names.
FILES = (".svg", ".png", ".pdf")
#: The same figure for one column of a paper, and with how many panels it still is a figure there.
COLUMN, MOST_PANELS = "-column.pdf", 4
#: Of a curve no more points than these tell their values.
MOST_POINTS = 30


@dataclass(frozen=True)
class Picture:
    """A figure in the page: ``svg``, ``data`` of its points as JSON, and the ends of its files' names."""

    svg: Inline
    data: str
    files: tuple[str, ...]


def draw(figure: Figure, folder: Path | None = None) -> Picture:
    """Return a figure as it stands in the page, and into a ``folder`` write its files for papers.

    It is laid out once, and for papers once more for one column.
    """
    drawing, series = figure.drawing, marked(figure.drawing)
    for place, each in enumerate(series):
        each.artist.set_gid(f"series-{place}")
    set_plainly(drawing)
    with mpl.rc_context({**RC, **TEXT}):
        _lay_out(drawing)
        svg = as_svg(drawing)
        values = json.dumps(_values(drawing, series), separators=(",", ":")).replace("<", "\\u003c")
        files = () if folder is None else _write(figure, svg, folder)
    return Picture(inline(svg, f"alt-{figure.name}", recoloured=not figure.dense), values, files)


def _write(figure: Figure, svg: str, folder: Path) -> tuple[str, ...]:
    """Write a figure in every format and return the ends of the names of its files."""
    drawing = figure.drawing
    (folder / f"{figure.name}.svg").write_text(svg, encoding="utf-8")
    write_png(drawing, folder / f"{figure.name}.png")
    write_pdf(drawing, folder / f"{figure.name}.pdf")
    if figure.dense or len(drawing.axes) > MOST_PANELS:
        return FILES
    _reflow(drawing)
    write_pdf(drawing, folder / f"{figure.name}{COLUMN}")
    return (*FILES, COLUMN)


def _lay_out(drawing: Drawing) -> None:
    """Place the panels once for all formats."""
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
    _lay_out(drawing)


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
    line = series.artist
    if not isinstance(line, Line2D):
        return []
    data = np.asarray(line.get_xydata(), dtype=float)
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


def _flat(text: str) -> str:
    return text.replace("\n", " ")

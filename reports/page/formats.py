"""Renders a drawing that is laid out as SVG, PNG and PDF, each small, and drawn once.

The canvases are asked themselves: `Figure.savefig` draws all once more before, for a layout that is there.
"""

import io
import re
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Drawing
from PIL import Image

#: A figure in pixels: so many to the inch, in so many colours that the edges of letters stay smooth.
DPI, COLOURS = 200, 128
_COORDINATES = re.compile(r' (d|x|y|transform|points)="([^"]*)"')


def as_svg(drawing: Drawing) -> str:
    """Return a drawing as SVG without date, to a hundredth of a point."""
    canvas: Any = FigureCanvasSVG(drawing)  # its methods have no types
    written = io.StringIO()
    canvas.print_svg(written, metadata={"Date": None})
    return _COORDINATES.sub(lambda m: f' {m[1]}="{_rounded(m[2])}"', written.getvalue())


def write_png(drawing: Drawing, path: Path) -> None:
    """Write a PNG with a palette: lines and letters of few colours are a third as large so."""
    drawing.set_dpi(DPI)
    canvas: Any = FigureCanvasAgg(drawing)
    canvas.draw()
    pixels = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba()).convert("RGB")
    pixels.quantize(COLOURS, dither=Image.Dither.NONE).save(path, dpi=(DPI, DPI), optimize=True)


def write_pdf(drawing: Drawing, path: Path) -> None:
    """Write a PDF without date, which would make equal figures differ."""
    canvas: Any = FigureCanvasPdf(drawing)
    canvas.print_pdf(path, metadata={"CreationDate": None})


def _rounded(numbers: str) -> str:
    return re.sub(r"(-?\d+\.\d\d)\d+", r"\1", numbers.replace("\n", " "))

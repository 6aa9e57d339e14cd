"""A figure that shows itself in a notebook and becomes the bytes of a file."""

import io

import matplotlib as mpl
from matplotlib.figure import Figure

from reports.look import RC, WIDTH_IN, set_plainly

#: Colours of the curves of one panel, Okabe and Ito's, and their dashes, which tell them apart in greyscale.
COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)), (0, (7, 3)))


class Picture(Figure):
    """A figure as wide as a page unless told otherwise, ``height_in`` high."""

    def __init__(self, height_in: float, width_in: float = WIDTH_IN) -> None:
        super().__init__(figsize=(width_in, height_in))

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        return picture_bytes(self, ".png")


def picture_bytes(figure: Figure, ending: str) -> bytes:
    """Return a figure as the bytes of a file whose name ends in .png, .svg or .pdf."""
    content = io.BytesIO()
    dates = {".png": None, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    set_plainly(figure)
    with mpl.rc_context(RC):
        figure.savefig(content, format=ending[1:], metadata=dates[ending])
    return content.getvalue()

"""A film of the mechanism with its joint forces as arrows: a page with controls, a GIF, or an MP4."""

import io
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter

from reports.run.mechanism import Mechanism
from reports.run.stage import Stage
from reports.style import RC

#: The most pictures of a film, how many of them pass in a second, and how fine they are.
MOST_PICTURES, PER_SECOND, DPI = 100, 20, 110
#: Nothing moves from picture to picture, and to lay them out would take longer than all else.
FIXED = {"figure.constrained_layout.use": False}


def can_write(ending: str) -> bool:
    """Return whether a film can be written to a file of this ending here: .mp4 takes ffmpeg."""
    return ending != ".mp4" or FFMpegWriter.isAvailable()


def film_bytes(
    frame: pd.DataFrame,
    mechanism: Mechanism,
    exaggeration: float,
    title: str,
    ending: str,
    drawn: Callable[[float], None],
) -> bytes:
    """Return the film of a run, from its table of samples, as the bytes of a .html, .gif or .mp4 file.

    ``drawn`` is told the time in s of every picture that is done.
    """
    chosen = np.linspace(0, len(frame) - 1, min(len(frame), MOST_PICTURES)).round().astype(int)
    with mpl.rc_context(RC | FIXED):
        stage = Stage(frame.iloc[chosen], mechanism, exaggeration, title)
        return _page(stage, title, drawn) if ending == ".html" else _movie(stage, ending, drawn)


def _page(stage: Stage, title: str, drawn: Callable[[float], None]) -> bytes:
    """Return a page that holds its pictures, and needs no other file."""
    pictures = []
    for k, time_s in enumerate(stage.times):
        stage.show(k)
        content = io.BytesIO()
        stage.picture.savefig(content, dpi=DPI)
        pictures.append(b64encode(content.getvalue()).decode("ascii"))
        drawn(time_s)
    templates = FileSystemLoader(Path(__file__).parent)
    environment = Environment(loader=templates, autoescape=True, undefined=StrictUndefined)
    page = environment.get_template("film.html.jinja")
    return page.render(title=title, pictures=pictures, interval_ms=1000 // PER_SECOND).encode("utf-8")


def _movie(stage: Stage, ending: str, drawn: Callable[[float], None]) -> bytes:
    """Return what Pillow makes of the pictures, or ffmpeg."""
    writer = {".gif": PillowWriter, ".mp4": FFMpegWriter}[ending](fps=PER_SECOND)
    animation = FuncAnimation(stage.picture, stage.show, frames=len(stage.times), blit=False)
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"film{ending}"
        animation.save(file, writer, dpi=DPI, progress_callback=lambda k, _: drawn(float(stage.times[k])))
        return file.read_bytes()

"""An animation of the mechanism with its joint forces as arrows: a page with controls, a GIF, or an MP4."""

import io
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.patches import Circle, Rectangle

from reports.plots.picture import COLOURS, Picture
from reports.results import FloatArray
from reports.style import GREY, RC, WIDTH_IN

#: The most pictures of a film, how many of them are shown in a second, and their resolution.
MOST_PICTURES, PER_SECOND, DPI = 100, 20, 110
#: Every picture has the same layout, and to compute it anew would take longer than all else.
FIXED = {"figure.constrained_layout.use": False}
#: Sizes in parts of the crank's length: of a pin, of the slider, and of the margin around the mechanism.
PIN, SLIDER, MARGIN = 0.07, (0.5, 0.34), 0.9
#: The part of all forces that is drawn in full, the length of the largest of those and of the longest arrow,
#: in parts of the crank's.
IN_LENGTH, ARROW, LONGEST_ARROW = 0.95, 0.6, 0.9
#: What is around the axes in the figure, in inches; their label and the legend are below them.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN = 0.6, 0.15, 1.0, 0.3
MM_PER_M = 1e3


@dataclass(frozen=True)
class Mechanism:
    """What is drawn: the lengths of the links, no rod in a pendulum, and the radial clearances of joints."""

    crank_m: float
    rod_m: float | None
    radial_clearance_m: Mapping[str, float]

    @property
    def joints(self) -> str:
        """Names of the joints, a letter each."""
        return "O" if self.rod_m is None else "OAB"


@dataclass(frozen=True)
class Places:
    """Centres of the joints' bearings and pins, and the end of a pendulum's crank, in m, each (n, 2)."""

    bearing: Mapping[str, FloatArray]
    pin: Mapping[str, FloatArray]
    crank_end: FloatArray


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

    ``drawn`` is called with the time in s of every picture that is done.
    """
    chosen = np.linspace(0, len(frame) - 1, min(len(frame), MOST_PICTURES)).round().astype(int)
    with mpl.rc_context(RC | FIXED):
        stage = Stage(frame.iloc[chosen], mechanism, exaggeration, title)
        return _page(stage, title, drawn) if ending == ".html" else _movie(stage, ending, drawn)


def _page(stage: "Stage", title: str, drawn: Callable[[float], None]) -> bytes:
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


def _movie(stage: "Stage", ending: str, drawn: Callable[[float], None]) -> bytes:
    """Return what Pillow makes of the pictures, or ffmpeg."""
    writer = {".gif": PillowWriter, ".mp4": FFMpegWriter}[ending](fps=PER_SECOND)
    animation = FuncAnimation(stage.picture, stage.show, frames=len(stage.times), blit=False)
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"film{ending}"
        animation.save(file, writer, dpi=DPI, progress_callback=lambda k, _: drawn(float(stage.times[k])))
        return file.read_bytes()


def places(frame: pd.DataFrame, mechanism: Mechanism, exaggeration: float) -> Places:
    """Return where everything is, with gaps ``exaggeration`` times as large.

    The crank keeps its angle and the slider its place. The rod goes from pin A to bearing B, and is longer or
    shorter by what that takes.
    """
    angle = frame["crank_angle_rad"].to_numpy()
    crank = mechanism.crank_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    gap = {joint: exaggeration * _gap(frame, joint) for joint in mechanism.joints}
    ground = np.zeros_like(crank)
    end = gap["O"] + crank
    if mechanism.rod_m is None:
        return Places({"O": ground}, {"O": gap["O"]}, end)
    slider = np.stack([frame["slider_position_m"], ground[:, 1]], axis=-1)
    bearing = {"O": ground, "A": end, "B": slider - gap["B"]}
    return Places(bearing, {"O": gap["O"], "A": end + gap["A"], "B": slider}, end)


def _gap(frame: pd.DataFrame, joint: str) -> FloatArray:
    """Return the gap of a joint, zero of one without clearance."""
    columns = [f"clearance_{joint}_{axis}_m" for axis in "xy"]
    return frame[columns].to_numpy() if columns[0] in frame else np.zeros((len(frame), 2))


class Stage:
    """A figure of the mechanism and its joint forces, whose parts ``show`` moves to a sample of a table."""

    def __init__(self, frame: pd.DataFrame, mechanism: Mechanism, exaggeration: float, title: str) -> None:
        self.times = frame.index.to_numpy()
        self.places = places(frame, mechanism, exaggeration)
        self.crank_mm = MM_PER_M * mechanism.crank_m
        self.forces, per_crank = _arrows(frame, mechanism.joints, self.crank_mm)
        points = MM_PER_M * np.concatenate(
            [*self.places.pin.values(), *self.places.bearing.values(), self.places.crank_end]
        )
        low, high = points.min(axis=0) - MARGIN * self.crank_mm, points.max(axis=0) + MARGIN * self.crank_mm
        width = WIDTH_IN - LEFT_IN - RIGHT_IN
        height = width * (high[1] - low[1]) / (high[0] - low[0])
        total = BELOW_IN + height + ABOVE_IN
        self.picture = Picture(total)
        self.axes = self.picture.add_axes(
            (LEFT_IN / WIDTH_IN, BELOW_IN / total, width / WIDTH_IN, height / total),
            xlim=(low[0], high[0]),
            ylim=(low[1], high[1]),
            xlabel="x [mm]",
            ylabel="y [mm]",
        )
        if mechanism.radial_clearance_m and exaggeration != 1:
            title += f", clearance drawn {exaggeration:g} times as large"
        self.axes.set_title(title, loc="left")
        self.clock = self.axes.set_title("", loc="right", family="monospace")
        self.moves = self._draw_bodies(mechanism, exaggeration)
        self.quivers = [
            self._draw_arrow(name, colour) for name, colour in zip(self.forces, COLOURS[1:], strict=False)
        ]
        scale = f"a crank's length is {float(f'{per_crank:.3g}'):g} N, cut at {LONGEST_ARROW:g} of it"
        self.picture.legend(
            handles=self.quivers, loc="lower center", ncols=len(self.quivers), title=f"forces: {scale}"
        )

    def show(self, k: int) -> Iterable[Artist]:
        """Move everything to sample ``k``."""
        self.clock.set_text(f"t = {self.times[k]:.6f} s")
        for move in self.moves:
            move(k)
        for (joint, arrows), quiver in zip(self.forces.values(), self.quivers, strict=True):
            quiver.set_offsets([MM_PER_M * self.places.pin[joint][k]])
            quiver.set_UVC(*arrows[k])
        return self.quivers

    def _draw_bodies(self, mechanism: Mechanism, exaggeration: float) -> list[Callable[[int], None]]:
        """Draw links, slider, pins and bearings; return what moves each to a sample."""
        at, size = self.places, PIN * self.crank_mm
        moves = [self._draw_link(at.pin["O"], at.crank_end)]
        if mechanism.rod_m is not None:
            moves += [self._draw_link(at.pin["A"], at.bearing["B"]), self._draw_slider(at.pin["B"])]
        for joint in mechanism.joints:
            moves.append(self._draw_disc(at.pin[joint], size, fill=True))
            if joint in mechanism.radial_clearance_m:
                gap = MM_PER_M * exaggeration * mechanism.radial_clearance_m[joint]
                moves.append(self._draw_disc(at.bearing[joint], size + gap, fill=False))
        return moves

    def _draw_link(self, begin: FloatArray, end: FloatArray) -> Callable[[int], None]:
        (line,) = self.axes.plot([], [], color="#555555", linewidth=5, alpha=0.55, solid_capstyle="round")
        ends = MM_PER_M * np.stack([begin, end], axis=-1)
        return lambda k: line.set_data(ends[k])

    def _draw_slider(self, centre: FloatArray) -> Callable[[int], None]:
        width, height = (part * self.crank_mm for part in SLIDER)
        for side in (-1, 1):
            self.axes.axhline(side * height / 2, color=GREY, linewidth=0.8)
        box = Rectangle((0, 0), width, height, facecolor="#D9D9D9", edgecolor="#555555")
        self.axes.add_patch(box)
        corner = MM_PER_M * centre - [width / 2, height / 2]
        return lambda k: box.set_xy(corner[k])

    def _draw_disc(self, centre: FloatArray, radius: float, fill: bool) -> Callable[[int], None]:
        face: dict[str, Any] = {"facecolor": "white"} if fill else {"fill": False}
        disc = Circle((0, 0), radius, edgecolor="black", linewidth=1.0, zorder=3, **face)
        self.axes.add_patch(disc)
        return lambda k: disc.set_center(MM_PER_M * centre[k])

    def _draw_arrow(self, name: str, colour: str) -> Any:
        in_mm: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "zorder": 4}
        return self.axes.quiver([0], [0], [0], [0], color=colour, label=name, **in_mm)


def _arrows(
    frame: pd.DataFrame, joints: str, crank_mm: float
) -> tuple[dict[str, tuple[str, FloatArray]], float]:
    """Return joint and arrows (n, 2) in mm of every force by its name, and the N of a crank's length."""
    forces: dict[str, tuple[str, FloatArray]] = {}
    for joint, body in zip(joints, ("crank", "rod", "slider"), strict=False):
        columns = [f"joint_{joint}_force_{axis}_N" for axis in "xy"]
        forces[f"joint {joint} on the {body}"] = joint, frame[columns].to_numpy()
    if "guide_normal_force_N" in frame:
        normal = frame["guide_normal_force_N"].to_numpy()
        forces["guide on the slider"] = "B", np.stack([np.zeros_like(normal), normal], axis=-1)
    sizes = {name: np.hypot(*force.T) for name, (_, force) in forces.items()}
    usual = float(np.quantile(np.concatenate(list(sizes.values())), IN_LENGTH)) or 1.0
    per_crank, longest = usual / ARROW, usual * LONGEST_ARROW / ARROW
    arrows = {
        name: (joint, crank_mm / per_crank * force * (longest / np.maximum(sizes[name], longest))[:, None])
        for name, (joint, force) in forces.items()
    }
    return arrows, per_crank

"""An animation of a mechanism with its joint forces as arrows: a page with controls, a GIF, or an MP4."""

import io
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl
import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from reports.look import GREY, RC, WIDTH_IN
from reports.plots.picture import COLOURS, Picture
from reports.results import FloatArray

#: The most pictures of a film, how many of them are shown in a second, and their resolution.
MOST_PICTURES, PER_SECOND, DPI = 100, 20, 110
#: Every picture has the same layout, and to compute it anew would take longer than all else.
FIXED = {"figure.constrained_layout.use": False}
#: Sizes in parts of a typical link's length: of a pin, of a block, and of the margin around all.
PIN, BLOCK, MARGIN = 0.07, (0.5, 0.34), 0.15
#: How far a guide goes on beyond the places of its block's centre, or its pin's.
BEYOND = {True: 0.45, False: 0.15}
#: The part of all forces that is drawn in full, the length of the largest of those and of the longest arrow.
IN_LENGTH, ARROW, LONGEST_ARROW = 0.95, 0.6, 0.9
#: The most forces that have a colour each, and the entries of a row of the legend.
MOST_COLOURS, IN_ROW = 6, 4
#: Forces that share a colour, by the first word of their names.
KINDS = {"joint": "joint forces, each on the body named later", "guide": "forces of guides on their bodies"}
#: What is around the axes in the figure, in inches, and a row of the legend; height of the axes to width.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN, ROW_IN = 0.7, 0.15, 0.8, 0.3, 0.2
FLATTEST, TALLEST = 0.3, 0.75
DARK, OF_LOADS, OF_DRIVE = "#555555", "#6A3D9A", "#8A5A00"
MM_PER_M = 1e3


@dataclass(frozen=True)
class Joint:
    """Centres of a joint's bearing and pin in m, (n, 2) each, and its radial clearance, as large as drawn."""

    bearing_m: FloatArray
    pin_m: FloatArray
    clearance_m: float = 0.0


@dataclass(frozen=True)
class Guide:
    """A guide's pin in m, (n, 2), the ends of its way, (n, 2, 2), the guide's direction in rad, (n,).

    A body that keeps its angle against the guide is a block on it, another one has its pin in a slot.
    """

    pin_m: FloatArray
    ends_m: FloatArray
    angle_rad: FloatArray
    has_block: bool


@dataclass(frozen=True)
class Mark:
    """Where a load or a drive acts in m, (n, 2), its direction in rad or None of a torque, its sign, (n,)."""

    place_m: FloatArray
    angle_rad: FloatArray | None
    sign: FloatArray


@dataclass(frozen=True)
class Force:
    """A force in N at a place in m, (n, 2) each."""

    place_m: FloatArray
    force_N: FloatArray


@dataclass(frozen=True)
class Drawing:
    """A mechanism at n times, as it is drawn: corners of bodies (n, corners, 2), ends of springs (n, 2, 2).

    Places are in m. ``link_m`` is the length of a typical link. ``feet`` has the clearances, as large as
    drawn, by places of the ground. Gaps are ``exaggeration`` times as large as they are.
    """

    time_s: FloatArray
    link_m: float
    bodies: Mapping[str, FloatArray]
    joints: Mapping[str, Joint]
    feet: Mapping[tuple[float, float], float]
    guides: Mapping[str, Guide]
    springs: Sequence[FloatArray]
    loads: Sequence[Mark]
    drive: Mark | None
    forces: Mapping[str, Force]
    exaggeration: float = 1.0


def can_write(ending: str) -> bool:
    """Return whether a film can be written to a file of this ending here: .mp4 takes ffmpeg."""
    return ending != ".mp4" or FFMpegWriter.isAvailable()


def pictured(samples: int) -> NDArray[np.intp]:
    """Return the numbers of the samples that a film shows."""
    return np.rint(np.linspace(0, samples - 1, min(samples, MOST_PICTURES))).astype(np.intp)


def film_bytes(drawing: Drawing, title: str, ending: str, drawn: Callable[[float], None]) -> bytes:
    """Return the film of a mechanism as the bytes of a .html, .gif or .mp4 file.

    ``drawn`` is called with the time in s of every picture that is done.
    """
    with mpl.rc_context(RC | FIXED):
        stage = Stage(drawing, title)
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


def _headed(line: FloatArray, size: float = 0.1) -> FloatArray:
    """Return a line (n, 2) with the head of an arrow at its end."""
    tip, along = line[-1], line[-1] - line[-2]
    back = -size * along / np.hypot(*along)
    side = 0.6 * np.array([-back[1], back[0]])
    return np.vstack([line, tip + back + side, tip, tip + back - side])


#: Lines in parts of a typical link's length, (n, 2): what marks a force, a torque, and a driven guide.
FORCE = _headed(np.array([(0.35, 0.0), (0.95, 0.0)]))
_ARC = np.linspace(-0.4, 4.2, 40)
TORQUE = _headed(0.28 * np.stack([np.cos(_ARC), np.sin(_ARC)], axis=-1))
BOTH_WAYS = _headed(_headed(np.array([(-0.5, 0.3), (0.5, 0.3)]))[::-1])
BOX = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * BLOCK / 2
#: A foot of the ground below a pin, and a spring from (0, 0) to (1, 0), whose width is in parts of a link.
_HATCH = [point for x in (-0.08, 0.0, 0.08, 0.16) for point in ((x, -0.2), (x - 0.08, -0.28), (np.nan, 0.0))]
FOOT = np.array([(0.0, 0.0), (-0.12, -0.2), (0.12, -0.2), (0.0, 0.0), (np.nan, 0.0), *_HATCH])
_COILS = [(0.2 + 0.6 * (k + 0.5) / 12, 0.09 * (-1) ** k) for k in range(12)]
SPRING = np.array([(0.0, 0.0), (0.2, 0.0), *_COILS, (0.8, 0.0), (1.0, 0.0)])


class Stage:
    """A figure of a mechanism and its joint forces, whose parts ``show`` moves to a sample."""

    def __init__(self, drawing: Drawing, title: str) -> None:
        self.times = drawing.time_s
        self.unit_mm = MM_PER_M * drawing.link_m
        self.arrows, per_link = _arrows(drawing.forces, self.unit_mm)
        self.picture = Picture(1.0)
        self.axes = self.picture.add_axes((0, 0, 1, 1), xlabel="x [mm]", ylabel="y [mm]")
        self.moves: list[Callable[[int], object]] = []
        self.reached: list[FloatArray] = []
        if any(joint.clearance_m for joint in drawing.joints.values()) and drawing.exaggeration != 1:
            title += f", clearance drawn {drawing.exaggeration:g} times as large"
        self.axes.set_title(title, loc="left")
        self.clock = self.axes.set_title("", loc="right", family="monospace")
        self._draw_bodies(drawing)
        marks = self._draw_marks(drawing)
        quivers = self._draw_forces(drawing.forces)
        longest_mm = LONGEST_ARROW * self.unit_mm
        scale = f"{_rounded(self.unit_mm)} mm are {_rounded(per_link)} N, cut at {_rounded(longest_mm)} mm"
        title, entries = f"forces: {scale}" if quivers else "", [*quivers, *marks]
        self.picture.legend(handles=entries, loc="lower center", ncols=IN_ROW, title=title)
        self._fit(BELOW_IN + ROW_IN * -(-len(entries) // IN_ROW))

    def show(self, k: int) -> Iterable[Artist]:
        """Move everything to sample ``k``."""
        self.clock.set_text(f"t = {self.times[k]:.6f} s")
        for move in self.moves:
            move(k)
        return ()

    def _fit(self, below_in: float) -> None:
        """Give the axes the limits of all that is drawn, and the figure its height."""
        points = np.concatenate([each.reshape(-1, 2) for each in self.reached])
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        middle, (width, height) = (low + high) / 2, high - low + 2 * MARGIN * self.unit_mm
        half = np.array([max(width, height / TALLEST), max(height, width * FLATTEST)]) / 2
        across_in = WIDTH_IN - LEFT_IN - RIGHT_IN
        up_in = across_in * half[1] / half[0]
        total = below_in + up_in + ABOVE_IN
        self.picture.set_size_inches(WIDTH_IN, total)
        self.axes.set_position((LEFT_IN / WIDTH_IN, below_in / total, across_in / WIDTH_IN, up_in / total))
        low, high = middle - half, middle + half
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))

    def _draw_bodies(self, drawing: Drawing) -> None:
        """Draw bodies, guides, pins, bearings and feet of the ground."""
        size = PIN * self.unit_mm
        for guide in drawing.guides.values():
            self._draw_guide(guide)
        for corners in drawing.bodies.values():
            self._draw_area(MM_PER_M * corners, edgecolor=(*mpl.colors.to_rgb(DARK), 0.55), linewidth=5)
        for place, clearance_m in drawing.feet.items():
            below = np.array([0.0, size + MM_PER_M * clearance_m])
            foot = MM_PER_M * np.array(place) - below + self.unit_mm * FOOT
            self._draw_line(np.broadcast_to(foot, (len(self.times), *foot.shape)), color=DARK, linewidth=0.8)
        for ends in drawing.springs:
            for end in ends.swapaxes(0, 1):
                self._draw_disc(end, size, fill=True)
        for joint in drawing.joints.values():
            self._draw_disc(joint.pin_m, size, fill=True)
            if joint.clearance_m:
                self._draw_disc(joint.bearing_m, size + MM_PER_M * joint.clearance_m, fill=False)

    def _draw_guide(self, guide: Guide) -> None:
        """Draw both sides of a guide, and its block or pin."""
        place, beyond = MM_PER_M * guide.pin_m, BEYOND[guide.has_block] * self.unit_mm
        half = self.unit_mm * (BLOCK[1] / 2 if guide.has_block else 1.3 * PIN)
        along = np.stack([np.cos(guide.angle_rad), np.sin(guide.angle_rad)], axis=-1)[:, None]
        left = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        ends = MM_PER_M * guide.ends_m + beyond * along * np.array([[-1.0], [1.0]])
        for side in (-half, half):
            self._draw_line(ends + side * left, color=GREY, linewidth=0.8)
        if guide.has_block:
            corners = self._placed(BOX, place, guide.angle_rad)
            self._draw_area(corners, facecolor="#D9D9D9", edgecolor=DARK)
        else:
            self._draw_disc(guide.pin_m, PIN * self.unit_mm, fill=True)

    def _draw_marks(self, drawing: Drawing) -> list[Line2D]:
        """Draw springs, and marks of loads and the drive; return an entry of the legend for each kind."""
        entries: dict[str, Line2D] = {}
        for ends in drawing.springs:
            entries["spring"] = self._draw_spring(MM_PER_M * ends)
        for load in drawing.loads:
            entries["load"] = self._draw_mark(load, FORCE, color=OF_LOADS)
        if drawing.drive is not None:
            entries["drive"] = self._draw_mark(drawing.drive, BOTH_WAYS, color=OF_DRIVE)
        for name, line in entries.items():
            line.set_label(name)
        return list(entries.values())

    def _draw_spring(self, ends: FloatArray) -> Line2D:
        along = ends[:, 1] - ends[:, 0]
        stretch = np.stack([np.hypot(*along.T) / self.unit_mm, np.ones(len(along))], axis=-1)
        points = self._placed(SPRING * stretch[:, None], ends[:, 0], np.arctan2(*along.T[::-1]))
        return self._draw_line(points, color="black")

    def _draw_mark(self, mark: Mark, straight: FloatArray, color: str) -> Line2D:
        """Draw a straight arrow or one about a place, reversed or mirrored where its sign is negative."""
        shape, angle, flip = straight, mark.angle_rad, mark.sign
        if angle is None:
            shape, angle, flip = TORQUE, np.zeros(len(flip)), np.abs(flip)
        signs = np.stack([flip, mark.sign], axis=-1)
        points = self._placed(shape * signs[:, None], MM_PER_M * mark.place_m, angle)
        return self._draw_line(points, color=color, linewidth=2.0, zorder=3.5)

    def _placed(self, shape: FloatArray, place: FloatArray, angle_rad: FloatArray) -> FloatArray:
        """Return a shape in parts of a link, (m, 2) or (n, m, 2), turned and moved to places, (n, m, 2)."""
        x, y = self.unit_mm * shape[..., 0], self.unit_mm * shape[..., 1]
        cos, sin = np.cos(angle_rad)[:, None], np.sin(angle_rad)[:, None]
        return place[:, None] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)

    def _draw_line(self, points: FloatArray, **style: Any) -> Line2D:
        (line,) = self.axes.plot([], [], **style)
        self.reached.append(points)
        self.moves.append(lambda k: line.set_data(*points[k].T))
        return line

    def _draw_area(self, points: FloatArray, facecolor: Any = (0.33, 0.33, 0.33, 0.15), **style: Any) -> None:
        area = Polygon(points[0], facecolor=facecolor, joinstyle="round", zorder=2, **style)
        self.axes.add_patch(area)
        self.reached.append(points)
        self.moves.append(lambda k: area.set_xy(points[k]))

    def _draw_disc(self, centre: FloatArray, radius: float, fill: bool) -> None:
        face: dict[str, Any] = {"facecolor": "white"} if fill else {"fill": False}
        disc = Circle((0, 0), radius, edgecolor="black", linewidth=1.0, zorder=3, **face)
        self.axes.add_patch(disc)
        self.reached += [MM_PER_M * centre - radius, MM_PER_M * centre + radius]
        self.moves.append(lambda k: disc.set_center(MM_PER_M * centre[k]))

    def _draw_forces(self, forces: Mapping[str, Force]) -> list[Any]:
        """Draw forces as arrows: each in its colour, or where there are too many, one colour for a kind."""
        kinds: dict[str, list[str]] = {}
        for name in forces:
            kind = name if len(forces) <= MOST_COLOURS else KINDS[name.split()[0]]
            kinds.setdefault(kind, []).append(name)
        return [
            self._draw_arrows(
                label,
                colour,
                MM_PER_M * np.stack([forces[name].place_m for name in names], axis=1),
                np.stack([self.arrows[name] for name in names], axis=1),
            )
            for (label, names), colour in zip(kinds.items(), COLOURS[1:], strict=False)
        ]

    def _draw_arrows(self, label: str, colour: str, places: FloatArray, arrows: FloatArray) -> Any:
        in_mm: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "zorder": 4}
        quiver = self.axes.quiver(*places[0].T, *arrows[0].T, color=colour, label=label, **in_mm)
        self.reached += [places, places + arrows]

        def move(k: int) -> None:
            quiver.set_offsets(places[k])
            quiver.set_UVC(*arrows[k].T)

        self.moves.append(move)
        return quiver


def _rounded(number: float) -> str:
    return f"{float(f'{number:.3g}'):g}"


def _arrows(forces: Mapping[str, Force], unit_mm: float) -> tuple[dict[str, FloatArray], float]:
    """Return the arrow (n, 2) in mm of every force by its name, and the N of a typical link's length."""
    sizes = {name: np.hypot(*force.force_N.T) for name, force in forces.items()}
    usual = float(np.quantile(np.concatenate([*sizes.values()] or [[0.0]]), IN_LENGTH)) or 1.0
    per_link, longest = usual / ARROW, usual * LONGEST_ARROW / ARROW
    arrows = {
        name: unit_mm / per_link * force.force_N * (longest / np.maximum(sizes[name], longest))[:, None]
        for name, force in forces.items()
    }
    return arrows, per_link

"""An animation of a mechanism with its joint forces as arrows: a page with controls, a GIF, or an MP4."""

import io
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.markers import CARETUP
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.states import (
    GROUND,
    Line,
    Pin,
    Point,
    Spring,
    direction,
    guide_column,
    line_angle_rad,
    point_motion,
    way,
)
from engine_models.scene.scene import Scene
from reports.look import GREY, RC, WIDTH_IN, Picture
from reports.run_figures import COLOURS

#: The most pictures of a film, how many of them are shown in a second, and their resolution.
MOST_PICTURES, PER_SECOND, DPI = 100, 20, 110
#: Every picture has the same layout, and to compute it anew would take longer than all else.
FIXED = {"figure.constrained_layout.use": False}
#: The unit of sizes in parts of the diagonal of all places, and in that unit: radius of a pin, sides of a
#: block, how far a guide goes on beyond its block's way, and the margin around all.
UNIT, PIN, BLOCK, BEYOND, MARGIN = 0.2, 0.07, (0.5, 0.34), 0.3, 0.15
#: The part of all forces that is drawn in full, the length of the largest of those and of the longest arrow.
IN_LENGTH, ARROW, LONGEST_ARROW = 0.95, 0.6, 0.9
#: The forces that share a colour, by how their names begin.
KINDS = {"joint": "joint forces, each on the body named later", "guide": "forces of guides on their bodies"}
#: What is around the axes in the figure, in inches, and height of the axes to width.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN = 0.7, 0.15, 1.0, 0.3
FLATTEST, TALLEST = 0.3, 0.75
#: A pin nearer to its body's centre of mass than this part of the radius of gyration is at the centre.
CENTRED = 1e-6
DARK, MM_PER_M = "#555555", 1e3

#: A body, or the ground, and a point of it.
End = tuple[int, Point]


def can_write(ending: str) -> bool:
    """Return whether a film can be written to a file of this ending here: .mp4 takes ffmpeg."""
    return ending != ".mp4" or FFMpegWriter.isAvailable()


def pictured(samples: int) -> NDArray[np.intp]:
    """Return the numbers of the samples that a film shows."""
    return np.rint(np.linspace(0, samples - 1, min(samples, MOST_PICTURES))).astype(np.intp)


def film_bytes(
    scene: Scene, run: Trajectory, exaggerate: float, ending: str, drawn: Callable[[float], None]
) -> bytes:
    """Return the film of a run as the bytes of a .html, .gif or .mp4 file.

    ``drawn`` is called with the time in s of every picture that is done.
    """
    with mpl.rc_context(RC | FIXED):
        stage = Stage(scene, run, exaggerate)
        if ending == ".html":
            return _page(stage, scene.name, drawn)
        writer = {".gif": PillowWriter, ".mp4": FFMpegWriter}[ending](fps=PER_SECOND)
        animation = FuncAnimation(stage.picture, stage.show, frames=len(run.time_s), blit=False)
        with TemporaryDirectory() as folder:
            file = Path(folder) / f"film{ending}"
            animation.save(file, writer, dpi=DPI, progress_callback=lambda k, _: drawn(float(run.time_s[k])))
            return file.read_bytes()


def _page(stage: "Stage", title: str, drawn: Callable[[float], None]) -> bytes:
    """Return a page that holds its pictures, and needs no other file."""
    pictures = []
    for k, time_s in enumerate(stage.run.time_s):
        stage.show(k)
        content = io.BytesIO()
        stage.picture.savefig(content, dpi=DPI)
        pictures.append(b64encode(content.getvalue()).decode("ascii"))
        drawn(time_s)
    loader = PackageLoader("reports", ".")
    page = Environment(loader=loader, autoescape=True, undefined=StrictUndefined).get_template(
        "film.html.jinja"
    )
    return page.render(title=title, pictures=pictures, interval_ms=1000 // PER_SECOND).encode("utf-8")


class Stage:
    """The figure of a mechanism and its forces in the n samples of a run, whose parts ``show`` moves to one.

    Places are in mm. ``bodies`` are the corners of bodies (n, corners, 2), ``joints`` the centres of bearing
    and pin (n, 2), ``forces`` the place and the force in N (n, 2) of each joint, on the body named later, and
    of each guide, and ``arrows`` how these are drawn.

    Gaps are drawn ``exaggerate`` times as large: the pin of a joint is moved away from its bearing, or the
    bearing from a pin on the ground or on a block.
    """

    def __init__(self, scene: Scene, run: Trajectory, exaggerate: float = 1.0) -> None:
        self.scene, self.run, self.exaggerate = scene, run, exaggerate
        self.mechanism = scene.mechanism
        self.blocks = {guide.body_j for guide in self.mechanism.guides if not guide.turns}
        self.moved: dict[End, FloatArray] = {}
        self.moved = dict(self._moved())
        names = self.mechanism.names
        corners = {name: self.corners(body) for body, name in enumerate(names)}
        self.bodies = {
            name: np.stack([self.place((names.index(name), point)) for point in points], axis=1)
            for name, points in corners.items()
            if points
        }
        self.joints = {
            pin.name: tuple(self.place(end) for end in _bearing_and_pin(pin)) for pin in self.mechanism.pins
        }
        self.forces = dict(self._forces())
        places = [*self.bodies.values(), *(np.stack(ends) for ends in self.joints.values())]
        places += [place for place, _ in self.forces.values()]
        extent = np.ptp(np.concatenate([each.reshape(-1, 2) for each in places]), axis=0)
        self.unit_mm = UNIT * float(np.hypot(*extent)) or 1.0
        self.arrows: dict[str, FloatArray] = {}
        self._draw()

    def show(self, k: int) -> Iterable[Artist]:
        """Move everything to sample ``k``."""
        self.clock.set_text(f"t = {self.run.time_s[k]:.6f} s")
        for move in self.moves:
            move(k)
        return ()

    def place(self, end: End) -> FloatArray:
        """Return the place of a point of a body, (n, 2), as it is drawn."""
        true = point_motion(*end, self.run.position, self.run.velocity).place_m
        return MM_PER_M * true + self.moved.get(end, 0.0)

    def corners(self, body: int) -> list[Point]:
        """Return the points of a body that are its corners: two at least, or none of a mere block.

        They are where it is joined to others. To a single one comes the centre of mass, or if it is that, a
        point as far from it as the radius of gyration.
        """
        linked: list[Pin | Spring] = [*self.mechanism.pins, *self.mechanism.springs]
        ends = [end for each in linked for end in _ends(each)]
        ends += [_ends(guide)[1] for guide in self.mechanism.guides]
        points = list(dict.fromkeys(point for own, point in ends if own == body))
        if len(points) == 1:
            if body in self.blocks:
                return []
            of = self.mechanism.bodies[body]
            radius = float(np.sqrt(of.inertia_kg_m2 / of.mass_kg))
            points.append((radius, 0.0) if np.hypot(*points[0]) < CENTRED * radius else (0.0, 0.0))
        about = np.array(points) - np.mean(points, axis=0)
        return [points[k] for k in np.argsort(np.arctan2(about[:, 1], about[:, 0]), kind="stable")]

    def _moved(self) -> Iterator[tuple[End, FloatArray]]:
        """Yield the ends of joints with clearance that are moved, and how far."""
        held = {GROUND, *self.blocks}
        for joint in self.mechanism.loose:
            bearing, pin = _bearing_and_pin(joint)
            more = (self.exaggerate - 1) * (self.place(pin) - self.place(bearing))
            if pin[0] in held and bearing[0] not in held:
                yield bearing, -more
            else:
                yield pin, more

    def _forces(self) -> Iterator[tuple[str, tuple[FloatArray, FloatArray]]]:
        """Yield what each force is, with its place and the force."""
        names, run = self.mechanism.names, self.run
        for pin in self.mechanism.pins:
            what = f"joint {pin.name} on the {names[pin.body_j]}"
            yield what, (self.place(_ends(pin)[1]), run.joint_force_N[pin.name])
        for guide in self.mechanism.guides:
            across = direction(guide, run.position)[1] * run.guide_force_N[guide.name][:, None]
            what = guide_column(self.scene, guide.name).removesuffix("_normal_force_N").replace("_", " ", 1)
            yield f"{what} on the {names[guide.body_j]}", (self.place(_ends(guide)[1]), across)

    def _draw(self) -> None:
        title = self.scene.name
        if self.mechanism.loose and self.exaggerate != 1:
            title += f", clearance drawn {self.exaggerate:g} times as large"
        self.picture, self.moves = Picture(1.0), list[Callable[[int], object]]()
        self.axes = self.picture.add_axes((0, 0, 1, 1), xlabel="x [mm]", ylabel="y [mm]")
        self.axes.set_title(title, loc="left")
        self.clock = self.axes.set_title("", loc="right", family="monospace")
        self.reached: list[FloatArray] = []
        self._draw_guides()
        for corners in self.bodies.values():
            self._draw_area(corners, edgecolor=(*mpl.colors.to_rgb(DARK), 0.55), linewidth=5)
        for spring in self.mechanism.springs:
            ends = np.stack([self.place(end) for end in _ends(spring)], axis=1)
            self._draw_line(ends, color="black", linestyle=":", linewidth=2, marker="o")
        radius = PIN * self.unit_mm
        for pin in self.mechanism.pins:
            bearing, own = self.joints[pin.name]
            if pin.body_i == GROUND:
                self._draw_line(bearing[:, None], color=GREY, marker=CARETUP, markersize=11)
            self._draw_disc(own, radius, facecolor="white")
            if pin.clearance:
                gap = MM_PER_M * self.exaggerate * pin.clearance.radial_clearance_m
                self._draw_disc(bearing, radius + gap, fill=False)
        quivers, scale = self._draw_forces()
        self.picture.legend(handles=quivers, loc="lower center", ncols=2, title=f"forces: {scale}")
        self._fit()

    def _draw_guides(self) -> None:
        """Draw the line of each guide as long as its block or pin needs, and the block."""
        for guide in self.mechanism.guides:
            along, _ = way(guide, self.run.position, self.run.velocity)
            beyond_m = BEYOND * self.unit_mm / MM_PER_M
            ends = [
                self.place(_on(guide, way_m)) for way_m in (along.min() - beyond_m, along.max() + beyond_m)
            ]
            self._draw_line(np.stack(ends, axis=1), color=GREY, linewidth=0.8)
            centre = self.place(_ends(guide)[1])
            if guide.turns:
                self._draw_disc(centre, PIN * self.unit_mm, facecolor="white")
                continue
            angle = line_angle_rad(guide, self.run.position)
            ahead = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
            left = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)[:, None]
            x, y = (
                self.unit_mm
                / 2
                * np.array(BLOCK)[:, None, None]
                * [[[-1], [1], [1], [-1]], [[-1], [-1], [1], [1]]]
            )
            corners = centre[:, None] + x * ahead + y * left
            self._draw_area(corners, facecolor="#D9D9D9", edgecolor=DARK)

    def _draw_line(self, points: FloatArray, **style: Any) -> None:
        (line,) = self.axes.plot([], [], **style)
        self.reached.append(points)
        self.moves.append(lambda k: line.set_data(*points[k].T))

    def _draw_area(self, points: FloatArray, facecolor: Any = (0.33, 0.33, 0.33, 0.15), **style: Any) -> None:
        area = Polygon(points[0], facecolor=facecolor, joinstyle="round", zorder=2, **style)
        self.axes.add_patch(area)
        self.reached.append(points)
        self.moves.append(lambda k: area.set_xy(points[k]))

    def _draw_disc(self, centre: FloatArray, radius: float, **style: Any) -> None:
        disc = Circle((0, 0), radius, edgecolor="black", linewidth=1.0, zorder=3, **style)
        self.axes.add_patch(disc)
        self.reached += [centre - radius, centre + radius]
        self.moves.append(lambda k: disc.set_center(centre[k]))

    def _draw_forces(self) -> tuple[list[Any], str]:
        """Draw the forces of joints and of guides as arrows, the longest cut, and return their scale."""
        largest = [np.hypot(*force.T) for _, force in self.forces.values()]
        usual_N = float(np.quantile(np.concatenate([[0.0], *largest]), IN_LENGTH)) or 1.0
        mm_per_N, longest_mm = ARROW * self.unit_mm / usual_N, LONGEST_ARROW * self.unit_mm
        for name, (places, force) in self.forces.items():
            cut = longest_mm / np.maximum(mm_per_N * np.hypot(*force.T), longest_mm)
            self.arrows[name] = mm_per_N * force * cut[:, None]
            self.reached += [places, places + self.arrows[name]]
        quivers = []
        for (kind, label), colour in zip(KINDS.items(), COLOURS[1:], strict=False):
            if names := [name for name in self.forces if name.startswith(kind)]:
                places = np.stack([self.forces[name][0] for name in names], axis=1)
                arrows = np.stack([self.arrows[name] for name in names], axis=1)
                quivers.append(self._draw_arrows(places, arrows, color=colour, label=label))
        scale = f"{self.unit_mm:.3g} mm are {self.unit_mm / mm_per_N:.3g} N, cut at {longest_mm:.3g} mm"
        return quivers, scale

    def _draw_arrows(self, places: FloatArray, arrows: FloatArray, **style: Any) -> Any:
        in_mm: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "zorder": 4}
        quiver = self.axes.quiver(*places[0].T, *arrows[0].T, **in_mm, **style)

        def move(k: int) -> None:
            quiver.set_offsets(places[k])
            quiver.set_UVC(*arrows[k].T)

        self.moves.append(move)
        return quiver

    def _fit(self) -> None:
        """Give the axes the limits of all that is drawn, and the figure its height."""
        points = np.concatenate([each.reshape(-1, 2) for each in self.reached])
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        middle, (width, height) = (low + high) / 2, high - low + 2 * MARGIN * self.unit_mm
        half = np.array([max(width, height / TALLEST), max(height, width * FLATTEST)]) / 2
        across_in = WIDTH_IN - LEFT_IN - RIGHT_IN
        up_in = across_in * half[1] / half[0]
        total = BELOW_IN + up_in + ABOVE_IN
        self.picture.set_size_inches(WIDTH_IN, total)
        self.axes.set_position((LEFT_IN / WIDTH_IN, BELOW_IN / total, across_in / WIDTH_IN, up_in / total))
        (left, low_y), (right, high_y) = middle - half, middle + half
        self.axes.set(xlim=(left, right), ylim=(low_y, high_y))


def _ends(linked: Pin | Spring | Line) -> tuple[End, End]:
    return (linked.body_i, linked.point_i), (linked.body_j, linked.point_j)


def _bearing_and_pin(pin: Pin) -> tuple[End, End]:
    first, later = _ends(pin)
    return (later, first) if pin.bearing_on_j else (first, later)


def _on(line: Line, way_m: float) -> End:
    """Return the point at a way along a line, of the body that the line is on."""
    x, y = line.point_i
    return line.body_i, (x + way_m * float(np.cos(line.angle_rad)), y + way_m * float(np.sin(line.angle_rad)))

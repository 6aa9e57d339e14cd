"""An animation of a mechanism with its joint forces as arrows: a page with controls, a GIF, or an MP4."""

import io
from base64 import b64encode
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.lines import Line2D
from matplotlib.markers import CARETUP
from matplotlib.patches import Circle, Polygon

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.states import GROUND, Point, direction, point_motion, way
from engine_models.mechanics.trajectory import selected
from engine_models.scene.plain_words import BadInput
from engine_models.scene.scene import Scene
from engine_models.watch import tell
from reports.look import BLUE, GREY, RC, VERMILLION, WIDTH_IN, Picture
from reports.page import template

#: The most pictures of a film, how many of them are shown in a second, and their resolution.
MOST_PICTURES, PER_SECOND, DPI = 100, 20, 110
#: The unit of sizes in parts of the diagonal of all places, and in that unit: radius of a pin, half the sides
#: of a block, how far a guide goes on beyond its block's way, and the margin around all.
UNIT, PIN, HALF_BLOCK, BEYOND, MARGIN = 0.2, 0.07, (0.25, 0.17), 0.3, 0.15
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * HALF_BLOCK
#: The part of all forces that is drawn in full, the length of the largest of those and of the longest arrow.
IN_LENGTH, ARROW, LONGEST_ARROW = 0.95, 0.6, 0.9
#: The forces that share a colour, by how their names begin.
KINDS = {
    "joint": ("joint forces, each on the body named later", VERMILLION),
    "guide": ("forces of guides on their bodies", BLUE),
}
#: What is around the axes in the figure, in inches, and height of the axes to width.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN, FLATTEST, TALLEST = 0.7, 0.15, 1.0, 0.3, 0.3, 0.75
#: A pin nearer to its body's centre of mass than this part of the radius of gyration is at the centre.
CENTRED = 1e-6
DARK, LIGHT, MM_PER_M = "#555555", "#D9D9D9", 1e3

#: A body, or the ground, and a point of it.
End = tuple[int, Point]


def film_bytes(scene: Scene, run: Trajectory, exaggerate: float, ending: str) -> bytes:
    """Return the film of a run as the bytes of a .html, .gif or .mp4 file, which takes ffmpeg.

    A page holds its pictures, and needs no other file.
    """
    samples = len(run.time_s)
    run = selected(run, np.rint(np.linspace(0, samples - 1, min(samples, MOST_PICTURES))).astype(np.intp))
    with mpl.rc_context(RC), TemporaryDirectory() as folder:
        stage, file, pictures = Stage(scene, run, exaggerate), Path(folder) / f"film{ending}", list[str]()
        if ending == ".html":
            for time_s in stage.pictures():
                content = io.BytesIO()
                stage.picture.savefig(content, dpi=DPI)
                pictures.append(b64encode(content.getvalue()).decode("ascii"))
                tell(time_s)
            page, interval_ms = template("film.html.jinja"), 1000 // PER_SECOND
            text: str = page.render(title=scene.name, pictures=pictures, interval_ms=interval_ms)
            return text.encode("utf-8")
        if ending == ".mp4" and not FFMpegWriter.isAvailable():
            raise BadInput("animate: expected a file .html or .gif, or ffmpeg installed, got none for .mp4")
        writer = {".gif": PillowWriter, ".mp4": FFMpegWriter}[ending](fps=PER_SECOND)
        with writer.saving(stage.picture, file, DPI):
            for time_s in stage.pictures():
                writer.grab_frame()
                tell(time_s)
        return file.read_bytes()


class Stage:
    """The figure of a mechanism and its forces in the n samples of a run, of which ``show`` draws one.

    Places are in mm. ``bodies`` are the corners of bodies (n, corners, 2), ``joints`` the centres of bearing
    and pin (n, 2), ``forces`` the place and the force in N (n, 2) of each joint, on the body named later, and
    of each guide, and ``arrows`` how these are drawn.

    Gaps are drawn ``exaggerate`` times as large: the pin of a joint is moved away from its bearing, or the
    bearing from a pin on the ground or on a block.
    """

    def __init__(self, scene: Scene, run: Trajectory, exaggerate: float = 1.0) -> None:
        self.run, self.mechanism, self.exaggerate = run, scene.mechanism, exaggerate
        self.blocks = {guide.body_j for guide in self.mechanism.guides if not guide.turns}
        self.moved: dict[End, FloatArray] = {}
        self.moved = dict(self._moved())
        ends = {name: self._corners(body) for body, name in enumerate(self.mechanism.names)}
        self.bodies = {name: np.stack([*map(self.place, of)], axis=1) for name, of in ends.items() if of}
        self.joints = {pin.name: tuple(map(self.place, _bearing_and_pin(pin))) for pin in self.mechanism.pins}
        self.forces = dict(self._forces())
        places = [
            *self.bodies.values(),
            *chain(*self.joints.values()),
            *(at for at, _ in self.forces.values()),
        ]
        extent = np.ptp(np.concatenate([each.reshape(-1, 2) for each in places]), axis=0)
        self.unit_mm = UNIT * float(np.hypot(*extent)) or 1.0
        self.title = scene.name
        if self.mechanism.loose and exaggerate != 1:
            self.title += f", clearance drawn {exaggerate:g} times as large"
        sizes = [np.hypot(*force.T) for _, force in self.forces.values()]
        usual_N = float(np.quantile(np.concatenate([[0.0], *sizes]), IN_LENGTH)) or 1.0
        mm_per_N, longest_mm = ARROW * self.unit_mm / usual_N, LONGEST_ARROW * self.unit_mm
        self.arrows = {
            name: mm_per_N * force * (longest_mm / np.maximum(mm_per_N * size, longest_mm))[:, None]
            for (name, (_, force)), size in zip(self.forces.items(), sizes, strict=True)
        }
        self.shapes = [*self._shapes()]
        self.picture = Picture(1.0)
        self.picture.set_layout_engine("none")  # to compute it for every picture would take longest
        self.axes = self.picture.add_axes((0, 0, 1, 1))
        handles = [Line2D([], [], color=colour, label=label) for label, colour in KINDS.values()]
        scale = f"{self.unit_mm:.3g} mm are {self.unit_mm / mm_per_N:.3g} N, cut at {longest_mm:.3g} mm"
        self.picture.legend(handles=handles, loc="lower center", ncols=2, title=f"forces: {scale}")
        self._fit()
        self.show(0)

    def pictures(self) -> Iterator[float]:
        """Show one sample after the other, and yield its time in s."""
        for k, time_s in enumerate(self.run.time_s):
            self.show(k)
            yield float(time_s)

    def show(self, k: int) -> None:
        """Draw sample ``k``."""
        self.axes.clear()
        self.axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", **self.limits)
        self.axes.set_title(self.title, loc="left")
        self.axes.set_title(f"t = {self.run.time_s[k]:.6f} s", loc="right", family="monospace")
        for kind, places, style in self.shapes:
            if kind is Line2D:
                self.axes.plot(*places[k].T, **style)
            else:
                self.axes.add_patch(kind(places[k] if kind is Polygon else places[k, 0], **style))
        look: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "zorder": 4}
        for kind, (_, colour) in KINDS.items():
            if names := [name for name in self.forces if name.startswith(kind)]:
                places = np.array([self.forces[name][0][k] for name in names])
                arrows = np.array([self.arrows[name][k] for name in names])
                self.axes.quiver(*places.T, *arrows.T, color=colour, **look)

    def place(self, end: End) -> FloatArray:
        """Return the place of a point of a body, (n, 2), as it is drawn."""
        true = point_motion(*end, self.run.position, self.run.velocity).place_m
        return MM_PER_M * true + self.moved.get(end, 0.0)

    def _corners(self, body: int) -> list[End]:
        """Return the corners of a body, which are where it is joined to others: two at least, or none.

        To a single one comes the centre of mass, or if it is that, a point as far from it as the radius of
        gyration. A mere block has none.
        """
        linked = [end for each in (*self.mechanism.pins, *self.mechanism.springs) for end in _ends(each)]
        linked += [_ends(guide)[1] for guide in self.mechanism.guides]
        points = list(dict.fromkeys(point for own, point in linked if own == body))
        if len(points) == 1:
            if body in self.blocks:
                return []
            of = self.mechanism.bodies[body]
            radius = float(np.sqrt(of.inertia_kg_m2 / of.mass_kg))
            points.append((radius, 0.0) if np.hypot(*points[0]) < CENTRED * radius else (0.0, 0.0))
        about = np.array(points) - np.mean(points, axis=0)
        return [(body, points[k]) for k in np.argsort(np.arctan2(about[:, 1], about[:, 0]), kind="stable")]

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
            yield f"guide {guide.name} on the {names[guide.body_j]}", (self.place(_ends(guide)[1]), across)

    def _shapes(self) -> Iterator[tuple[Any, FloatArray, dict[str, Any]]]:
        """Yield all that is drawn: what it is, its places (n, points, 2), and its style."""
        radius, beyond_m = PIN * self.unit_mm, BEYOND * self.unit_mm / MM_PER_M
        disc: dict[str, Any] = {"facecolor": "white", "edgecolor": "black", "zorder": 3, "radius": radius}
        for guide in self.mechanism.guides:
            along, _ = way(guide, self.run.position, self.run.velocity)
            (x, y), (cos, sin) = guide.point_i, (np.cos(guide.angle_rad), np.sin(guide.angle_rad))
            reach = along.min() - beyond_m, along.max() + beyond_m
            ends = [self.place((guide.body_i, (x + cos * at, y + sin * at))) for at in reach]
            yield Line2D, np.stack(ends, axis=1), {"color": GREY, "linewidth": 0.8}
            centre = self.place(_ends(guide)[1])[:, None]
            if guide.turns:
                yield Circle, centre, disc
            else:
                axes = np.stack(direction(guide, self.run.position), axis=1)
                block = {"facecolor": LIGHT, "edgecolor": DARK, "zorder": 2}
                yield Polygon, centre + self.unit_mm * CORNERS @ axes, block
        body = {"facecolor": f"{DARK}26", "edgecolor": f"{DARK}8C", "linewidth": 5, "zorder": 2}
        for corners in self.bodies.values():
            yield Polygon, corners, {**body, "joinstyle": "round"}
        for spring in self.mechanism.springs:
            ends = [*map(self.place, _ends(spring))]
            yield Line2D, np.stack(ends, axis=1), {"color": "black", "linestyle": ":", "marker": "o"}
        for pin in self.mechanism.pins:
            bearing, own = (at[:, None] for at in self.joints[pin.name])
            if pin.body_i == GROUND:
                yield Line2D, bearing, {"color": GREY, "marker": CARETUP, "markersize": 11}
            yield Circle, own, disc
            if pin.clearance:
                gap = MM_PER_M * self.exaggerate * pin.clearance.radial_clearance_m
                yield Circle, bearing, {**disc, "fill": False, "radius": radius + gap}

    def _fit(self) -> None:
        """Give the axes the limits of all that is drawn, and the figure its height."""
        tips = [at + self.arrows[name] for name, (at, _) in self.forces.items()]
        reached = [
            places + sign * style.get("radius", 0.0) for _, places, style in self.shapes for sign in (1, -1)
        ]
        points = np.concatenate([each.reshape(-1, 2) for each in (*reached, *tips)])
        margin = MARGIN * self.unit_mm
        low, high = np.nanmin(points, axis=0) - margin, np.nanmax(points, axis=0) + margin
        self.limits: dict[str, Any] = {"xlim": (low[0], high[0]), "ylim": (low[1], high[1])}
        across_in, (width, height) = WIDTH_IN - LEFT_IN - RIGHT_IN, high - low
        up_in = across_in * float(np.clip(height / width, FLATTEST, TALLEST))
        total = BELOW_IN + up_in + ABOVE_IN
        self.picture.set_size_inches(WIDTH_IN, total)
        self.axes.set_position((LEFT_IN / WIDTH_IN, BELOW_IN / total, across_in / WIDTH_IN, up_in / total))


def _ends(linked: Any) -> tuple[End, End]:
    """Return the ends of a pin, a line or a spring."""
    return (linked.body_i, linked.point_i), (linked.body_j, linked.point_j)


def _bearing_and_pin(pin: Any) -> tuple[End, End]:
    first, later = _ends(pin)
    return (later, first) if pin.bearing_on_j else (first, later)

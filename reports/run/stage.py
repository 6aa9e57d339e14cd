"""The figure of a film: the mechanism and its joint forces, moved from sample to sample."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.patches import Circle, Rectangle

from reports.run.mechanism import Mechanism, Places, Points, places
from reports.run.picture import COLOURS, Picture
from reports.style import GREY, WIDTH_IN

#: Sizes in parts of the crank: of a pin, of the slider, of what is free around the mechanism.
PIN, SLIDER, MARGIN = 0.07, (0.5, 0.34), 0.9
#: Of all forces so many are drawn in full, the largest of those as so long a part of the crank; longer arrows
#: are cut.
IN_LENGTH, ARROW, LONGEST_ARROW = 0.95, 0.6, 0.9
#: What is around the mechanism's axes in the figure, in inches; below them are their label and the legend.
LEFT_IN, RIGHT_IN, BELOW_IN, ABOVE_IN = 0.6, 0.15, 1.0, 0.3
MM_PER_M = 1e3


class Stage:
    """A figure whose parts ``show`` moves to a sample, of the table of samples that it is made for."""

    def __init__(self, frame: pd.DataFrame, mechanism: Mechanism, exaggeration: float, title: str) -> None:
        self.times = frame.index.to_numpy()
        self.places = places(frame, mechanism, exaggeration)
        self.crank_mm, self.joints = MM_PER_M * mechanism.crank_m, mechanism.joints
        self.forces, per_crank = _arrows(frame, self.joints, self.crank_mm)
        low, high = _extent(self.places, self.crank_mm)
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
        self.links = self._links(mechanism, exaggeration)
        self.quivers = [
            self._arrow(name, colour) for name, colour in zip(self.forces, COLOURS[1:], strict=False)
        ]
        scale = f"a crank's length is {float(f'{per_crank:.3g}'):g} N, cut at {LONGEST_ARROW:g} of it"
        self.picture.legend(
            handles=self.quivers, loc="lower center", ncols=len(self.quivers), title=f"forces: {scale}"
        )

    def show(self, k: int) -> Iterable[Artist]:
        """Move everything to sample ``k``."""
        self.clock.set_text(f"t = {self.times[k]:.6f} s")
        for move in self.links:
            move(k)
        for (joint, arrows), quiver in zip(self.forces.values(), self.quivers, strict=True):
            quiver.set_offsets([MM_PER_M * self.places.pin[joint][k]])
            quiver.set_UVC(*arrows[k])
        return self.quivers

    def _links(self, mechanism: Mechanism, exaggeration: float) -> list[Callable[[int], None]]:
        """Draw links, slider, pins and bearings; return what moves each."""
        at, size = self.places, PIN * self.crank_mm
        moves = [self._line(at.pin["O"], at.crank_end)]
        if mechanism.rod_m is not None:
            moves += [self._line(at.pin["A"], at.bearing["B"]), self._slider(at.pin["B"])]
        for joint in mechanism.joints:
            moves.append(self._disc(at.pin[joint], size, fill=True))
            if joint in mechanism.radial_clearance_m:
                gap = MM_PER_M * exaggeration * mechanism.radial_clearance_m[joint]
                moves.append(self._disc(at.bearing[joint], size + gap, fill=False))
        return moves

    def _line(self, begin: Points, end: Points) -> Callable[[int], None]:
        (line,) = self.axes.plot([], [], color="#555555", linewidth=5, alpha=0.55, solid_capstyle="round")
        ends = MM_PER_M * np.stack([begin, end], axis=-1)
        return lambda k: line.set_data(ends[k])

    def _slider(self, centre: Points) -> Callable[[int], None]:
        width, height = (part * self.crank_mm for part in SLIDER)
        for side in (-1, 1):
            self.axes.axhline(side * height / 2, color=GREY, linewidth=0.8)
        box = Rectangle((0, 0), width, height, facecolor="#D9D9D9", edgecolor="#555555")
        self.axes.add_patch(box)
        corner = MM_PER_M * centre - [width / 2, height / 2]
        return lambda k: box.set_xy(corner[k])

    def _disc(self, centre: Points, radius: float, fill: bool) -> Callable[[int], None]:
        face: dict[str, Any] = {"facecolor": "white"} if fill else {"fill": False}
        disc = Circle((0, 0), radius, edgecolor="black", linewidth=1.0, zorder=3, **face)
        self.axes.add_patch(disc)
        return lambda k: disc.set_center(MM_PER_M * centre[k])

    def _arrow(self, name: str, colour: str) -> Any:
        in_mm: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "zorder": 4}
        return self.axes.quiver([0], [0], [0], [0], color=colour, label=name, **in_mm)


def _arrows(frame: pd.DataFrame, joints: str, crank_mm: float) -> tuple[dict[str, tuple[str, Points]], float]:
    """Return joint and arrows (n, 2) in mm of every force by its name, and how many N a crank's length is."""
    on = {"O": "crank", "A": "rod", "B": "slider"}
    forces = {
        f"joint {joint} on the {on[joint]}": (
            joint,
            frame[[f"joint_{joint}_force_{axis}_N" for axis in "xy"]].to_numpy(),
        )
        for joint in joints
    }
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


def _extent(at: Places, crank_mm: float) -> tuple[Points, Points]:
    """Return the lower left and the upper right corner of what is shown, in mm."""
    points = MM_PER_M * np.concatenate([*at.pin.values(), *at.bearing.values(), at.crank_end])
    return points.min(axis=0) - MARGIN * crank_mm, points.max(axis=0) + MARGIN * crank_mm

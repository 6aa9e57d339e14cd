"""A card for every scene of the library: what it is, how it moves, what makes it hard."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure as Drawing

from reports.gallery.data import extremes, has, joints_with_clearance, of_view
from reports.gallery.drawing import MM, WIDTH_IN, Scene, draw_mechanism
from reports.gallery.orbits import UM, circle, radius_m
from reports.parts import Figure
from reports.results import Results
from reports.run.picture import COLOURS, DASHES
from reports.style import BLACK, RC
from reports.tables import plain

HEIGHT_IN, MS, US, KN = 1.75, 1e3, 1e6, 1e-3
#: A contact shorter than this part of a run begins and ends within some ten thousand roundings of its time.
RESOLVED = 1e12
#: What drives the crank, by the scene's ``drive.kind``; speeds are those of the start in rad/s.
DRIVES = {
    "free": "none, from {start:.4g} rad/s",
    "constant-speed": "constant {start:.4g} rad/s",
    "torque": "torque of {torque_N_m:g} N·m",
    "fluctuating": "{start:.4g} ± {amplitude_rad_s:.3g} rad/s",
    "ramp": "to {final_speed_rad_s:.4g} rad/s in {ramp_time_s:g} s",
    "motor": "motor, {no_load_speed_rad_s:g} rad/s without load",
    "table": "a table of angles",
}


@dataclass(frozen=True)
class Card:
    """A scene: its name, what it is in a sentence, what makes it hard in another, and facts by their names.

    The figure has the mechanism, the slider over time and the pins' paths, as far as the scene has them.
    """

    name: str
    text: str
    hard: str
    facts: tuple[tuple[str, str], ...]
    figure: Figure

    def as_figure(self) -> Figure:
        """Return the card as a figure whose words hold all of it."""
        facts = "; ".join(f"{name}: {value}" for name, value in self.facts)
        words = f"{self.text} {facts}. {self.hard} {self.figure.reading}"
        return replace(self.figure, title=self.name, reading=words, card=True)


def scene_cards(results: Results) -> list[Card]:
    """Return the cards of all scenes of the library that have been run, in the library's groups."""
    rows = of_view(results, "whole")
    groups = rows["scene"].map(lambda name: ("ideal", "clearance", "rigid").index(name.split("-")[0]))
    return [_card(results, row) for _, row in rows.loc[groups.sort_values(kind="stable").index].iterrows()]


def _card(results: Results, row: pd.Series) -> Card:
    scene: Scene = json.loads(row["scene_json"])
    return Card(
        row["scene"], row["scene_text"], _hard(row), tuple(_facts(scene, row)), _figure(results, row, scene)
    )


def _facts(scene: Scene, row: pd.Series) -> Iterator[tuple[str, str]]:
    """Yield the parameters of a scene and the largest force in its run."""
    parts = [scene[name] for name in ("crank", "rod", "slider") if name in scene]
    yield "lengths", ", ".join(f"{part['length_m'] * MM:g}" for part in parts if "length_m" in part) + " mm"
    yield "masses", ", ".join(f"{part['mass_kg']:g}" for part in parts) + " kg"
    start = scene["start"]["crank_speed_rad_s"]
    yield "drive", DRIVES[scene["drive"]["kind"]].format(start=start, **scene["drive"])
    for joint, loose in scene["clearance"].items():
        how = "" if loose.get("restitution") is None else f", restitution {loose['restitution']:g}"
        rubs = f", friction {loose['friction']['coefficient']:g}" if "friction" in loose else ""
        yield f"clearance {joint}", f"{loose['radial_clearance_m'] * MM:g} mm, {loose['law']}{how}{rubs}"
    yield "lasts", f"{row['end_time_s'] * MS:g} ms"
    forces = {joint: row[f"joint_{joint}_force_N"] for joint in "OAB" if has(row, f"joint_{joint}_force_N")}
    most = max(forces, key=lambda joint: forces[joint])
    yield "largest force", f"{plain(forces[most])} N in joint {most}"


def _hard(row: pd.Series) -> str:
    """Return in a sentence what a solver has to cope with."""
    if not has(row, "contacts_ended"):
        return (
            f"Smooth: one kind of motion for {plain(row['end_time_s'] * MS)} ms, and constraints that drift."
        )
    count = int(row["contacts_ended"])
    if not row["shortest_contact_s"] > 0:
        return f"{count} impacts that take no time, until bounces converge and the pin slides along its wall."
    part = row["end_time_s"] / row["shortest_contact_s"]
    if part > RESOLVED:
        return f"{count} contacts that end, the shortest within the round-off of its time."
    return (
        f"{count} contacts that end; the shortest lasts {plain(row['shortest_contact_s'] * US)} µs, "
        f"one part in {plain(part)} of the run."
    )


def _figure(results: Results, row: pd.Series, scene: Scene) -> Figure:
    joints, case = joints_with_clearance(row), row["case"]
    moving = "slider_position_m" if "rod" in scene else "crank_angle_rad"
    with mpl.rc_context(RC):
        drawing = Drawing(figsize=(WIDTH_IN, HEIGHT_IN))
        picture, over_time, *rest = drawing.subplots(
            1, 3 if joints else 2, width_ratios=(1.25, 1.25, 1)[: 3 if joints else 2]
        )
        draw_mechanism(picture, scene)
        time, curve = results.curve(case, "time_s") * MS, results.curve(case, moving)
        over_time.plot(*extremes(time, MM * curve if "rod" in scene else curve), color=BLACK, linewidth=1.0)
        over_time.set(xlabel="time [ms]")
        over_time.set_title("slider position [mm]" if "rod" in scene else "crank angle [rad]", fontsize=8)
        for ax in rest:
            _orbits(results, ax, case, joints)
    paths = f", path of the pin in joint {' and '.join(joints)}" if joints else ""
    return Figure(
        f"scene-{scene['name']}",
        scene["name"],
        f"By {row['label']}.",
        f"{scene['name']}: the mechanism, {moving.rsplit('_', 1)[0].replace('_', ' ')} over time{paths}.",
        drawing,
    )


def _orbits(results: Results, ax: Any, case: str, joints: list[str]) -> None:
    """Draw the paths of all pins in one circle: the library's joints have the same clearance in a scene."""
    for joint, colour, dashes in zip(joints, COLOURS[1:], DASHES, strict=False):
        circle(ax, radius_m(results, case, joint))
        x, y = (UM * results.curve(case, f"clearance_{joint}_{axis}_m") for axis in "xy")
        ax.plot(x, y, color=colour, linestyle=dashes, linewidth=0.6, label=joint)
    ax.set_title(f"pin {', '.join(joints)} [µm]", fontsize=8)
    if len(joints) > 1:
        ax.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.2),
            ncols=3,
            fontsize=8,
            handlelength=1.2,
            columnspacing=0.8,
        )

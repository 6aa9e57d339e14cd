"""The picture of a sweep: points over one field, a map over two, or the histogram of an ensemble."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from reports.plots.axes import Scale, scale_of
from reports.plots.maps import draw_basins, draw_map
from reports.plots.picture import Picture
from reports.style import BLACK, BLUE, RC, VERMILLION

EXPONENT, STROBE, PHASE, FORCE = "exponent_1_s", "strobe_m", "impact_phase_rad", "largest_contact_force_N"
#: What is shown over the start: the motion in which a member ends, from the last half of so many turns.
MOTION, FEWEST_TURNS = "motion", 10
#: The most fields that a picture has axes for.
MOST_FIELDS = 2
SPEEDS = ("start.crank_speed_rad_s", "start.speed_rad_s.")
#: The column of mechanisms other than crank-sliders, and how it and others are called there.
OBSERVED = "observed_deviation_m"
NAMES = {STROBE: "deviation once a revolution", PHASE: "phase at impact"}
#: Columns that say which member it is and how it ended.
HEAD = ("member", "direction", "status", "reason")
#: Height of a panel in inches. Up to so many points of a panel are opaque; of more each is fainter.
PANEL_IN, OPAQUE = 2.6, 3000
#: The size of a point by the most points that have it, of more points than that, and in a legend.
POINTS, SMALLEST, KEY = {600: 5.0, OPAQUE: 2.5}, 1.2, 5.0
#: Colours and relative sizes of points: of members, and of chains, so that one shows below the other.
WAYS = {None: (BLACK, 1.0), "up": (BLUE, 1.0), "down": (VERMILLION, 2.0)}
#: Bins of an angle, of 10 degrees each; and the fewest and most of another number.
ROUND, FEWEST, MOST = 36, 5, 60


class NoPicture(ValueError):
    """There is no picture of this; the message says of what there is one."""


def sweep_picture(frame: pd.DataFrame, varied: Sequence[str], title: str, show: str | None = None) -> Picture:
    """Return the picture of a sweep's rows: of a column to ``show``, or of the first choice.

    The first choice of one field is the deviation once a turn, with the exponent if there is one; of
    two fields of the start the basins of attraction, of two others the exponent or the peak force; without a
    field the impacts by crank angle. Chains up and down have a colour each.

    Raises:
        NoPicture: more fields were varied, or the column is none that can be drawn.
    """
    done = frame[frame["status"] == "ok"]
    _require(frame, done, varied, show)
    with mpl.rc_context(RC):
        if len(varied) == 2:
            picture = _draw_two(frame, (varied[0], varied[1]), show)
        elif len(varied) == 1:
            first = [STROBE, *([EXPONENT] if done[EXPONENT].notna().any() else [])]
            picture = draw_over_field(done, varied[0], [show] if show else first)
        else:
            picture = draw_histogram(done, show or PHASE)
        failed = len(frame) - len(done)
        picture.suptitle(f"{title}: {len(frame)} members" + (f", {failed} failed" if failed else ""), size=9)
    return picture


def fewest_turns(varied: Sequence[str], show: str | None) -> int:
    """Return how many whole turns of a member the picture of a column, or the first choice, needs."""
    if show == MOTION or (show is None and len(varied) == MOST_FIELDS and _are_of_start(varied)):
        return FEWEST_TURNS
    return int(show == STROBE or (show is None and len(varied) == 1))


def draw_over_field(rows: pd.DataFrame, field: str, columns: Sequence[str]) -> Picture:
    """Return a panel for each column, one below the other, with a point for each number of each member."""
    picture = Picture(PANEL_IN * len(columns) + 0.9)
    axes = picture.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    across = scale_of(field, rows[field])
    ways = dict(iter(rows.groupby("direction"))) if "direction" in rows else {None: rows}
    for ax, column in zip(axes, columns, strict=True):
        points = rows[[field, column]].explode(column).dropna()
        up, part = _upwards(points, field, column, _name(rows, column)), _is_part(field, column)
        size = next((size for most, size in POINTS.items() if len(points) <= most), SMALLEST)
        for way, members in ways.items():
            own = members[[field, column]].explode(column).dropna()
            colour, larger = WAYS[way]
            ax.plot(
                across.apply(own[field]),
                up.apply(own[column] / own[field] if part else own[column]),
                label=f"members {way}wards" if way else "members",
                linestyle="",
                marker=".",
                markersize=larger * size,
                markeredgewidth=0,
                color=colour,
                alpha=max(0.25, min(1.0, (OPAQUE / max(len(points), 1)) ** 0.5)),
                rasterized=len(points) > OPAQUE,
            )
        ax.set(ylabel=up.label, yscale=up.kind)
        if column.startswith("exponent"):
            ax.axhline(0.0, color=VERMILLION, linewidth=0.8, linestyle="--")
    axes[-1].set(xlabel=across.label, xscale=across.kind)
    if None not in ways:
        explain(picture, [line for line in axes[0].get_lines() if line.get_linestyle() == "None"])
    return picture


def explain(picture: Picture, points: Sequence[Line2D]) -> None:
    """Put a legend of points below a picture, all of a size to be seen however small they are drawn."""
    legend = picture.legend(handles=points, loc="outside lower center", ncols=len(points))
    for handle in legend.legend_handles:
        assert isinstance(handle, Line2D), "points are lines without strokes"
        handle.set(marker="o", markersize=KEY, alpha=1.0)


def draw_histogram(rows: pd.DataFrame, column: str) -> Picture:
    """Return the histogram of a column, per member where members have several numbers."""
    picture = Picture(3.0)
    ax = picture.add_subplot()
    values = rows[column].explode().dropna()
    scale = scale_of(column, values, _name(rows, column))
    numbers, angle = scale.apply(values), column.endswith("phase_rad")
    bins = ROUND if angle else int(np.clip(np.sqrt(len(numbers)), FEWEST, MOST))
    span = (0.0, 360.0) if angle else None
    ax.hist(numbers, bins=bins, range=span, weights=np.full(len(numbers), 1 / len(rows)), color=BLUE)
    if angle:
        ax.set_xticks(range(0, 361, 45))
    ax.set(xlabel=scale.label, ylabel="number in a bin, per member")
    return picture


def _require(frame: pd.DataFrame, done: pd.DataFrame, varied: Sequence[str], show: str | None) -> None:
    """Refuse what cannot be drawn of some members, of which some are ``done``."""
    columns = [column for column in frame if column not in (*HEAD, *varied)]
    columns += [MOTION] * (len(varied) == MOST_FIELDS)
    if show is not None and show not in columns:
        raise NoPicture(f"expected one of {', '.join(columns)}, got {show}")
    if len(varied) > MOST_FIELDS:
        raise NoPicture(f"expected one or two fields with --vary for a picture, got {len(varied)}")
    if done.empty:
        raise NoPicture("expected members that did not fail, got none")
    if (turns := done[STROBE].map(len).min()) < (fewest := fewest_turns(varied, show)):
        raise NoPicture(f"expected members of {fewest} turns for this picture, got {turns}")
    column = show or (FORCE if varied else PHASE)
    if column in done and done[column].explode().isna().all():  # motions are no column
        raise NoPicture(f"expected members with a number in {column}, got none")


def _draw_two(frame: pd.DataFrame, fields: tuple[str, str], show: str | None) -> Picture:
    if show == MOTION or (show is None and _are_of_start(fields)):
        return draw_basins(frame, fields)
    has_exponent = frame[EXPONENT][frame["status"] == "ok"].notna().any()
    column = show or (EXPONENT if has_exponent else FORCE)
    if not pd.api.types.is_numeric_dtype(frame[column]):
        raise NoPicture(f"expected a column with one number a member for a map, got {column}")
    return draw_map(frame, fields, column)


def _are_of_start(fields: Sequence[str]) -> bool:
    return all(field.startswith("start.") and not field.startswith(SPEEDS) for field in fields)


def _name(rows: pd.DataFrame, column: str) -> str | None:
    """Return how a column is called in the rows of another mechanism than a crank-slider."""
    return NAMES.get(column) if OBSERVED in rows else None


def _upwards(points: pd.DataFrame, field: str, column: str, name: str | None) -> Scale:
    """Return how a column is drawn over a field: a length over a clearance in parts of it."""
    if _is_part(field, column):
        name = scale_of(column, points[column] / points[field], name).label.partition(" [")[0]
        return Scale(1.0, f"{name} / clearance", log=False)
    return scale_of(column, points[column], name)


def _is_part(field: str, column: str) -> bool:
    return column.endswith("_m") and field.endswith("radial_clearance_m")

"""Stability: a map of verdicts over the step and the contact's stiffness, with theory's limit.

A cell is a run with a verdict from its trajectory alone. Theory knows the limit omega h of a step h at a
contact's frequency omega.
"""

import math
from collections.abc import Iterator
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from reports.look import BLACK, RC, Picture, listed
from reports.page import MOST, Chapter, Claim, Figure, Part, Table
from reports.results import Studies, with_columns

#: Letter and colour of each verdict, their places the column ``verdict_severity``. Lightness falls with
#: severity, so that greyscale keeps the order; what was refused is no worse than anything, so white.
VERDICTS = {
    "accurate": ("·", "#F3F1E4"),
    "inaccurate": ("I", "#F2C46D"),
    "energy-growing": ("G", "#D27328"),
    "diverged": ("D", "#8A1C1C"),
    "timed out": ("T", "#20122E"),
    "refused": ("R", "#FFFFFF"),
}
LOOKS = [(name, *look) for name, look in VERDICTS.items()]
#: From growth on, but for what was refused, a run is no longer stable; and what one was by its status that
#: could not say so itself.
GROWING, DIVERGED, REFUSED = 2, 3, 5
BY_STATUS = {"timed out": 4, "unsupported": REFUSED}
STIFFNESS, FREQUENCY, LIMIT = "contact_stiffness_N_m1_5", "impact_frequency_rad_s", "limit_frequency_step"
#: Panels in a row, and theory's line, seen on light cells and dark ones.
ACROSS = 3
LINE: dict[str, Any] = {
    "color": BLACK,
    "linewidth": 1.6,
    "path_effects": [withStroke(linewidth=3.4, foreground="white")],
}
#: The numbers of an accurate run, with the columns of their bounds.
BOUNDED = {
    "energy_gain_per_impact": "energy_bound_per_impact",
    "energy_loss_per_impact": "energy_bound_per_impact",
    "constraint_violation_per_clearance": "constraint_bound_per_clearance",
    "position_error_per_clearance": "position_bound_per_clearance",
}
INTRODUCTION = (
    "The map shows where a step is too long for a contact without loss, beside the limit of linear theory. "
    "Each cell is a run of a crank-slider through its first impacts, with a verdict from its trajectory."
)


def parts(studies: Studies) -> Iterator[Part]:
    """Yield whose runs gain energy, what accurate means, checked, the map, and where growth begins."""
    cells = prepared(studies["stability"].rows)
    yield growing(cells)
    yield accurate(cells)
    title = "From which step on are runs unstable?"
    caption = "A cell is a run; dark is bad. Right of the black line a step is beyond theory's limit."
    columns = ["label", STIFFNESS, "step_s", "verdict", "verdict_reason"]
    data = with_columns(cells, *columns)[columns]
    yield Figure("stability-map", title, caption, "stability", draw_map(cells), data)
    yield boundaries(cells)


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the study's rows with every column that is looked for, and ``severity``."""
    rows = with_columns(rows, LIMIT, "method", "verdict_severity")
    by_status = rows["status"].map(BY_STATUS).fillna(DIVERGED)
    return rows.assign(severity=rows["verdict_severity"].fillna(by_status).astype(int))


def growing(cells: pd.DataFrame) -> Claim:
    """Return whose runs never gain energy in the map, and whose do most often."""
    grows = cells["severity"].between(GROWING, REFUSED, inclusive="left")
    of_label = grows.groupby(cells["label"], observed=True)
    part, runs = of_label.mean(), of_label.size()
    calm, worst = list(part.index[part == 0]), part.idxmax()
    never = f"No run of {listed(calm)} gains energy beyond its bound or diverges. " if calm else ""
    text = f"{never}{worst} does so most often: in {{part}} of {{runs}} runs."
    numbers = {"part": (100 * float(part.max()), "%"), "runs": (int(runs[worst]), "")}
    return Claim("energy-growth", text, numbers)


def accurate(cells: pd.DataFrame) -> Claim:
    """Return what the verdict accurate means, checked on every cell that has it."""
    called, bounds = with_columns(cells[cells["severity"] == 0], *BOUNDED), cells.iloc[0]
    # A number that is missing, for it was not finite, is within no bound.
    held = all((called[name] <= bounds[bound]).all() for name, bound in BOUNDED.items())
    text = (
        "{called} of {runs} runs in the map are called accurate: energy is balanced within {energy} of the "
        "first impact's, gaps of ideal joints are within {constraint} of the clearance. The slider is within "
        "{position} of the clearance through {impacts} impacts."
    )
    numbers: dict[str, tuple[Any, ...]] = {"called": (len(called), ""), "runs": (len(cells), "")}
    numbers |= {bound.split("_")[0]: (100 * bounds[bound], "%") for bound in BOUNDED.values()}
    numbers |= {"impacts": (bounds["compared_impacts"], "")}
    return Claim("accurate", text, numbers, held and bool((called["status"] == "ok").all()))


def boundaries(cells: pd.DataFrame) -> Table:
    """Return where growth and divergence begin, as omega h and as multiples of theory's limit.

    That is at the geometric mean of the longest step up to which there is none and the next one, or at the
    shortest step if it is there already. Accurate is the longest step up to which every run is.
    """
    cells = cells.assign(x=cells["step_s"] * cells[FREQUENCY]).sort_values("x")
    lines = []
    for label, of in cells.groupby("label", observed=True):
        rows, limit = [row for _, row in of.groupby(STIFFNESS)], float(of[LIMIT].iloc[0])
        growth = pd.Series([_begins(row, GROWING) for row in rows])
        held = [row["x"][row["severity"].eq(0).cumprod().astype(bool)].max() for row in rows]
        numbers = {"growth from ωh": growth, "growth per theory": growth / limit}
        numbers |= {"divergence from ωh": pd.Series([_begins(row, DIVERGED) for row in rows])}
        numbers |= {"accurate up to ωh": pd.Series(held)}
        line: dict[str, Any] = {"configuration": label, "theory ωh": limit}
        for name, values in numbers.items():
            line |= {name: values.min(), f"{name}{MOST}": values.max()}
        lines.append(line | {"of stiffnesses": f"{growth.count()} of {len(rows)}"})
    title = "Where growth and divergence begin"
    caption = (
        "Least and largest over the stiffnesses, and at how many of these growth was seen. ω is the first "
        "impact's; the limit is of linear theory."
    )
    formats = {"theory ωh": "{:.4f}".format}
    return Table("stability-boundaries", title, caption, "stability", pd.DataFrame(lines), formats)


def _begins(row: pd.DataFrame, worst: int) -> float:
    """Return where a severity, or a worse one, is first met in a row of a map, NaN if it is not."""
    there = row["severity"].between(worst, REFUSED, inclusive="left").to_numpy()
    if not there.any():
        return math.nan
    first = int(there.argmax())
    return math.sqrt(row["x"].iloc[max(first - 1, 0)] * row["x"].iloc[first])


def draw_map(rows: pd.DataFrame) -> Drawing:
    """Return the figure of the map from its cells, a panel for each label among them."""
    configurations = list(rows.groupby("label", observed=True))
    steps, stiffnesses = (np.unique(rows[name]) for name in ("step_s", STIFFNESS))
    colours = ListedColormap([colour for _, _, colour in LOOKS])
    down, every = math.ceil(len(configurations) / ACROSS), 1 + len(steps) // 8
    with mpl.rc_context(RC):
        drawing = Picture(1.95 * down + 0.8)
        for place, (label, of) in enumerate(configurations):
            ax = drawing.add_subplot(down, ACROSS, place + 1)
            grid = of.pivot_table("severity", STIFFNESS, "step_s", aggfunc="last")
            grid = grid.reindex(index=stiffnesses, columns=steps).to_numpy(dtype=float)
            ax.imshow(grid, colours, aspect="auto", origin="lower", vmin=-0.5, vmax=len(LOOKS) - 0.5)
            ax.grid(False)
            for (row, column), severity in np.ndenumerate(grid):
                if not math.isnan(severity):
                    colour = "white" if DIVERGED <= severity < REFUSED else BLACK
                    look: dict[str, Any] = {"ha": "center", "va": "center", "color": colour, "fontsize": 7}
                    ax.text(column, row, LOOKS[int(severity)][1], **look)
            limit, frequency = float(of[LIMIT].iloc[0]), of.groupby(STIFFNESS)[FREQUENCY].last()
            words = "no limit" if of["method"].notna().any() else "shortens steps"
            if not math.isnan(limit):
                words = f"linear limit ωh = {limit:.3g}"
                at = np.log(limit / frequency.reindex(stiffnesses))
                x = np.interp(at, np.log(steps), np.arange(len(steps)), -0.5, len(steps) - 0.5)
                ax.plot(x, np.arange(len(stiffnesses)), **LINE)
            ax.set_title(f"{label}\n{words}", fontsize=8)
            left, bottom = place % ACROSS == 0, place + ACROSS >= len(configurations)
            ax.set_yticks(range(len(stiffnesses)), [f"{of:.1e}" for of in stiffnesses] if left else [])
            told = [f"{of:.0e}" for of in steps[::every]] if bottom else []
            ax.set_xticks(range(0, len(steps), every), told, rotation=45)
            ax.set_ylabel("stiffness [N/m$^{1.5}$]" if left else "", fontsize=8)
            ax.set_xlabel("step, or longest step [s]" if bottom else "")
        looks = [LOOKS[severity] for severity in sorted(rows["severity"].unique())]
        handles: list[Any] = [
            Patch(label=f"{letter}  {name}", facecolor=colour, edgecolor="#595959")
            for name, letter, colour in looks
        ]
        handles.append(Line2D([], [], label="linear limit at the first impact", **LINE))
        drawing.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7.5)
    return drawing


CHAPTER = Chapter("stability", "Stability", ("stability",), INTRODUCTION, parts)

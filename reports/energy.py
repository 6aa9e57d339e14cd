"""The energy study: how well each configuration keeps the energy balance, and how its constraints drift.

The energy-balance error of a run is what bodies and contacts store, less what driver and loads give, plus
what contacts dissipate: zero if exact, positive where the method gains energy. Numerical dissipation is the
rate at which the method loses energy, in W: the negative of the rows' hidden power. The energy in play is the
largest of kinetic energy, change of potential energy, and the works of driver and loads.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports.lines import Line, Panel, against, draw, points, shown_labels
from reports.look import axis_label, labels, line_styles, number, setting
from reports.page import HALF_WIDTH, Chapter, Claim, Figure, Table
from reports.results import Results, Studies, finished, knobs, tolerances, with_columns

#: The column of the largest energy-balance error of a run, as a part of its energy in play.
UNACCOUNTED = "unaccounted_energy_part"
#: Up to this part an energy balance counts as kept: a hundredth of what contacts dissipate, or less.
KEPT = 1e-4
#: How far an exponent of time may be from the whole number that theory gives, and still be that.
EXPONENT = 0.1
#: The configurations of the reference of which theory says how constraints drift.
PLAIN, BAUMGARTE, PROJECTED = "reference (none)", "reference (Baumgarte)", "reference (projection)"
#: The columns that not every row has.
OPTIONAL = (UNACCOUNTED, "dissipated_power_W", "largest_numerical_gain_J", "turns", "energy_in_play_J")
EXPONENTS = ["constraint_violation_exponent", "constraint_speed_exponent"]
POWERS = ("hidden_power_W", "hidden_power_low_W", "hidden_power_high_W")
INTRODUCTION = (
    "The energy-balance error is what energy stored, work of driver and loads, and contact losses, all of an "
    "engine's own motion and forces, do not add up to. Numerical dissipation is the rate of its loss."
)


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with all columns, what resolves a run, and whether its scene has contacts."""
    rows = with_columns(rows, *OPTIONAL, *EXPONENTS, *POWERS, "constraint_violation_m", "compliant_contact")
    loose = rows["dissipated_power_W"].notna().groupby(rows["scene"]).transform("any")
    at = tolerances(rows)
    return rows.assign(knob=knobs(rows), value=at.fillna(rows["step_s"]), contact=loose)


def at_middle(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows at the middle one of their scene's settings, numbered from coarse to fine."""
    rows = prepared(rows)
    numbers = {scene: sorted(of.unique()) for scene, of in rows.groupby("scene")["rung"]}
    middle = {scene: each[len(each) // 2] for scene, each in numbers.items()}
    return rows[rows["rung"] == rows["scene"].map(middle)]


def energy_parts(middle: pd.DataFrame) -> pd.DataFrame:
    """Return the largest energy-balance error of each configuration as a ``part`` of the energy in play.

    It is that of the worst of the ``scenes`` (how many) that it finished; ``on`` says so where others
    finished more. The index is the label, the least part first.
    """
    ran = finished(middle).dropna(subset=UNACCOUNTED)
    table = ran.groupby("label", observed=True).agg(
        solver=("engine", "first"),
        part=(UNACCOUNTED, "max"),
        scenes=("scene", "nunique"),
        fewest_turns=("turns", "min"),
        most_turns=("turns", "max"),
        knob=("knob", "first"),
        finest=("value", "min"),
        coarsest=("value", "max"),
    )
    table.index, every = table.index.astype(str), ran["scene"].nunique()
    table["setting"] = [
        setting(*of) for of in zip(table["knob"], table["finest"], table["coarsest"], strict=True)
    ]
    table["on"] = ["" if of == every else f" ({of} of {every} scenes)" for of in table["scenes"]]
    return table.sort_values("part", kind="stable")


def parts(studies: Studies) -> Iterator[Claim | Figure | Table | None]:
    """Yield who keeps the balance, how constraints drift, where the work goes, and numerical dissipation."""
    results = studies["energy"]
    rows, middle = prepared(results.rows), at_middle(results.rows)
    yield _kept(energy_parts(middle))
    yield from drift(finished(rows[~rows["contact"]]))
    if results.has_curves:
        yield _growth(results, middle)
    panels = against(rows, "largest_numerical_gain_J", orders=(1, 3, 5))
    caption = "The largest error over the run. Grey lines have the slope of the order at their left end."
    title = "How does the energy-balance error fall with the step?"
    yield Figure("energy-steps", title, caption, "energy", draw(panels), points(panels)) if panels else None
    yield dissipation(middle)
    yield _terms(middle)


def _kept(found: pd.DataFrame) -> Claim | None:
    keep = found[found["part"] <= KEPT]
    if keep.empty:
        return None
    text = (
        f"Energy balance within {100 * KEPT:g} % of the energy in play: {', '.join(keep.index + keep['on'])}."
    )
    text += f" The furthest off is {found.index[-1]}: {{part}}."
    return Claim("kept", text, {"part": (100 * found["part"].iloc[-1], "%")})


def drift(rows: pd.DataFrame) -> Iterator[Claim]:
    """Yield, checked, how the reference's constraints drift on ideal joints, by their stabilisation."""
    free, bounded, projected = (rows[rows["label"] == label] for label in (PLAIN, BAUMGARTE, PROJECTED))
    grows, stays = (of[EXPONENTS].dropna() for of in (free, bounded))
    if len(grows):
        off = (grows - [2, 1]).abs().max()
        text = (
            "Without stabilisation the reference's constraints drift as theory predicts for RK4: gap speeds "
            "grow in proportion to time, gaps with its square. The exponents are within {speed} of 1 and "
            "within {gap} of 2."
        )
        numbers = {"gap": (off[EXPONENTS[0]], ""), "speed": (off[EXPONENTS[1]], "")}
        yield Claim("drift", text, numbers, bool((off < EXPONENT).all()))
    if len(stays):
        largest = max(0.0, float(stays.max(axis=None)))
        text = "With Baumgarte's stabilisation exponents of time are at most {exponent}."
        yield Claim("drift-baumgarte", text, {"exponent": (largest, "")}, largest < EXPONENT)
    if len(projected):
        gap = float(projected["constraint_violation_m"].max())
        text = "With projection gaps are round-off, at most {gap}."
        yield Claim("drift-projection", text, {"gap": (gap, "m")}, bool(projected[EXPONENTS[0]].isna().all()))


def _growth(results: Results, middle: pd.DataFrame) -> Figure | None:
    """Return the largest energy-balance error so far over time, a panel for each scene."""
    panels, styles = list[Panel](), line_styles(middle)
    for scene, of_scene in finished(middle).groupby("scene"):
        lines = []
        for row in of_scene[of_scene["label"].isin(shown_labels(of_scene))].itertuples():
            error = results.curve(row.case, "numerical_gain_so_far_J") / row.energy_in_play_J
            style = {**styles[row.label], "markevery": len(error) // 5}
            time_s = results.curve(row.case, "time_s")
            lines.append(Line(str(row.label), time_s, np.where(error > 0, error, np.nan), style))
        panels.append(Panel(str(scene), axis_label("time_s"), "part of the energy in play", lines, log="y"))
    caption = (
        "The largest so far at the middle setting: bounded where a line is flat, a drift where it rises."
    )
    title = "How does the energy-balance error grow over time?"
    drawing = draw(panels, 2.3, 2) if panels else None
    return Figure("energy-growth", title, caption, "energy", drawing, points(panels)) if drawing else None


def dissipation(middle: pd.DataFrame) -> Table | None:
    """Return the numerical dissipation by configuration and scene, of rows at the middle setting."""
    shown = finished(middle)
    if shown.empty:
        return None
    half_W = (shown["hidden_power_high_W"] - shown["hidden_power_low_W"]) / 2
    shown = shown.assign(label=shown["label"].astype(str), watts=-shown["hidden_power_W"], half=half_W)
    wide = shown.pivot_table(["watts", "half"], "label", "scene", aggfunc="first").reindex(
        labels(finished(middle))
    )
    table = pd.DataFrame({"configuration": wide.index})
    for scene in wide["watts"]:
        table[scene], table[f"{scene}{HALF_WIDTH}"] = [*wide["watts"][scene]], [*wide["half"][scene]]
    caption = (
        "At the middle setting of each series. Negative where the method gains energy. ± is half of the 95 % "
        "interval, left out below 1 %; “< x” is not resolved from zero."
    )
    formats = dict.fromkeys(wide["watts"], number)
    return Table("energy-dissipation", "Numerical dissipation in W", caption, "energy", table, formats)


def _terms(middle: pd.DataFrame) -> Table:
    """Return every term of the energy balance at the end of the runs, and how constraints drift."""
    names = [name for name in middle if name.endswith(("_change_J", "_work_J", "_loss_J", "_exponent"))]
    columns = ["scene", "label", "mean_step_s", "turns", UNACCOUNTED, *names, "energy_balance_residual_J"]
    rows = finished(with_columns(middle, "energy_balance_residual_J"))[columns]
    title, caption = "Energy balance and drift at the middle setting", "Residual: changes - works + losses."
    return Table("energy-terms", title, caption, "energy", rows, shown=False)


CHAPTER = Chapter("energy", "Energy", ("energy",), INTRODUCTION, parts)

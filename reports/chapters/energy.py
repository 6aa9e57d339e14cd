"""The energy study: how well each configuration keeps the energy balance, and how its constraints drift.

The energy-balance error of a run is what bodies and contacts store, less what driver and loads give, plus
what contacts dissipate: zero if exact, positive where the method gains energy. Numerical dissipation is the
rate at which the method loses energy, in W: the negative of the rows' hidden power. The energy in play is the
largest of kinetic energy, change of potential energy, and the works of driver and loads.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports.lines import Line, Panel, against, figure_of, shown_labels
from reports.look import axis_label, line_styles, number, setting
from reports.page import HALF_WIDTH, Chapter, Claim, Figure, Table
from reports.results import Results, Studies, finished, knobs, tolerances, with_columns

#: The column of the largest energy-balance error of a run, as a part of its energy in play.
UNACCOUNTED = "unaccounted_energy_part"
#: Up to this part an energy balance counts as kept: a hundredth of what contacts dissipate, or less.
KEPT = 1e-4
#: The exponents of time by which theory has gaps and their speeds grow without stabilisation, and how far one
#: may be from that.
EXPONENTS, WITHIN = {"constraint_violation_exponent": 2, "constraint_speed_exponent": 1}, 0.1
#: The columns that not every row has.
OPTIONAL = [UNACCOUNTED, "dissipated_power_W", "largest_numerical_gain_J", "turns", "energy_in_play_J"]
OPTIONAL += ["constraint_violation_m", "compliant_contact", "energy_balance_residual_J", *EXPONENTS]
OPTIONAL += ["hidden_power_W", "hidden_power_low_W", "hidden_power_high_W"]
INTRODUCTION = (
    "The energy-balance error is what energy stored, work of driver and loads, and contact losses, all of an "
    "engine's own motion and forces, do not add up to. Numerical dissipation is the rate of its loss."
)


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with all columns, what resolves a run, and whether its scene has contacts."""
    rows = with_columns(rows, *OPTIONAL)
    loose = rows["dissipated_power_W"].notna().groupby(rows["scene"]).transform("any")
    return rows.assign(knob=knobs(rows), value=tolerances(rows).fillna(rows["step_s"]), contact=loose)


def at_middle(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows at the middle one of their scene's settings, numbered from coarse to fine."""
    rows = prepared(rows)
    middle = rows.groupby("scene")["rung"].agg(lambda of: sorted(of.unique())[of.nunique() // 2])
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
    settings = zip(table["knob"], table["finest"], table["coarsest"], strict=True)
    table["setting"] = [setting(*of) for of in settings]
    table["on"] = ["" if of == every else f" ({of} of {every} scenes)" for of in table["scenes"]]
    return table.sort_values("part", kind="stable")


def parts(studies: Studies) -> Iterator[Claim | Figure | Table | None]:
    """Yield who keeps the balance, how constraints drift, where the work goes, and numerical dissipation."""
    results = studies["energy"]
    rows, middle = prepared(results.rows), at_middle(results.rows)
    balance = energy_parts(middle)
    keep = balance[balance["part"] <= KEPT].sort_values("scenes", ascending=False, kind="stable")
    if len(keep):
        text = f"Energy balance within {100 * KEPT:g} % of the energy in play: "
        text += f"{', '.join(keep.index + keep['on'])}. The furthest off is {balance.index[-1]}: {{part}}."
        yield Claim("kept", text, {"part": (100 * balance["part"].iloc[-1], "%")})
    yield from drift(finished(rows[~rows["contact"]]))
    if results.has_curves:
        yield _growth(results, finished(middle))
    panels = against(rows, "largest_numerical_gain_J", orders=(1, 3, 5))
    caption = (
        "The largest error over the run, of eight configurations at most. Grey lines have the slope of the "
        "order at their left end."
    )
    title = "How does the energy-balance error fall with the step?"
    yield figure_of("energy-steps", title, caption, "energy", panels)
    yield dissipation(finished(middle))
    yield _terms(finished(middle))


def drift(rows: pd.DataFrame) -> Iterator[Claim]:
    """Yield, checked, how the reference's constraints drift on ideal joints, by their stabilisation."""
    exponents = rows.set_index("label")[[*EXPONENTS]]
    free, bounded = (
        exponents[exponents.index == f"reference ({of})"].dropna() for of in ("none", "Baumgarte")
    )
    if len(free):
        off = (free - pd.Series(EXPONENTS)).abs().max()
        text = (
            "Without stabilisation the reference's constraints drift as theory predicts for RK4: gap speeds "
            "grow in proportion to time, gaps with its square. The exponents are within {speed} of 1 and "
            "within {gap} of 2."
        )
        numbers = {name: (of, "") for name, of in zip(("gap", "speed"), off, strict=True)}
        yield Claim("drift", text, numbers, bool((off < WITHIN).all()))
    if len(bounded):
        largest = max(0.0, float(bounded.max(axis=None)))
        text = "With Baumgarte's stabilisation exponents of time are at most {exponent}."
        yield Claim("drift-baumgarte", text, {"exponent": (largest, "")}, largest < WITHIN)
    if len(projected := rows[rows["label"] == "reference (projection)"]):
        gap = float(projected["constraint_violation_m"].max())
        holds = bool(projected["constraint_violation_exponent"].isna().all())
        text = "With projection gaps are round-off, at most {gap}."
        yield Claim("drift-projection", text, {"gap": (gap, "m")}, holds)


def _growth(results: Results, middle: pd.DataFrame) -> Figure | None:
    """Return the largest energy-balance error so far over time, a panel for each scene."""
    panels, styles = list[Panel](), line_styles(middle)
    for scene, of_scene in middle.groupby("scene"):
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
    return figure_of("energy-growth", title, caption, "energy", panels, 2.3, 2)


def dissipation(middle: pd.DataFrame) -> Table:
    """Return the numerical dissipation by configuration and scene, of rows at the middle setting."""
    columns: dict[str, pd.Series] = {}
    for scene, of in middle.set_index("label").groupby("scene"):
        half_W = (of["hidden_power_high_W"] - of["hidden_power_low_W"]) / 2
        columns |= {str(scene): -of["hidden_power_W"], f"{scene}{HALF_WIDTH}": half_W}
    caption = (
        "At the middle setting of each series, of two the finer. Negative where the method gains energy. ± "
        "is half of the 95 % interval, left out below 1 %; “< x” is not resolved from zero."
    )
    table = pd.DataFrame(columns).sort_index().rename_axis("configuration").reset_index()
    formats = dict.fromkeys(columns, number)
    return Table("energy-dissipation", "Numerical dissipation in W", caption, "energy", table, formats)


def _terms(middle: pd.DataFrame) -> Table:
    """Return every term of the energy balance at the end of the runs, and how constraints drift."""
    names = [name for name in middle if name.endswith(("_change_J", "_work_J", "_loss_J", "_exponent"))]
    columns = ["scene", "label", "mean_step_s", "turns", UNACCOUNTED, *names, "energy_balance_residual_J"]
    title, caption = "Energy balance and drift at the middle setting", "Residual: changes - works + losses."
    return Table("energy-terms", title, caption, "energy", middle[columns], shown=False)


CHAPTER = Chapter("energy", "Energy", ("energy",), INTRODUCTION, parts)

"""Predictability: how fast small changes grow, and what the means of ensembles are beyond the horizon."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from reports.lines import Line, Panel, figure_of
from reports.look import BLACK, BLUE, GREY, VERMILLION, plain
from reports.page import HALF_WIDTH, MOST, Chapter, Claim, Figure, Table
from reports.results import FloatArray, Results, Studies, finished, with_columns
from studies.judges.energy_rates import so_far

STUDY = "predictability"
INTRODUCTION = (
    "Small changes of the start grow in a mechanism with clearance. Up to the predictability horizon runs "
    "are compared at equal times, beyond it as ensembles, whose members start at different crank angles."
)
#: Tolerances of the horizon: the words in the names of columns, and in m.
TOLERANCES = {"1nm": ("1 nm", 1e-9), "1um": ("1 µm", 1e-6), "100um": ("100 µm", 1e-4)}
#: A slider that is off by this much is no longer predicted; runs that stay closer, in m, do not diverge.
FIRST, LOST, TOGETHER_M = "1nm", "100um", 1e-9
#: Nothing closer than this is drawn, in m: it is round-off.
LEAST_M = 1e-14
#: The averages of a member whose means are given, in words, and the factors to the units there.
QUANTITIES = {
    "impacts_per_revolution": ("impacts per revolution", 1.0),
    "impact_speed_m_s": ("impact speed [m/s]", 1.0),
    "impulse_per_revolution_N_s": ("impulse per revolution [N·s]", 1.0),
    "dissipated_energy_per_revolution_J": ("dissipated per revolution [J]", 1.0),
    "flight_part": ("fraction of time in free flight", 1.0),
    "rms_slider_deviation_m": ("slider deviation from ideal [mm]", 1e3),
    "largest_contact_force_N": ("largest contact force [kN]", 1e-3),
}
#: Confidence of an interval of a mean.
CONFIDENCE = 0.95


def parts(studies: Studies) -> Iterator[Claim | Figure | Table | None]:
    """Yield how soon a small change matters, how it grows, and the means of ensembles."""
    results = studies[STUDY]
    rows = with_columns(results.rows, "member", "perturbation_rad", *QUANTITIES)
    followed = horizons(rows)
    if len(followed):
        yield horizon(rows)
        yield _together(followed)
        if results.has_curves:
            panels = [_growth(results, row) for _, row in followed.iterrows()]
            title = "How fast does a small change of the start grow?"
            caption = (
                "Distance of the slider from the unperturbed run, the largest up to each time. Diamonds mark "
                "the horizons of 1 nm, 1 µm and 100 µm."
            )
            yield figure_of(f"{STUDY}-growth", title, caption, STUDY, panels, 2.4)
        yield _horizon_table(followed)
    members = finished(rows[rows["member"].notna()])
    yield _means(members)


def horizons(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the finished row of each scene that was followed the longest, with every horizon's column."""
    kinds = ("{}", "{}_least", "{}_largest", "halved_{}")
    columns = [f"horizon_{kind.format(tolerance)}_s" for tolerance in TOLERANCES for kind in kinds]
    rows = with_columns(finished(rows[rows["part"] == "horizon"]), "revolutions", *columns)
    longest = rows.sort_values("end_time_s", ascending=False, kind="stable").drop_duplicates("scene")
    return longest.sort_values("scene").fillna({"revolutions": 0.0})


def horizon(rows: pd.DataFrame) -> Claim:
    """Return how soon a small change matters, on the scene where it does first and where it does last.

    That is after how many crank revolutions it has the slider off by ``LOST``, in the median of the changes.
    Scenes without revolutions, or on which nothing grows that far, do not count.
    """
    rows = horizons(rows)
    ends = [f"horizon_{LOST}{end}_s" for end in ("", "_least", "_largest")]
    turns = rows[ends].mul(rows["revolutions"], axis=0).div(rows["end_time_s"], axis=0)
    turns = turns.set_axis(rows["scene"]).query(f"{ends[0]} > 0").sort_values(ends[0])
    moved = {"moved": (float(rows["perturbation_rad"].iloc[0]), "rad")}
    change = "{moved} change of the initial crank angle"
    if turns.empty:
        return Claim("horizon", f"No {change} grows to {TOLERANCES[LOST][0]} before the runs end.", moved)
    first, last = ((median, "", least, largest) for median, least, largest in turns.iloc[[0, -1]].to_numpy())
    text = (
        f"A {change} grows to {TOLERANCES[LOST][0]} in {{first}} revolutions on {turns.index[0]}, in the "
        f"median of the changes, and in {{last}} on {turns.index[-1]}, the longest; beyond that compare "
        "statistics only."
    )
    return Claim("horizon", text, {**moved, "first": first, "last": last})


def _together(rows: pd.DataFrame) -> Claim | None:
    """Return, checked, on which scenes no change ever grows."""
    together = rows[rows.filter(regex="^horizon_").isna().all(axis=1)]
    if together.empty:
        return None
    largest = together[["largest_distance_perturbed_m", "largest_distance_halved_m"]].max(axis=None)
    text = f"No distance exceeds {{largest}} on {', '.join(together['scene'])}."
    return Claim("together", text, {"largest": (largest, "m")}, bool(largest < TOGETHER_M))


def _growth(results: Results, row: pd.Series) -> Panel:
    """Return how far perturbed runs on a scene are from the unperturbed one."""
    turns = row["revolutions"]
    unit_s = row["end_time_s"] / turns if turns > 0 else 1.0
    names = [f"perturbed_{k}_m" for k in range(int(row["perturbations"]))]
    each = np.array([so_far(results.curve(row["case"], name)) for name in names])
    drawn: list[tuple[str, FloatArray, dict[str, Any]]] = [
        ("perturbed start (median)", np.median(each, axis=0), {"color": BLACK}),
        ("perturbed start (smallest)", each.min(axis=0), {"color": GREY, "linewidth": 0.7}),
        ("perturbed start (largest)", each.max(axis=0), {"color": GREY, "linestyle": ":"}),
        ("half the step", so_far(results.curve(row["case"], "halved_m")), {"color": BLUE, "linestyle": "--"}),
    ]
    time = results.curve(row["case"], "time_s") / unit_s
    lines = [Line(name, time, np.maximum(of, LEAST_M), style) for name, of, style in drawn]
    marker = {"color": VERMILLION, "marker": "D", "markersize": 4, "linestyle": ""}
    for words, (tolerance, size_m) in TOLERANCES.items():
        if not np.isnan(median_s := row[f"horizon_{words}_s"]):
            lines.append(Line("horizon (median)", [median_s / unit_s], [size_m], marker, [tolerance]))
    x = "crank revolutions" if turns > 0 else "time [s]"
    return Panel(str(row["scene"]), x, "largest distance so far [m]", lines, log="y")


def _horizon_table(rows: pd.DataFrame) -> Table:
    table = rows[["scene", "revolutions"]].copy()
    for words, (tolerance, _) in TOLERANCES.items():
        names = {"{}": ": median [ms]", "{}_least": ": perturbed [ms]"}
        names |= {"{}_largest": f": perturbed [ms]{MOST}", "halved_{}": ": step halved [ms]"}
        for kind, heading in names.items():
            table[f"{tolerance}{heading}"] = 1e3 * rows[f"horizon_{kind.format(words)}_s"]
    folds = math.log(TOLERANCES[LOST][1] / TOLERANCES[FIRST][1])
    apart_s = rows[f"horizon_{LOST}_s"] - rows[f"horizon_{FIRST}_s"]
    rates = folds * rows["end_time_s"] / (rows["revolutions"] * apart_s)
    table["growth per revolution"] = rates.where((rates > 0) & (rates < np.inf))
    caption = (
        "Time at which the slider deviates by a tolerance: median over perturbed starts, first and last of "
        "them, and with half the step. A dash: not before the run ends. Growth: the mean increase of the "
        "natural logarithm of the deviation between the horizons of 1 nm and 100 µm."
    )
    formats = dict.fromkeys((name for name in table if name.endswith("[ms]")), partial(plain, digits=3))
    return Table(f"{STUDY}-horizons", "Predictability horizons", caption, STUDY, table, formats)


def mean_of(values: pd.Series) -> tuple[float, float]:
    """Return the mean of independent values and half of its 95 % interval, NaN of fewer than two."""
    known = values.dropna()
    t = stdtrit(len(known) - 1, 0.5 + CONFIDENCE / 2)
    return float(known.mean()), float(t * known.std(ddof=1) / math.sqrt(max(len(known), 1)))


def _means(members: pd.DataFrame) -> Table:
    """Return the means of the ensembles."""
    lines = []
    for (scene, part), of in members.groupby(["scene", "part"]):
        line: dict[str, Any] = {"scene": scene, "ensemble": part, "members": len(of)}
        for name, (words, factor) in QUANTITIES.items():
            line[words], line[f"{words}{HALF_WIDTH}"] = mean_of(factor * of[name])
        lines.append(line)
    formats = {words: "{:.3g}".format for words, _ in QUANTITIES.values()}
    caption = "Means over members and half of Student's 95 % interval."
    return Table(f"{STUDY}-means", "Means of ensembles", caption, STUDY, pd.DataFrame(lines), formats)


CHAPTER = Chapter(STUDY, "Predictability", (STUDY,), INTRODUCTION, parts)

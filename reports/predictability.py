"""Predictability: how fast small changes grow, and what the means of ensembles are beyond the horizon."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from reports.lines import Line, Panel, draw, points, so_far
from reports.look import BLACK, BLUE, GREY, VERMILLION
from reports.page import HALF_WIDTH, MOST, Chapter, Claim, Figure, Table
from reports.results import FloatArray, Results, Studies, finished, with_columns

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
        yield _horizon(followed)
        yield _together(followed)
    if results.has_curves and len(followed):
        panels = [_growth(results, row) for _, row in followed.iterrows()]
        title = "How fast does a small change of the start grow?"
        caption = (
            "Distance of the slider from the unperturbed run, the largest up to each time. Diamonds mark the "
            "horizons of 1 nm, 1 µm and 100 µm."
        )
        yield Figure(f"{STUDY}-growth", title, caption, STUDY, draw(panels, 2.4), points(panels))
    yield _horizon_table(followed) if len(followed) else None
    members = finished(rows[rows["member"].notna()])
    yield from _first_means(members)
    yield _means(members)


def horizons(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the finished row of each scene that was followed the longest, with every horizon's column."""
    kinds = ("{}", "{}_least", "{}_largest", "halved_{}")
    columns = [f"horizon_{kind.format(tolerance)}_s" for tolerance in TOLERANCES for kind in kinds]
    rows = with_columns(finished(rows[rows["part"] == "horizon"]), "revolutions", *columns)
    longest = rows.sort_values("end_time_s", ascending=False, kind="stable").drop_duplicates("scene")
    return longest.sort_values("scene").fillna({"revolutions": 0.0})


def horizon_turns(rows: pd.DataFrame) -> dict[str, float]:
    """Return by scene after how many crank revolutions a small change has the slider off by ``LOST``.

    The shortest is first. Scenes without revolutions, or on which nothing grows that far, are left out.
    """
    rows = horizons(rows)
    turns = (rows[f"horizon_{LOST}_s"] * rows["revolutions"] / rows["end_time_s"]).set_axis(rows["scene"])
    return {str(scene): float(count) for scene, count in turns[turns > 0].sort_values().items()}


def _horizon(rows: pd.DataFrame) -> Claim | None:
    """Return how soon a small change matters, on the scene where it does first and where it does last."""
    turns = horizon_turns(rows)
    moved = {"moved": (float(rows["perturbation_rad"].iloc[0]), "rad")}
    change = "{moved} change of the initial crank angle"
    if not turns:
        return Claim("horizon", f"No {change} grows to {TOLERANCES[LOST][0]} before the runs end.", moved)
    numbers = {
        scene: (count, "", *_ends(rows.set_index("scene").loc[scene])) for scene, count in turns.items()
    }
    first, last = next(iter(turns)), next(reversed(turns))
    text = (
        f"A {change} grows to {TOLERANCES[LOST][0]} in {{first}} revolutions on {first}, in the median of "
        f"the changes, and in {{last}} on {last}, the longest; beyond that compare statistics only."
    )
    return Claim("horizon", text, {**moved, "first": numbers[first], "last": numbers[last]})


def _ends(row: pd.Series) -> tuple[float, float]:
    """Return a scene's horizon in revolutions of the first and the last of its perturbed runs."""
    ends = row[[f"horizon_{LOST}_{end}_s" for end in ("least", "largest")]]
    low, high = ends * row["revolutions"] / row["end_time_s"]
    return float(low), float(high)


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
    time, curve = results.curve(row["case"], "time_s") / unit_s, partial(results.curve, row["case"])
    each = np.array([so_far(curve(f"perturbed_{k}_m")) for k in range(int(row["perturbations"]))])
    curves: list[tuple[str, FloatArray, dict[str, Any]]] = [
        ("perturbed start (median)", np.median(each, axis=0), {"color": BLACK}),
        ("perturbed start (smallest)", each.min(axis=0), {"color": GREY, "linewidth": 0.7}),
        ("perturbed start (largest)", each.max(axis=0), {"color": GREY, "linestyle": ":"}),
        ("half the step", so_far(curve("halved_m")), {"color": BLUE, "linestyle": "--"}),
    ]
    lines = [Line(name, time, np.maximum(of, LEAST_M), style) for name, of, style in curves]
    marker = {"color": VERMILLION, "marker": "D", "markersize": 4, "linestyle": ""}
    for words, (tolerance, size_m) in TOLERANCES.items():
        if not np.isnan(median_s := row[f"horizon_{words}_s"]):
            lines.append(Line("horizon (median)", [median_s / unit_s], [size_m], marker, [tolerance]))
    x = "crank revolutions" if turns > 0 else "time [s]"
    return Panel(str(row["scene"]), x, "largest distance so far [m]", lines, log="y")


def _horizon_table(rows: pd.DataFrame) -> Table:
    table = pd.DataFrame({"scene": rows["scene"], "revolutions": rows["revolutions"]})
    for words, (tolerance, _) in TOLERANCES.items():
        perturbed, halved = f"{tolerance}: perturbed [ms]", f"{tolerance}: step halved [ms]"
        table[f"{tolerance}: median [ms]"] = 1e3 * rows[f"horizon_{words}_s"]
        table[perturbed] = 1e3 * rows[f"horizon_{words}_least_s"]
        table[f"{perturbed}{MOST}"] = 1e3 * rows[f"horizon_{words}_largest_s"]
        table[halved] = 1e3 * rows[f"horizon_halved_{words}_s"]
    apart_s = rows[f"horizon_{LOST}_s"] - rows[f"horizon_{FIRST}_s"]
    folds = math.log(TOLERANCES[LOST][1] / TOLERANCES[FIRST][1])
    rates = folds * rows["end_time_s"] / (rows["revolutions"] * apart_s)
    table["growth per revolution"] = rates.where((rates > 0) & (rates < np.inf))
    caption = (
        "Time at which the slider deviates by a tolerance: median over perturbed starts, first and last of "
        "them, and with half the step. A dash: not before the run ends. Growth: the mean increase of the "
        "natural logarithm of the deviation between the horizons of 1 nm and 100 µm."
    )
    formats = dict.fromkeys((name for name in table if name.endswith("[ms]")), "{:.3g}".format)
    return Table(f"{STUDY}-horizons", "Predictability horizons", caption, STUDY, table, formats)


def mean_of(values: pd.Series) -> tuple[float, float]:
    """Return the mean of independent values and half of its 95 % interval, NaN of fewer than two."""
    known = values.dropna().to_numpy(float)
    if len(known) < 2:
        return float(known.mean()) if len(known) else math.nan, math.nan
    t = stats.t.ppf(0.5 + CONFIDENCE / 2, len(known) - 1)
    return float(known.mean()), float(t * known.std(ddof=1) / math.sqrt(len(known)))


def _first_means(members: pd.DataFrame) -> Iterator[Claim]:
    """Yield how often and how fast pins hit their bearings in the first ensemble of each scene."""
    for scene, of in members.groupby("scene"):
        first = of[of["part"] == of["part"].iloc[0]]
        text = (
            f"Over {{members}} starts on {scene}, {first['part'].iloc[0]} has {{hits}} impacts per "
            "revolution at {speed}, in the mean."
        )
        hits, speed = (mean_of(first[name]) for name in ("impacts_per_revolution", "impact_speed_m_s"))
        numbers: dict[str, tuple[Any, ...]] = {"members": (len(first), "")}
        numbers |= {"hits": (hits[0], "", hits[0] - hits[1], hits[0] + hits[1])}
        numbers |= {"speed": (speed[0], "m/s", speed[0] - speed[1], speed[0] + speed[1])}
        yield Claim(f"ensemble-{scene}", text, numbers)


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

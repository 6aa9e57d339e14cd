"""Predictability: how fast small changes grow, and what the means of ensembles are beyond the horizon."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from scipy import stats

from reports.parts import Chapter, Figure, Finding, Number, Studies, Table
from reports.plots.panels import Line, Panel, draw, so_far
from reports.quantities import finished
from reports.results import FloatArray, Results, with_columns
from reports.shared_tables import reliability, runs_tables
from reports.style import BLACK, BLUE, GREY, RC, VERMILLION, in_legend_order
from reports.tables import ABSENT, listed

STUDY, HORIZON = "predictability", "horizon"
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


def horizons(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the finished row of each scene that was followed the longest, with every horizon's column."""
    kinds = ("{}", "{}_least", "{}_largest", "halved_{}")
    columns = [f"horizon_{kind.format(tolerance)}_s" for tolerance in TOLERANCES for kind in kinds]
    rows = with_columns(finished(rows[rows["part"] == HORIZON]), "revolutions", *columns)
    longest = rows.sort_values("end_time_s", ascending=False, kind="stable").drop_duplicates("scene")
    return longest.sort_values("scene").fillna({"revolutions": 0.0})


def horizon_turns(rows: pd.DataFrame) -> dict[str, float]:
    """Return by scene after how many crank revolutions a small change has the slider off by ``LOST``.

    The shortest is first. Scenes without revolutions, or on which nothing grows that far, are left out.
    """
    rows = horizons(rows)
    turns = (rows[f"horizon_{LOST}_s"] * rows["revolutions"] / rows["end_time_s"]).set_axis(rows["scene"])
    return {str(scene): float(count) for scene, count in turns[turns > 0].sort_values().items()}


def _horizon_finding(rows: pd.DataFrame) -> Finding | None:
    """Return how soon a small change matters, and where it never grows."""
    turns, rows = horizon_turns(rows), horizons(rows).set_index("scene", drop=False)
    if rows.empty:
        return None
    tolerance, values = TOLERANCES[LOST][0], {"moved": Number(rows["perturbation_rad"].iloc[0], "rad")}
    text = f"No {{moved}} change of the initial crank angle grows to {tolerance} before the runs end"
    if turns:
        first, *_, last = (*turns, *turns)
        text = (
            "A {moved} change of the initial crank angle grows to "
            f"{tolerance} in {{first}} revolutions on {first}, in the median of the changes"
        )
        values["first"] = _turns(rows.loc[first], turns[first])
        if last != first:
            text += f", and in {{last}} on {last}, the longest of {len(turns)} scenes"
            values["last"] = _turns(rows.loc[last], turns[last])
        text += "; beyond that compare statistics only"
    together = rows[rows.filter(regex="^horizon_").isna().all(axis=1)]
    if together.empty:
        return Finding("horizon", f"{text}.", **values)
    largest = together[["largest_distance_perturbed_m", "largest_distance_halved_m"]].max(axis=None)
    values["largest"] = Number(largest, "m")
    text += f". No distance exceeds {{largest}} on {listed(together['scene'])}"
    return Finding("horizon", f"{text}.", **values).require(largest < TOGETHER_M)


def _turns(row: pd.Series, turns: float) -> Number:
    """Return a scene's horizon in revolutions, with the first and the last of its perturbed runs."""
    ends = row[[f"horizon_{LOST}_{end}_s" for end in ("least", "largest")]]
    ends = ends * row["revolutions"] / row["end_time_s"]
    low, high = (None if np.isnan(end) else float(end) for end in ends)
    return Number(turns, "", None if low is None else min(low, turns), high)


def _growth(results: Results, row: pd.Series) -> Panel:
    """Return how far perturbed runs on a scene are from the unperturbed one."""
    turns = row["revolutions"]
    unit_s = row["end_time_s"] / turns if turns > 0 else 1.0
    time, curve = results.curve(row["case"], "time_s") / unit_s, partial(results.curve, row["case"])
    each = np.array([so_far(curve(f"perturbed_{k}_m")) for k in range(int(row["perturbations"]))])
    curves: dict[str, tuple[FloatArray, dict[str, Any]]] = {
        "perturbed start (median)": (np.median(each, axis=0), {"color": BLACK}),
        "perturbed start (smallest)": (each.min(axis=0), {"color": GREY, "linewidth": 0.7}),
        "perturbed start (largest)": (each.max(axis=0), {"color": GREY, "linestyle": ":"}),
        "half the step": (so_far(curve("halved_m")), {"color": BLUE, "linestyle": "--"}),
    }
    lines = [Line(name, time, np.maximum(of, LEAST_M), style) for name, (of, style) in curves.items()]
    marker = {"color": VERMILLION, "marker": "D", "markersize": 4, "linestyle": ""}
    for words, (tolerance, size_m) in TOLERANCES.items():
        if not np.isnan(median_s := row[f"horizon_{words}_s"]):
            lines.append(Line("horizon (median)", [median_s / unit_s], [size_m], marker, [tolerance]))
    x = "crank revolutions" if turns > 0 else "time [s]"
    return Panel(str(row["scene"]), x, "largest distance so far [m]", lines, log="y")


def _horizon_table(rows: pd.DataFrame) -> Table:
    turns = rows["revolutions"].map("{:.0f} revolutions".format)
    cells = {
        "scene": rows["scene"],
        "length of the run": turns.where(rows["revolutions"] > 0, rows["end_time_s"].map("{:g} s".format)),
    }
    for words, (tolerance, _) in TOLERANCES.items():
        median, least, most = (
            rows[f"horizon_{words}{end}_s"].map(_milliseconds) for end in ("", "_least", "_largest")
        )
        text = median + " (" + least + " to " + most.where(most != ABSENT, "later") + ")"
        cells[f"{tolerance}: perturbed [ms]"] = text.where(least != ABSENT, ABSENT)
        cells[f"{tolerance}: step halved [ms]"] = rows[f"horizon_halved_{words}_s"].map(_milliseconds)
    apart_s = rows[f"horizon_{LOST}_s"] - rows[f"horizon_{FIRST}_s"]
    folds = math.log(TOLERANCES[LOST][1] / TOLERANCES[FIRST][1])
    rates = folds * rows["end_time_s"] / (rows["revolutions"] * apart_s)
    cells["growth per revolution"] = rates.map(lambda rate: f"{rate:.2g}" if 0 < rate < np.inf else ABSENT)
    reading = (
        "Time at which the slider deviates by a tolerance: median, first and last over perturbed starts, "
        "and with half the step. A dash: not before the run ends. Growth: the mean increase of the natural "
        "logarithm of the deviation between the horizons of 1 nm and 100 µm."
    )
    return Table.of(f"{STUDY}-horizons", "Predictability horizons", reading, STUDY, cells)


def _milliseconds(time_s: float) -> str:
    return ABSENT if np.isnan(time_s) else f"{float(f'{1e3 * time_s:.3g}'):g}"


# Ensembles


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with labels: of members the ensemble, of all others the engine and the part."""
    rows = with_columns(rows, "member", *QUANTITIES)
    label = rows["part"].where(rows["member"].notna(), rows["engine"] + " (" + rows["part"] + ")")
    rows = rows.assign(arm=rows["part"], label=label)
    return rows.assign(label=in_legend_order(rows))


def mean_of(values: pd.Series, unit: str = "") -> Number:
    """Return the mean of independent values with Student's 95 % interval, which fewer than two have not."""
    known = values.dropna().to_numpy(float)
    if len(known) < 2:
        return Number(float(known.mean()) if len(known) else math.nan, unit)
    mean, t = float(known.mean()), stats.t.ppf(0.5 + CONFIDENCE / 2, len(known) - 1)
    half = float(t * known.std(ddof=1) / math.sqrt(len(known)))
    return Number(mean, unit, mean - half, mean + half)


def _ensembles(rows: pd.DataFrame) -> Iterator[tuple[str, dict[str, pd.DataFrame]]]:
    """Yield the finished members of each label, by scene."""
    for scene, members in finished(rows[rows["member"].notna()]).groupby("scene"):
        yield str(scene), dict(iter(members.groupby("label", observed=True)))


def _ensemble_findings(rows: pd.DataFrame) -> Iterator[Finding]:
    """Yield how often and how fast pins hit their bearings in the first ensemble of each scene."""
    for scene, by_label in _ensembles(rows):
        label, members = next(iter(by_label.items()))
        text = f"Over {{members}} starts on {scene}, {label} has {{hits}} impacts per revolution at {{speed}}"
        hits, speed = mean_of(members["impacts_per_revolution"]), mean_of(members["impact_speed_m_s"], "m/s")
        count = Number(float(len(members)))
        yield Finding(f"ensemble-{scene}", f"{text}, in the mean.", members=count, hits=hits, speed=speed)


def _means_table(scene: str, by_label: dict[str, pd.DataFrame]) -> Table:
    cells = {"ensemble": [*by_label], "members": [str(len(members)) for members in by_label.values()]}
    for name, (words, factor) in QUANTITIES.items():
        cells[words] = [_with_half_width(mean_of(factor * members[name])) for members in by_label.values()]
    reading = "Means over members and half of Student's 95 % interval."
    return Table.of(f"{STUDY}-means-{scene}", f"Means of ensembles on {scene}", reading, STUDY, cells)


def _with_half_width(mean: Number) -> str:
    if mean.low is None or mean.high is None:
        return ABSENT if math.isnan(mean.value) else f"{mean.value:.3g}"
    return f"{mean.value:.3g} ± {(mean.high - mean.low) / 2:.1g}"


# The chapter


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield what the study found."""
    rows = prepared(studies[STUDY].rows)
    if (horizon := _horizon_finding(rows)) is not None:
        yield horizon
    yield from _ensemble_findings(rows)
    yield reliability(rows)


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield the growth of small changes, where the study has its curves."""
    results = studies[STUDY]
    if results.has_curves and len(followed := horizons(prepared(results.rows))):
        with mpl.rc_context(RC):
            yield Figure(
                f"{STUDY}-growth",
                "How fast does a small change of the start grow?",
                "Distance of the slider from the unperturbed run, the largest up to each time. Diamonds mark "
                "the horizons of 1 nm, 1 µm and 100 µm.",
                STUDY,
                draw([_growth(results, row) for _, row in followed.iterrows()], height_in=2.3),
            )


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield horizons, the means of ensembles on each scene, settings and failures."""
    rows = prepared(studies[STUDY].rows)
    if len(followed := horizons(rows)):
        yield _horizon_table(followed).on_page()
    for scene, by_label in _ensembles(rows):
        yield _means_table(scene, by_label).on_page()
    yield from runs_tables(rows, STUDY)


CHAPTER = Chapter(STUDY, "Predictability", (STUDY,), INTRODUCTION, findings, figures, tables)

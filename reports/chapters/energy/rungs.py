"""Rows of the energy study: which are shown, how to name their steps, what is told from zero."""

from collections.abc import Mapping

import pandas as pd

from reports.quantities import knobs, tolerances
from reports.results import with_columns
from reports.tables import setting

#: The ends of names of scenes whose runs are longer than those under the plain name.
LONG, LASTING = "-long", "-turns"
#: Where an energy is told as a part, it is of that in play (see ``mechanics.energy.unaccounted_part``).
UNACCOUNTED, IN_PLAY = "unaccounted_energy_part", "energy_in_play_J"
#: An interval is small that is this part of the power which would take that by the end. Contacts dissipate a
#: hundredth of it, or more.
SMALL = 1e-4
#: A run that gains or loses more than this part shows no order of convergence.
FAR_OFF = 0.01


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with what the chapter asks of them.

    ``tolerance`` is that of a method that chooses its steps, NaN of others, and ``knob`` what resolves a run
    (see ``quantities.knobs``); ``half_width`` half of the confidence interval of the hidden power in W, and
    ``significant`` whether that leaves zero out;
    ``uncertain_part`` is half of the interval as a part of what it has to be small against (see ``SMALL``),
    and ``near`` whether no more than ``FAR_OFF`` was ever gained or lost;
    ``has_clearance`` whether the scene has contacts, which dissipate.
    """
    rows = with_columns(
        rows,
        *("hidden_power_W", "hidden_power_low_W", "hidden_power_high_W", "mean_hidden_power_W"),
        *("dissipated_power_W", "stabilisation_power_W", IN_PLAY, UNACCOUNTED, "driver_work_J"),
        *("largest_numerical_gain_J", "energy_balance_residual_J"),
        *("constraint_violation_m", "constraint_violation_exponent"),
        *("constraint_speed_m_s", "constraint_speed_exponent"),
    )
    half_width = (rows["hidden_power_high_W"] - rows["hidden_power_low_W"]) / 2
    return rows.assign(
        tolerance=tolerances(rows),
        knob=knobs(rows),
        half_width=half_width,
        uncertain_part=half_width * rows["end_time_s"] / rows[IN_PLAY],
        near=rows[UNACCOUNTED] <= FAR_OFF,
        significant=rows["hidden_power_W"].abs() > half_width,
        has_clearance=rows["dissipated_power_W"].notna(),
    )


def middle_rungs(rows: pd.DataFrame) -> dict[str, float]:
    """Return the middle one of each scene's rungs: steps or tolerances numbered from coarse to fine."""
    rungs = rows.groupby("scene")["rung"].unique()
    return {scene: sorted(each)[len(each) // 2] for scene, each in rungs.items()}


def longest(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of scenes that have no longer ones beside them."""
    return rows[~(rows["scene"] + LONG).isin(rows["scene"])]


def at_rungs(rows: pd.DataFrame, rungs: Mapping[str, float]) -> pd.DataFrame:
    """Return the rows at their scene's rung."""
    return rows[rows["rung"] == rows["scene"].map(rungs)]


def resolution(rows: pd.DataFrame) -> str:
    """Return in words the step that engines take on a rung, and the tolerance of those that choose it."""
    least = rows["tolerance"].fillna(rows["step_s"]).groupby(rows["knob"]).min()
    least = least.reindex(["step", "step_tolerance", "rtol"]).dropna()
    return " or ".join(setting(str(knob), value) for knob, value in least.items())

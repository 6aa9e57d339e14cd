"""The predictability study's rows by part: horizons, exponents, ensembles, pictures."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from reports.quantities import finished
from reports.results import FloatArray, with_columns
from reports.style import in_legend_order

#: The parts that are no ensembles, as the study names them.
HORIZON, EXPONENT = "horizon", "Lyapunov exponent"
CLEARANCES, SPEEDS = "against clearance", "against crank speed"
NO_ENSEMBLES = (HORIZON, EXPONENT, CLEARANCES, SPEEDS)
#: The reference's ensembles of a scene's own law; the first has the engines' starts.
OWN = ("reference (scene's law)", "reference (other starts)", "reference (half the step)")
#: How the labels of its ensembles of another engine's law begin; that engine's label follows.
TWIN_OF = "reference (twin of "
PER_REVOLUTION = "lyapunov_exponent_per_revolution"

#: Tolerances in the names of columns, and in m.
TOLERANCES = {"1nm": ("1 nm", 1e-9), "1um": ("1 µm", 1e-6), "100um": ("100 µm", 1e-4)}
#: What is compared of a member, with the words and the unit for it, ...
QUANTITIES = {
    "impact_speed_m_s": "impact speed [m/s]",
    "impacts_per_revolution": "impacts per revolution",
    "impulse_per_revolution_N_s": "impulse per revolution [N·s]",
    "dissipated_energy_per_revolution_J": "dissipated per revolution [J]",
    "free_flight_fraction": "fraction of time in free flight",
    "slider_deviation_m": "slider deviation from ideal [mm]",
    "impact_phase_cosine": "mean cosine of impact phase",
    "impact_phase_sine": "mean sine of impact phase",
}
#: ... the factor to that unit, and those whose differences are no parts of a mean that may be zero.
FACTORS = {"slider_deviation_m": 1e3}
ABSOLUTE = ("impact_phase_cosine", "impact_phase_sine")

#: The members of each label on one scene, in the order of legends.
Ensembles = dict[str, pd.DataFrame]


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows labelled by their part, with every column that the chapter looks for.

    Labels are in the order of legends.
    """
    plain = rows["part"].isin(NO_ENSEMBLES)
    label = rows["part"].where(~plain, rows["engine"] + " (" + rows["part"] + ")")
    rows = rows.assign(arm=rows["part"], label=label)
    rows = rows.assign(label=in_legend_order(rows))
    kinds = ("{}", "{}_least", "{}_largest", "halved_{}")
    horizons = [f"horizon_{kind.format(tolerance)}_s" for tolerance in TOLERANCES for kind in kinds]
    return with_columns(
        rows,
        *("start_moved_rad", "revolutions", "radial_clearance_m", "crank_speed_rad_s", PER_REVOLUTION),
        *QUANTITIES,
        *horizons,
    )


def horizons(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the finished row of each scene that followed it the longest."""
    rows = finished(rows[rows["part"] == HORIZON])
    longest = rows.sort_values("end_time_s", ascending=False, kind="stable").drop_duplicates("scene")
    return longest.sort_values("scene")


def exponents(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the finished starts of each scene."""
    return dict(iter(finished(rows[rows["part"] == EXPONENT]).groupby("scene")))


def measured(starts: pd.DataFrame) -> FloatArray:
    """Return the exponents per revolution of the starts that have one, (n,)."""
    return np.asarray(starts[PER_REVOLUTION].dropna())


def ensembles(rows: pd.DataFrame) -> dict[str, Ensembles]:
    """Return the finished members of each label on each scene, in the order of their starts.

    That order decides which members a resample picks, so it must not depend on keys of cases.
    """
    members = finished(rows[~rows["part"].isin(NO_ENSEMBLES)])
    members = members.sort_values("start_moved_rad", kind="stable")
    return {
        scene: dict(iter(of_scene.groupby("label", observed=True)))
        for scene, of_scene in members.groupby("scene")
    }


def compared(by_label: Ensembles) -> list[tuple[str, str]]:
    """Return the labels of every ensemble and of its model twin's; the reference's own repeats have none.

    The twin's has other starts than the engine's, so that the two are independent from the beginning.
    """
    pairs = []
    for label in by_label:
        twin = next((twin for twin in (f"{TWIN_OF}{label})", OWN[1]) if twin in by_label), None)
        if twin and label not in OWN and not label.startswith(TWIN_OF):
            pairs.append((label, twin))
    return pairs


def shown(by_label: Ensembles) -> list[str]:
    """Return the quantities that every member of a scene has."""
    return [name for name in QUANTITIES if all(members[name].notna().all() for members in by_label.values())]


def matrix(members: pd.DataFrame, quantities: Sequence[str]) -> FloatArray:
    """Return the quantities of members in the units of their words, (n, k)."""
    factors = [FACTORS.get(name, 1.0) for name in quantities]
    return np.ascontiguousarray(members[list(quantities)].to_numpy() * factors)


def points(rows: pd.DataFrame, part: str) -> pd.DataFrame:
    """Return the finished points of a picture, by clearance and speed."""
    return finished(rows[rows["part"] == part]).sort_values(["radial_clearance_m", "crank_speed_rad_s"])

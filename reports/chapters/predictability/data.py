"""The predictability study's rows by part: horizons, exponents, ensembles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from reports.chapters.predictability import basins, chains, diagrams
from reports.chapters.predictability.statistics import Margins
from reports.quantities import finished
from reports.results import FloatArray, with_columns
from reports.style import in_legend_order

#: The parts that are no ensembles, as the study names them.
HORIZON, EXPONENT = "horizon", "Lyapunov exponent"
NO_ENSEMBLES = (HORIZON, EXPONENT, *diagrams.FIELDS, chains.PART, basins.PART)
#: The reference's ensembles of a scene as it is: the one that others are compared with, and another draw.
OWN = ("reference (DOP853)", "reference (other starts)")
#: The one that has to differ: from it is seen that the tests are not blind.
PLANTED = "reference (a tenth less clearance)"
#: How the labels of its ensembles of another engine's law begin; that engine's label follows.
TWIN_OF = "reference (twin of "
PER_REVOLUTION = "lyapunov_exponent_per_revolution"
#: The ends of the names of columns of exponents, and the part of a run that each is from.
PARTS = {"_quarter": "a quarter", "_half": "half", "": "all"}

#: Tolerances in the names of columns, and in m.
TOLERANCES = {"1nm": ("1 nm", 1e-9), "1um": ("1 µm", 1e-6), "100um": ("100 µm", 1e-4)}
#: What is compared of a member, with the words and the unit for it, ...
QUANTITIES = {
    "impact_speed_m_s": "impact speed [m/s]",
    "impacts_per_revolution": "impacts per revolution",
    "impulse_per_revolution_N_s": "impulse per revolution [N·s]",
    "dissipated_energy_per_revolution_J": "dissipated per revolution [J]",
    "flight_part": "fraction of time in free flight",
    "rms_slider_deviation_m": "slider deviation from ideal [mm]",
    "impact_phase_cosine": "mean cosine of impact phase",
    "impact_phase_sine": "mean sine of impact phase",
}
#: ... the factor to that unit, ...
FACTORS = {"rms_slider_deviation_m": 1e3}
#: ... and by how much means may differ and still count as equivalent: by a part of the mean, or, for the
#: phases, by so much. They are fixed here, before any run, at no more than what is never known of a joint: on
#: set R a clearance that is off by a tenth or a restitution that is off by 0.05 was seen to change the
#: slider's deviation by up to 11 %, losses by 16, impacts by 71, their speed by 16, and the impulse by 0.6.
PARTS_OF_MEAN = {
    "impact_speed_m_s": 0.05,
    "impacts_per_revolution": 0.1,
    "impulse_per_revolution_N_s": 0.005,
    "dissipated_energy_per_revolution_J": 0.1,
    "flight_part": 0.1,
    "rms_slider_deviation_m": 0.05,
}
SHIFTS = {"impact_phase_cosine": 0.1, "impact_phase_sine": 0.1}
#: Of fewer members nothing is tested: they hardly tell how eight quantities scatter together.
FEWEST = 20

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
        *("member", "revolutions", "settled", "columns", "in_case"),
        *(PER_REVOLUTION + part for part in PARTS),
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


def measured(starts: pd.DataFrame, part: str = "") -> FloatArray:
    """Return the exponents per revolution of the starts that have one, (n,), from a part of their runs."""
    return np.asarray(starts[PER_REVOLUTION + part].dropna())


def ensembles(rows: pd.DataFrame) -> dict[str, Ensembles]:
    """Return the finished members of each label on each scene, in the order in which they were drawn."""
    members = finished(rows[~rows["part"].isin(NO_ENSEMBLES)]).sort_values("member", kind="stable")
    return {
        scene: dict(iter(of_scene.groupby("label", observed=True)))
        for scene, of_scene in members.groupby("scene")
    }


@dataclass(frozen=True)
class Pair:
    """Two ensembles, (n, k) each, of n members and k quantities: that of ``label`` and its twin's."""

    label: str
    twin: str
    one: FloatArray
    other: FloatArray


def pairs(by_label: Ensembles) -> list[Pair]:
    """Return every ensemble beside its model twin's, or the reference's of the scene as it is.

    The larger of two is cut to the size of the smaller. Of too few members there is no pair.
    """
    quantities, found = shown(by_label), []
    for label in by_label if quantities else ():
        twin = f"{TWIN_OF}{label})"
        twin = twin if twin in by_label else OWN[0]
        if label == OWN[0] or label.startswith(TWIN_OF) or twin not in by_label:
            continue
        one, other = (matrix(by_label[each], quantities) for each in (label, twin))
        size = min(len(one), len(other))
        if size >= FEWEST:
            found.append(Pair(label, twin, one[:size], other[:size]))
    return found


def pool(by_label: Ensembles) -> FloatArray:
    """Return the reference's members of a scene as it is, (n, k)."""
    return np.concatenate([matrix(by_label[label], shown(by_label)) for label in OWN if label in by_label])


def margins(quantities: Sequence[str]) -> Margins:
    """Return the margins of equivalence of quantities, in the units of their words."""
    part, shift = (np.array([of.get(name, 0.0) for name in quantities]) for of in (PARTS_OF_MEAN, SHIFTS))
    return Margins(part, shift)


def shown(by_label: Ensembles) -> list[str]:
    """Return the quantities that every member of a scene has and in which those of no ensemble are alike."""
    return [
        name
        for name in QUANTITIES
        if all(of[name].notna().all() and (len(of) == 1 or np.ptp(of[name]) > 0) for of in by_label.values())
    ]


def matrix(members: pd.DataFrame, quantities: Sequence[str]) -> FloatArray:
    """Return the quantities of members in the units of their words, (n, k)."""
    factors = [FACTORS.get(name, 1.0) for name in quantities]
    return np.ascontiguousarray(members[list(quantities)].to_numpy() * factors)

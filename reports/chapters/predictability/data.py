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
#: phases, by so much. ``WHY_MARGINS`` says why.
PARTS_OF_MEAN = {
    "impact_speed_m_s": 0.05,
    "impacts_per_revolution": 0.1,
    "impulse_per_revolution_N_s": 0.005,
    "dissipated_energy_per_revolution_J": 0.1,
    "flight_part": 0.1,
    "rms_slider_deviation_m": 0.05,
}
SHIFTS = {"impact_phase_cosine": 0.1, "impact_phase_sine": 0.1}
#: Why the margins are what they are; they were fixed before any engine ran.
WHY_MARGINS = (
    "A margin is no more than what nobody knows of a joint does to the mean: on set R with 0.5 mm a "
    "clearance that is off by a tenth, or a restitution by 0.05, changes impacts and flight by up to 80 %, "
    "impact speed and losses by 16, the slider's deviation by 11, the impulse by 0.5, and the phase's mean "
    "cosine and sine by 0.2."
)
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
    """The members of two ensembles: those of ``label``, and those of its ``twin``."""

    label: str
    twin: str
    members: pd.DataFrame
    of_twin: pd.DataFrame

    @property
    def sizes(self) -> tuple[int, int]:
        """How many members each has."""
        return len(self.members), len(self.of_twin)


def pairs(by_label: Ensembles) -> list[Pair]:
    """Return every ensemble beside its model twin's, or all of the reference's of the scene as it is.

    These are two, of which the second is held against the first. Of too few members there is no pair, nor
    where no other mechanism is there from which is seen what the tests find.
    """
    known, found = PLANTED in by_label and OWN[0] in by_label, []
    for label, members in by_label.items() if known and shown(by_label) else ():
        twin = f"{TWIN_OF}{label})"
        of_twin = by_label.get(twin, by_label[OWN[0]] if label == OWN[1] else control(by_label))
        if label == OWN[0] or label.startswith(TWIN_OF) or min(len(members), len(of_twin)) < FEWEST:
            continue
        found.append(Pair(label, twin if twin in by_label else OWN[0], members, of_twin))
    return found


def control(by_label: Ensembles) -> pd.DataFrame:
    """Return all of the reference's members of a scene as it is."""
    return pd.concat([by_label[label] for label in OWN if label in by_label])


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

"""The predictability study's rows by part: horizons, exponents, ensembles, pictures."""

from collections.abc import Sequence

import numpy as np

from reports.results import FloatArray, Run
from reports.style import Name, ordered

#: The arms that are no ensembles, as the study names them.
HORIZON, EXPONENT = "horizon", "Lyapunov exponent"
CLEARANCES, SPEEDS = "against clearance", "against crank speed"
#: The reference's ensembles of a scene's own law; the first has the engines' starts.
OWN = ("scene's law", "other starts", "half the step")
REFERENCE = "reference"
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


def horizons(runs: Sequence[Run]) -> list[Run]:
    """Return the finished run of each scene that followed it the longest."""
    longest: dict[str, Run] = {}
    for run in runs:
        if run.ok and run.arm == HORIZON:
            known = longest.get(run.scene)
            if known is None or run.values["end_time_s"] > known.values["end_time_s"]:
                longest[run.scene] = run
    return [longest[scene] for scene in sorted(longest)]


def exponents(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Return the finished starts of each scene."""
    found = [run for run in runs if run.ok and run.arm == EXPONENT]
    return {scene: [run for run in found if run.scene == scene] for scene in sorted({r.scene for r in found})}


def measured(starts: Sequence[Run]) -> FloatArray:
    """Return the exponents per revolution of the starts that have one, (n,)."""
    return np.array([run.values[PER_REVOLUTION] for run in starts if PER_REVOLUTION in run.values])


Ensembles = dict[Name, list[Run]]


def ensembles(runs: Sequence[Run]) -> dict[str, Ensembles]:
    """Return the finished members of each engine and arm on each scene, in the order of their starts.

    That order decides which members a resample picks, so it must not depend on keys of cases.
    """
    members = [run for run in runs if run.ok and run.arm not in (HORIZON, EXPONENT, CLEARANCES, SPEEDS)]
    members.sort(key=lambda run: run.values["start_moved_rad"])
    return {
        scene: {
            name: [run for run in members if (run.scene, run.name) == (scene, name)]
            for name in ordered(run.name for run in members if run.scene == scene)
        }
        for scene in sorted({run.scene for run in members})
    }


def twin_of(name: Name, found: Ensembles) -> Name | None:
    """Return the ensemble of an engine's model twin, None if there is none.

    It has other starts than the engine's, so that the two are independent from the beginning.
    """
    own, same_law = (REFERENCE, f"twin of {name[0]} ({name[1]})"), (REFERENCE, OWN[1])
    return next((twin for twin in (own, same_law) if twin in found), None)


def compared(found: Ensembles) -> list[tuple[Name, Name]]:
    """Return every arm's ensemble with that of its model twin; the reference's own repeats are no arms."""
    arms = [(engine, arm) for engine, arm in found if engine != REFERENCE or not _own(arm)]
    pairs = [(name, twin_of(name, found)) for name in arms]
    return [(name, twin) for name, twin in pairs if twin is not None]


def _own(arm: str) -> bool:
    return arm in OWN or arm.startswith("twin of ")


def shown(found: Ensembles) -> list[str]:
    """Return the quantities that every member of a scene has."""
    members = [run for runs in found.values() for run in runs]
    return [name for name in QUANTITIES if all(name in run.values for run in members)]


def matrix(members: Sequence[Run], quantities: Sequence[str]) -> FloatArray:
    """Return the quantities of members in the units of their words, (n, k)."""
    return np.array([[run.values[name] * FACTORS.get(name, 1.0) for name in quantities] for run in members])


def points(runs: Sequence[Run], arm: str) -> list[Run]:
    """Return the finished points of a picture, by clearance and speed."""
    found = [run for run in runs if run.ok and run.arm == arm]
    return sorted(found, key=lambda r: (r.values["radial_clearance_m"], r.values["crank_speed_rad_s"]))

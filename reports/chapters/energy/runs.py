"""Runs of the energy study: which are shown, how to name their steps, what is told from zero."""

from collections.abc import Mapping, Sequence

from reports.quantities import column
from reports.results import Run
from reports.style import ordered
from reports.tables import in_text

#: The end of a scene's name whose runs are longer than those under the plain name.
LONG = "-long"
POWER, MEAN_POWER, LARGEST_ENERGY = "hidden_power_W", "mean_hidden_power_W", "largest_kinetic_energy_J"
DISSIPATED, STABILISED = "dissipated_power_W", "stabilisation_power_W"
GAIN, GAP, OPENING = (
    column(name) for name in ("largest_numerical_gain_J", "constraint_violation_m", "constraint_speed_m_s")
)


def middle_rungs(runs: Sequence[Run]) -> dict[str, float]:
    """Return the middle one of each scene's rungs: steps or tolerances numbered from coarse to fine."""
    rungs: dict[str, set[float]] = {}
    for run in runs:
        rungs.setdefault(run.scene, set()).add(run.values["rung"])
    return {scene: sorted(found)[len(found) // 2] for scene, found in sorted(rungs.items())}


def longest(runs: Sequence[Run]) -> list[Run]:
    """Return the runs of scenes that have no longer ones beside them."""
    scenes = {run.scene for run in runs}
    return [run for run in runs if run.scene + LONG not in scenes]


def at_rung(runs: Sequence[Run], rungs: Mapping[str, float]) -> list[Run]:
    """Return the runs at their scene's rung, in the order of legends."""
    names = ordered(run.name for run in runs)
    here = [run for run in runs if rungs.get(run.scene) == run.values["rung"]]
    return sorted(here, key=lambda run: (run.scene, names.index(run.name)))


def resolution(runs: Sequence[Run], scene: str, rung: float) -> str:
    """Return in words the step that the engines take on a rung, and the tolerance of those that choose it."""
    here = at_rung([run for run in runs if run.scene == scene], {scene: rung})
    steps, tolerances = (
        {float(value) for run in here if (value := of(run)) is not None} for of in (_fixed_step, tolerance)
    )
    told = [f"a step of {in_text(min(steps))} s"] if steps else []
    told += [f"a tolerance of {in_text(min(tolerances))}"] if tolerances else []
    return " or ".join(told)


def half_width(run: Run) -> float:
    """Return half of the confidence interval of the hidden power in W."""
    return (run.values["hidden_power_high_W"] - run.values["hidden_power_low_W"]) / 2


def has_clearance(run: Run) -> bool:
    """Whether the run's scene has contacts, which dissipate."""
    return DISSIPATED in run.values


def is_told(run: Run) -> bool:
    """Whether the interval of the hidden power leaves zero out."""
    return abs(run.values[POWER]) > half_width(run)


def tolerance(run: Run) -> float | None:
    """Return the tolerance of a method that chooses its steps."""
    return next((run.settings[name] for name in ("rtol", "tolerance") if name in run.settings), None)


def _fixed_step(run: Run) -> float | None:
    return run.step_s if tolerance(run) is None else None

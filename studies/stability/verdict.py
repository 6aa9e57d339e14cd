"""The verdict on a run: from its trajectory alone, by stated bounds, against the converged solution."""

import numpy as np

from engine_models.engine import Trajectory
from engine_models.scene.scene import Scene
from studies.judges.comparison import checked
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, finite
from studies.running.case import Row

ACCURATE, INACCURATE, GROWING, DIVERGED = "accurate", "inaccurate", "energy-growing", "diverged"
TIMED_OUT, REFUSED = "timed out", "refused"
#: The verdicts; their places are the column ``verdict_severity``.
VERDICTS = (ACCURATE, INACCURATE, GROWING, DIVERGED, TIMED_OUT, REFUSED)

#: Bounds of what is accurate: the slider's position error and the gap of ideal joints as parts of the radial
#: clearance, the energy balance residual as a part of the first impact's energy. A residual above that bound
#: is growth, one as far below zero a loss.
POSITION_BOUND, VIOLATION_BOUND, ENERGY_BOUND = 0.01, 0.01, 0.05
#: Positions are compared up to the end of so many impacts: without losses every impact makes errors some
#: twice as large, and twenty of them tell who was lucky. Energy and gaps are judged to the end.
COMPARED_IMPACTS = 5
#: Bounds of what is still the mechanism: a residual of so many first impacts, a gap of so many clearances;
#: and the check that every run has to pass.
DIVERGED_ENERGY, DIVERGED_VIOLATION = 10.0, 1.0

ERROR, VIOLATION = "position_error_per_clearance", "constraint_violation_per_clearance"
GAIN, LOSS = "energy_gain_per_impact", "energy_loss_per_impact"
#: What the rows say of the bounds.
BOUNDS: Row = {
    "position_bound_per_clearance": POSITION_BOUND,
    "constraint_bound_per_clearance": VIOLATION_BOUND,
    "energy_bound_per_impact": ENERGY_BOUND,
    "compared_impacts": COMPARED_IMPACTS,
}


def measured(scene: Scene, run: Trajectory, truth: Trajectory, until: int, impact_energy_J: float) -> Row:
    """Return the verdict on a finished run, its reason, the check's columns and the four numbers besides.

    ``truth`` is the converged solution of the law that the engine solves, to be compared with before the
    sample ``until``. A number that is not finite is None in the row.
    """
    clearance = scene.clearance.B
    assert clearance is not None
    c = clearance.radial_clearance_m
    with np.errstate(all="ignore"):  # the verdict is what is said of an overflow
        residual = energy_balance_residual_J(scene, run) / impact_energy_J
        violation = constraint_violation_m(scene, run) / c
        error = np.abs(run.slider_position_m - truth.slider_position_m)[:until] / c
    numbers = {
        ERROR: float(error.max()),
        VIOLATION: float(violation.max()),
        GAIN: float(residual.max()),
        LOSS: float(-residual.min()),
    }
    check = checked(scene, run)
    shown: Row = {name: value if np.isfinite(value) else None for name, value in numbers.items()}
    return judged(*verdict_of(numbers, finite(run), str(check["quality_failure"]))) | shown | check


def verdict_of(numbers: dict[str, float], all_finite: bool = True, failure: str = "") -> tuple[str, str]:
    """Return the verdict on a finished run and its reason, by the numbers of ``measured`` and the check's."""
    gain, loss, gap, error = numbers[GAIN], numbers[LOSS], numbers[VIOLATION], numbers[ERROR]
    if not all_finite or not all(np.isfinite(value) for value in numbers.values()):
        return DIVERGED, "not all numbers are finite"
    if failure:
        return DIVERGED, failure
    if max(gain, loss) > DIVERGED_ENERGY:
        return DIVERGED, f"energy off by that of {max(gain, loss):.2g} impacts"
    if gap > DIVERGED_VIOLATION:
        return DIVERGED, f"an ideal joint open by {gap:.2g} clearances"
    if gain > ENERGY_BOUND:
        return GROWING, f"{gain:.2g} of an impact's energy gained"
    if loss > ENERGY_BOUND:
        return INACCURATE, f"{loss:.2g} of an impact's energy lost"
    if gap > VIOLATION_BOUND:
        return INACCURATE, f"an ideal joint open by {gap:.2g} clearances"
    if error > POSITION_BOUND:
        return INACCURATE, f"slider off by {error:.2g} clearances"
    return ACCURATE, ""


def before_chaos(truth: Trajectory) -> int:
    """Return how many samples come before the impact of slider and rod past those that are compared."""
    touches = truth.contacts["B"].impacts.time_s
    if len(touches) <= COMPARED_IMPACTS:
        return len(truth.time_s)
    return int(np.searchsorted(truth.time_s, touches[COMPARED_IMPACTS]))


def judged(verdict: str, reason: str) -> Row:
    """Return a verdict's columns."""
    return {"verdict": verdict, "verdict_severity": VERDICTS.index(verdict), "verdict_reason": reason}

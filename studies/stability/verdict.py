"""The verdict on a run: from its trajectory alone, by stated bounds, against the converged solution."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np

from engine_models.engine import Trajectory
from engine_models.mechanics.states import observed_m
from engine_models.scene.scene import Scene
from studies.judges.metrics import checked, constraint_violation_m, energy_balance_residual_J, finite
from studies.running.case import Row

ACCURATE, INACCURATE, GROWING, DIVERGED = "accurate", "inaccurate", "energy-growing", "diverged"
TIMED_OUT, REFUSED = "timed out", "refused"
#: The verdicts; their places are the column ``verdict_severity``.
VERDICTS = (ACCURATE, INACCURATE, GROWING, DIVERGED, TIMED_OUT, REFUSED)


@dataclass(frozen=True)
class Bounds:
    """What is accurate: position and ideal joints in parts of the clearance, energy in first impacts.

    ``position`` bounds the slider's error and ``constraint`` the gap of ideal joints: a hundredth of the
    clearance is a line's width in a picture of the pin's path. ``energy`` bounds the energy balance residual
    in parts of the first impact's energy: above it is growth, as far below zero a loss. Its twentieth is what
    laws of one restitution differ by (at 0.9 those of Lankarani-Nikravesh and Gonthier by 7 %). Positions are
    compared up to the end of so many ``impacts``: without losses every impact makes errors some twice as
    large, and twenty of them tell who was lucky. Energy and gaps are judged to the end.
    """

    position: float = 0.01
    constraint: float = 0.01
    energy: float = 0.05
    impacts: int = 5

    def otherwise(self) -> Iterator[tuple[str, "Bounds"]]:
        """Yield every bound halved and doubled, the others as they are, by a name for a column."""
        for name, value in asdict(self).items():
            for how, other in (("halved", value / 2), ("doubled", value * 2)):
                yield f"{name}_{how}", replace(self, **{name: type(value)(other)})


BOUNDS = Bounds()
#: Bounds of what is still the mechanism: a residual of so many first impacts, a gap of so many clearances.
DIVERGED_ENERGY, DIVERGED_VIOLATION = 10.0, 1.0

ERROR, VIOLATION = "position_error_per_clearance", "constraint_violation_per_clearance"
GAIN, LOSS = "energy_gain_per_impact", "energy_loss_per_impact"
#: What the rows say of the bounds.
BOUND_COLUMNS: Row = {
    "position_bound_per_clearance": BOUNDS.position,
    "constraint_bound_per_clearance": BOUNDS.constraint,
    "energy_bound_per_impact": BOUNDS.energy,
    "compared_impacts": BOUNDS.impacts,
}


def measured(scene: Scene, run: Trajectory, truth: Trajectory, agreed: int, impact_energy_J: float) -> Row:
    """Return the verdict on a finished run, its reason, the check's columns and the numbers besides.

    ``truth`` is the converged solution of the law that the engine solves, to be compared with before the
    sample ``agreed``, and no longer than for the impacts that count. The numbers are errors and residuals at
    their worst, and the position's error through half and twice as many impacts. One that is not finite is
    None in the row. ``severity_if_energy_halved`` and so on are what the verdict's would be by other bounds.
    """
    clearance = scene.clearance.B
    assert clearance is not None
    c = clearance.radial_clearance_m
    with np.errstate(all="ignore"):  # the verdict is what is said of an overflow
        residual = energy_balance_residual_J(scene, run) / impact_energy_J
        violation = constraint_violation_m(scene, run) / c
        error = np.abs(observed_m(scene, run) - observed_m(scene, truth)) / c
    check = checked(scene, run)

    def numbers(bounds: Bounds) -> dict[str, float]:
        return {
            ERROR: float(error[: min(agreed, before_chaos(truth, bounds.impacts))].max()),
            VIOLATION: float(violation.max()),
            GAIN: float(residual.max()),
            LOSS: float(-residual.min()),
        }

    def verdict(bounds: Bounds) -> tuple[str, str]:
        return verdict_of(numbers(bounds), finite(run), str(check["quality_failure"]), bounds)

    shown = numbers(BOUNDS)
    for name, bounds in BOUNDS.otherwise():
        if bounds.impacts != BOUNDS.impacts:
            shown[f"{ERROR}_{name}"] = numbers(bounds)[ERROR]
    until = min(agreed, before_chaos(truth, BOUNDS.impacts))
    return {
        "compared_until_s": float(truth.time_s[until - 1]),
        **judged(*verdict(BOUNDS)),
        **{name: value if np.isfinite(value) else None for name, value in shown.items()},
        **{f"severity_if_{name}": VERDICTS.index(verdict(bounds)[0]) for name, bounds in BOUNDS.otherwise()},
        **check,
    }


def verdict_of(
    numbers: dict[str, float], all_finite: bool = True, failure: str = "", bounds: Bounds = BOUNDS
) -> tuple[str, str]:
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
    if gain > bounds.energy:
        return GROWING, f"{gain:.2g} of an impact's energy gained"
    if loss > bounds.energy:
        return INACCURATE, f"{loss:.2g} of an impact's energy lost"
    if gap > bounds.constraint:
        return INACCURATE, f"an ideal joint open by {gap:.2g} clearances"
    if error > bounds.position:
        return INACCURATE, f"slider off by {error:.2g} clearances"
    return ACCURATE, ""


def before_chaos(truth: Trajectory, impacts: int) -> int:
    """Return how many samples come before the impact of slider and rod past so many."""
    touches = truth.contacts["B"].impacts.time_s
    if len(touches) <= impacts:
        return len(truth.time_s)
    return int(np.searchsorted(truth.time_s, touches[impacts]))


def judged(verdict: str, reason: str) -> Row:
    """Return a verdict's columns."""
    return {"verdict": verdict, "verdict_severity": VERDICTS.index(verdict), "verdict_reason": reason}

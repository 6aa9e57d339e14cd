"""Stability: where each solver stops being trustworthy, as a map, beside the limits of linear theory.

The map is of set R with a lossless Hertz contact at the rod-slider pin, over the step and the contact's
stiffness, from the start through the first impacts. One case is one cell. Left out are maps over clearance
and speed, since theory knows one parameter; and of the two that run DOP853 in the quick set SciPy.

A contact near a state is a mass on a spring, y'' + omega^2 y = 0. A method of fixed step h takes it from one
step to the next by a matrix that depends on omega h alone; beyond a limit the motion grows.
"""

import math
from collections.abc import Mapping

import numpy as np

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.mechanics.energy import exponent_of, stiffness_of
from engine_models.mechanics.states import observed_m
from engine_models.scene.format import Clearance
from engine_models.scene.library import BEARING_RADIUS_M, clearance, ideal_driven
from engine_models.scene.scene import Scene
from studies.case import Case, Curves, Row, ended
from studies.judges.converged_truth import converged, followed
from studies.judges.metrics import checked, constraint_violation_m, energy_balance_residual_J, finite

RK4, EULER, TRAPEZOIDAL, ALPHA = "RK4", "semi-implicit Euler", "trapezoidal", "generalized-alpha"
#: The omega h from which on a method's undamped motion grows; others have no limit.
LIMIT: Mapping[str, float] = {RK4: 2 * math.sqrt(2), EULER: 2.0}
#: Every arm, and the method whose fixed step acts on the contact: None where there is no such step.
ARMS: tuple[tuple[Arm, str | None], ...] = (
    (arms.LOCATED, None),
    (arms.PLAIN, RK4),
    (arms.REFERENCE_DOP853, None),
    (arms.TRAPEZOIDAL, TRAPEZOIDAL),
    (arms.GENERALIZED_ALPHA, ALPHA),
    (arms.RK44, RK4),
    (arms.DOPRI5, None),
    (arms.AS_THE_SCENE, EULER),
    (arms.SCIPY_DOP853, None),
)
#: What a cell may take. A kernel's compilation counts.
LIMIT_S = 120.0

END_S, SAMPLES = 0.002, 20
#: Steps per sample of the maps: 1e-4 s to 1e-6 s, and to 2e-7 s in the full set.
COARSE = (1, 5, 10, 50, 100)
FINE = (1, 2, 3, 5, 7, 10, 14, 20, 30, 50, 70, 100, 140, 200, 300, 500)
CLEARANCE_M = 5e-4
#: Parts of the stiffness of steel, and what the full set adds.
STIFFNESS_FACTORS, MORE_FACTORS = (1.0, 100.0, 1000.0), (0.1, 0.3, 3.0, 10.0, 30.0, 300.0)

ACCURATE, INACCURATE, GROWING, DIVERGED = "accurate", "inaccurate", "energy-growing", "diverged"
REFUSED = "refused"
#: The verdicts; their places are the column ``verdict_severity``.
VERDICTS = (ACCURATE, INACCURATE, GROWING, DIVERGED, "timed out", REFUSED)
#: What is accurate: the slider's error and the gaps of ideal joints in parts of the clearance, whose
#: hundredth is a line's width in a picture of the pin's path; the energy balance residual in parts of the
#: first impact's energy. Above that bound it is growth, as far below zero a loss. Its twentieth is what laws
#: of one restitution differ by (at 0.9 those of Lankarani-Nikravesh and Gonthier by 7 %). Positions are
#: compared up to the end of so many impacts: without losses every impact makes errors some twice as large,
#: and twenty of them tell who was lucky. Energy and gaps are judged to the end.
POSITION_BOUND, CONSTRAINT_BOUND, ENERGY_BOUND, COMPARED_IMPACTS = 0.01, 0.01, 0.05, 5
#: Bounds of what is still the mechanism: a residual of so many first impacts, a gap of so many clearances.
DIVERGED_ENERGY, DIVERGED_VIOLATION = 10.0, 1.0

ERROR, VIOLATION = "position_error_per_clearance", "constraint_violation_per_clearance"
GAIN, LOSS = "energy_gain_per_impact", "energy_loss_per_impact"
#: What the rows say of the bounds.
BOUND_COLUMNS: Row = {
    "position_bound_per_clearance": POSITION_BOUND,
    "constraint_bound_per_clearance": CONSTRAINT_BOUND,
    "energy_bound_per_impact": ENERGY_BOUND,
    "compared_impacts": COMPARED_IMPACTS,
}


def cases(full: bool) -> list[Case]:
    """Return the cells of the map, a scene's after one another."""
    out = []
    steel = stiffness_of(clearance(CLEARANCE_M))
    for factor in sorted(STIFFNESS_FACTORS + (MORE_FACTORS if full else ())):
        scene = _scene(factor, factor * steel)
        energy, frequency = first_impact(scene)
        for arm, method in (*ARMS, *((arm, None) for arm in arms.newcomers())):
            columns: Row = {
                "contact_stiffness_N_m1_5": factor * steel,
                "method": method,
                "impact_energy_J": energy,
                "impact_frequency_rad_s": frequency,
                "limit_frequency_step": LIMIT.get(method or ""),
                **BOUND_COLUMNS,
            }
            if arm is arms.SCIPY_DOP853 and not full:
                continue
            for count in FINE if full else COARSE:
                run = RunSettings(scene.end_time_s / (SAMPLES * count), SAMPLES)
                out.append(Case("stability", scene, arm, run, limit_s=LIMIT_S, columns=columns))
    return out


def _scene(factor: float, stiffness: float) -> Scene:
    """Return set R with a lossless Hertz contact of given stiffness."""
    at_slider = Clearance(
        radial_clearance_m=CLEARANCE_M, bearing_radius_m=BEARING_RADIUS_M, law="hertz", stiffness=stiffness
    )
    changes = {"name": f"stability-stiffness-{factor:g}", "end_time_s": END_S}
    return ideal_driven().model_copy(update={**changes, "clearance": {"B": at_slider}})


def first_impact(scene: Scene) -> tuple[float, float]:
    """Return energy in J and frequency in rad/s at the bottom of the first impact of slider and rod.

    The crank turns at constant speed w from 0 with clearance c at B alone: the rod draws away from the
    slider, of mass m, with a0 = r w^2 (1 + r/L), so that the slider falls through c and the penetration
    delta: m a0 (c + delta) = K delta^(n+1)/(n+1), its frequency then sqrt(n K delta^(n-1)/m).
    """
    crank, rod, slider = scene.short.crank, scene.short.rod, scene.short.slider
    assert rod is not None
    assert slider is not None
    at_slider = scene.clearance["B"]
    n, stiffness, m = exponent_of(at_slider), stiffness_of(at_slider), slider.mass_kg
    a0 = crank.length_m * scene.start.speed_rad_s["crank"] ** 2 * (1 + crank.length_m / rod.length_m)
    delta = 0.0
    for _ in range(60):  # contracts: the right side grows by less than delta does
        energy = m * a0 * (at_slider.radial_clearance_m + delta)
        delta = ((n + 1) * energy / stiffness) ** (1 / (n + 1))
    return energy, math.sqrt(n * stiffness * delta ** (n - 1) / m)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a cell's verdict; what the engine refuses or fails at has one as well."""
    engine = make_engine(case.engine, **case.settings)
    try:
        own = engine.twin(case.scene)
    except UnsupportedScene as refusal:
        return {**ended(case, "unsupported", refusal), **_verdict(REFUSED, str(refusal))}, {}
    with np.errstate(all="ignore"):  # an overflow has its verdict and needs no warning
        truth, _ = converged(own, case.run.samples)
        try:
            run = engine.simulate(case.scene, case.run)
        except (SimulationFailed, OverflowError) as failure:
            return {**ended(case, "failed", failure), **_verdict(DIVERGED, str(failure))}, {}
        energy = float(str(case.columns["impact_energy_J"]))
        found = judged(case.scene, run, truth, followed(own, case.run.samples), energy)
    return {"steps": run.steps, "mean_step_s": case.scene.end_time_s / run.steps, **found}, {}


def judged(scene: Scene, run: Trajectory, truth: Trajectory, agreed: int, impact_energy_J: float) -> Row:
    """Return the verdict on a finished run, its reason, the check's columns and the numbers besides.

    ``truth`` is the converged solution of the law that the engine solves, to be compared with before the
    sample ``agreed``, and no longer than for the impacts that count. The numbers are errors and residuals at
    their worst. One that is not finite is None in the row.
    """
    (c,) = (each.radial_clearance_m for each in scene.clearances.values())
    with np.errstate(all="ignore"):  # the verdict is what is said of an overflow
        residual = energy_balance_residual_J(scene, run) / impact_energy_J
        violation = constraint_violation_m(scene, run) / c
        error = np.abs(observed_m(scene, run) - observed_m(scene, truth)) / c
    check, until = checked(scene, run), min(agreed, before_chaos(truth))
    numbers = {
        ERROR: float(error[:until].max()),
        VIOLATION: float(violation.max()),
        GAIN: float(residual.max()),
        LOSS: float(-residual.min()),
    }
    return {
        "compared_until_s": float(truth.time_s[until - 1]),
        **_verdict(*verdict_of(numbers, finite(run), str(check["quality_failure"]))),
        **{name: value if np.isfinite(value) else None for name, value in numbers.items()},
        **check,
    }


def verdict_of(numbers: dict[str, float], all_finite: bool = True, failure: str = "") -> tuple[str, str]:
    """Return the verdict on a finished run and its reason, by the numbers of ``judged`` and the check's."""
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
    if gap > CONSTRAINT_BOUND:
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


def _verdict(verdict: str, reason: str) -> Row:
    return {"verdict": verdict, "verdict_severity": VERDICTS.index(verdict), "verdict_reason": reason}

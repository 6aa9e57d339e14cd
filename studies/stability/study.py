"""Stability: where each solver stops being trustworthy, as maps, and its limits on a scalar test problem.

Maps are of set R with a lossless Hertz contact at the rod-slider pin, over the step and one of contact
stiffness, clearance and crank speed, from the start through the first impacts. One case is one cell.
"""

import math
from collections.abc import Iterable, Iterator

import numpy as np

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.mechanics.contact_law import stiffness_of
from engine_models.scene.library import BEARING_RADIUS_M, STEEL_PA, STEEL_POISSON, ideal_driven
from engine_models.scene.scene import Clearance, Clearances, Scene
from studies.judges.converged_truth import converged, followed
from studies.running.case import Case, Curves, Row, Value
from studies.running.execution import Limits
from studies.running.outcome import ended
from studies.stability import theory
from studies.stability.scalar import FREQUENCY_RAD_S, GROWING_STEP, measured_growth, oscillator
from studies.stability.verdict import BOUND_COLUMNS, DIVERGED, REFUSED, judged, measured

#: An arm, and the method whose fixed step acts on the contact: None where there is no such step, or no spring
#: for it to act on.
Method = tuple[Arm, str | None]
ARMS: tuple[Method, ...] = (
    (arms.LOCATED, None),
    (arms.PLAIN, theory.RK4),
    (arms.REFERENCE_DOP853, None),
    (arms.TRAPEZOIDAL, theory.TRAPEZOIDAL),
    (arms.GENERALIZED_ALPHA, theory.ALPHA),
    (arms.RK44, theory.RK4),
    (arms.DOPRI5, None),
    (arms.AS_THE_SCENE, theory.EULER),
    (arms.NATIVE_CONTACT, None),
    (arms.SCIPY_DOP853, None),
    (arms.HEYOKA, None),
)
#: The scalar problem alone shows how the generalized-alpha method's damping depends on its parameter.
OTHER_RADIUS: Method = (arms.GENERALIZED_ALPHA_09, theory.ALPHA)
#: What a cell may take. A kernel's compilation counts.
LIMITS = Limits(time_limit_s=120.0, memory_limit_bytes=4 * 2**30)

END_S, SAMPLES = 0.002, 20
#: Steps per sample of the maps: 1e-4 s to 1e-6 s, and to 2e-7 s in the full set.
COARSE = (1, 2, 5, 10, 20, 50, 100)
FINE = (1, 2, 3, 5, 7, 10, 14, 20, 30, 50, 70, 100, 140, 200, 300, 500)
CLEARANCE_M, SPEED_RPM = 5e-4, 5000.0
#: Parts of the stiffness of steel, radial clearances and crank speeds of the maps: quick, then what the full
#: set adds.
STIFFNESS_FACTORS, MORE_FACTORS = (1.0, 100.0, 1000.0), (0.1, 0.3, 3.0, 10.0, 30.0, 300.0)
CLEARANCES_M, MORE_CLEARANCES_M = (2e-5, 1e-4, 5e-4, 2.5e-3), (5e-5, 2e-4, 1e-3)
SPEEDS_RPM, MORE_SPEEDS_RPM = (1250.0, 5000.0, 20000.0), (2500.0, 10000.0)

#: Damping ratios at which limits are looked for, and omega h at which damping is measured without any.
DAMPING_RATIOS, DAMPED_STEPS = (0.0, 0.5, 2.0), (0.1, 0.3, 1.0)
STEPS, DAMPED_RUN_STEPS = 24, 120


def cases(full: bool) -> list[Case]:
    """Return the scalar problem's cases, then the cells of the maps, a scene's after one another.

    The quick set has the map over stiffness alone.
    """
    return [*_scalar_cases(), *_cells(scenes(full), full)]


def _scalar_cases() -> Iterator[Case]:
    for arm, method in (*_arms(), OTHER_RADIUS):
        if arm is arms.NATIVE_CONTACT:
            continue  # no spring
        for ratio in DAMPING_RATIOS:
            yield _scalar_case(arm, ratio, 1.0, STEPS, damping_ratio=ratio, method=method)
        for x in DAMPED_STEPS if method else ():
            yield _scalar_case(arm, 0.0, x, DAMPED_RUN_STEPS, frequency_step=x, method=method)


def _scalar_case(arm: Arm, ratio: float, frequency_step: float, steps: int, /, **columns: Value) -> Case:
    run = RunSettings(frequency_step / FREQUENCY_RAD_S, steps)
    scene = oscillator(ratio, run.step_s, steps)
    return Case("stability", scene, arm, run, limits=LIMITS, columns=columns)


def _arms() -> tuple[Method, ...]:
    return (*ARMS, *((arm, None) for arm in arms.newcomers()))


def _cells(of: Iterable[tuple[str, float, Scene]], full: bool) -> Iterator[Case]:
    for varied, value, scene in of:
        energy, frequency = theory.first_impact(scene)
        for arm, method in _arms():
            if arm is arms.HEYOKA and not full:
                continue  # every cell is an integrator to compile: the quick set has the scalar problem alone
            columns: Row = {
                varied: value,
                "method": method,
                "impact_energy_J": energy,
                "impact_frequency_rad_s": frequency,
                "limit_frequency_step": theory.limit(method, 0.0) if method else None,
                **BOUND_COLUMNS,
            }
            for count in FINE if full else COARSE:
                run = RunSettings(scene.end_time_s / (SAMPLES * count), SAMPLES)
                yield Case("stability", scene, arm, run, limits=LIMITS, columns=columns)


def scenes(full: bool) -> Iterator[tuple[str, float, Scene]]:
    """Yield the rows of the maps: the column of what varies, its value, the scene."""
    steel = stiffness_of(_clearance(CLEARANCE_M))
    for factor in sorted(STIFFNESS_FACTORS + (MORE_FACTORS if full else ())):
        scene = _scene("stiffness", factor, SPEED_RPM, _clearance(CLEARANCE_M, factor * steel))
        yield "contact_stiffness_N_m1_5", factor * steel, scene
    if not full:
        return
    for c in sorted(CLEARANCES_M + MORE_CLEARANCES_M):
        yield "radial_clearance_m", c, _scene("clearance", c, SPEED_RPM, _clearance(c))
    for speed in sorted(SPEEDS_RPM + MORE_SPEEDS_RPM):
        yield "crank_speed_rpm", speed, _scene("speed", speed, speed, _clearance(CLEARANCE_M))


def _clearance(radial_m: float, stiffness: float | None = None) -> Clearance:
    """Return a lossless Hertz contact of given stiffness, or of steel."""
    return Clearance(
        radial_clearance_m=radial_m,
        bearing_radius_m=BEARING_RADIUS_M,
        law="hertz",
        stiffness=stiffness,
        young_modulus_Pa=None if stiffness else STEEL_PA,
        poisson_ratio=None if stiffness else STEEL_POISSON,
    )


def _scene(varied: str, value: float, speed_rpm: float, clearance: Clearance) -> Scene:
    scene = ideal_driven()
    start = scene.start.model_copy(update={"crank_speed_rad_s": 2 * math.pi * speed_rpm / 60})
    name, loose = f"stability-{varied}-{value:g}", Clearances(B=clearance)
    changes = {"name": name, "end_time_s": END_S, "start": start, "clearance": loose}
    return scene.model_copy(update=changes)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a cell's verdict, or a limit or a damping of the scalar problem."""
    with np.errstate(all="ignore"):  # an overflow has its verdict and needs no warning
        engine = make_engine(case.engine, **case.settings)
        if "damping_ratio" in case.columns:
            return _limit(case, engine), {}
        if "frequency_step" in case.columns:
            return _damping(case, engine), {}
        return _cell(case, engine), {}


def _limit(case: Case, engine: Engine) -> Row:
    """Return the omega h from which on the oscillation grows, measured and by theory; None is no limit."""
    ratio, method = float(str(case.columns["damping_ratio"])), case.columns["method"]
    order = _states(method)
    limit = theory.first_growth(lambda x: measured_growth(engine, x, ratio, STEPS, order) > GROWING_STEP)
    expected = theory.limit(str(method), ratio) if method else None
    row: Row = {"measured_limit_frequency_step": limit, "limit_frequency_step": expected}
    if limit and expected:
        row["relative_difference"] = limit / expected - 1
    return row


def _damping(case: Case, engine: Engine) -> Row:
    """Return the part of the energy that an undamped oscillation loses per step, measured and by theory."""
    x, method = float(str(case.columns["frequency_step"])), str(case.columns["method"])
    radius = float(str(case.settings.get("spectral_radius", 0.5)))
    loss = 1 - measured_growth(engine, x, 0.0, DAMPED_RUN_STEPS, _states(method)) ** 2
    expected = 1 - theory.growth(method, x, 0.0, radius) ** 2
    row: Row = {"energy_loss_per_step": loss, "expected_energy_loss_per_step": expected}
    leading = theory.leading_loss(method, x, radius)
    if leading:
        row |= {"leading_energy_loss_per_step": leading, "relative_difference": loss / expected - 1}
    return row


def _states(method: Value) -> int:
    return 3 if method == theory.ALPHA else 2


def _cell(case: Case, engine: Engine) -> Row:
    """Return a cell's verdict; what the engine refuses or fails at has one as well."""
    try:
        own = engine.twin(case.scene)
    except UnsupportedScene as refusal:
        return {**ended("unsupported", refusal), **judged(REFUSED, str(refusal))}
    truth, _ = converged(own, case.run.samples)
    try:
        run = engine.simulate(case.scene, case.run)
    except (SimulationFailed, OverflowError) as failure:
        return {**ended("failed", failure), **judged(DIVERGED, str(failure))}
    energy = float(str(case.columns["impact_energy_J"]))
    verdict = measured(case.plain_scene, run, truth, followed(own, case.run.samples), energy)
    taken: Row = {"steps": run.steps, "mean_step_s": case.scene.end_time_s / run.steps}
    if case.columns["method"] is None:
        taken["contact_step_s"] = _step_in_contact(case, engine, truth)
    return {**taken, **verdict}


def _step_in_contact(case: Case, engine: Engine, truth: Trajectory) -> float | None:
    """Return the mean step that an engine takes within the first contact, in s, by its own count of steps.

    It is counted in runs that end where the contact begins and where it ends. None is that of rigid walls,
    whose contacts have no duration, and of an engine that fails at such a run.
    """
    impacts = truth.contacts["B"].impacts
    duration = float(impacts.duration_s[0]) if len(impacts.time_s) else 0.0
    if duration == 0.0:
        return None
    touch = float(impacts.time_s[0])
    try:
        before, after = (_steps_until(case, engine, end) for end in (touch, touch + duration))
    except SimulationFailed:
        return None
    return duration / max(after - before, 1)


def _steps_until(case: Case, engine: Engine, end_s: float) -> int:
    scene = case.scene.model_copy(update={"end_time_s": end_s})
    return engine.simulate(scene, RunSettings(case.run.step_s, 1)).steps

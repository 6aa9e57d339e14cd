"""Exudyn's solver settings, where they are not its defaults, and the run with its ways to fail."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import exudyn as exu
import numpy as np

from engine_models import watch
from engine_models.engine import EngineFailed, RunSettings, SimulationFailed
from engine_models.exudyn.engine import IMPLICIT, ExudynEngine
from engine_models.mechanics.forces import driven_speeds
from engine_models.mechanics.start import start_state
from engine_models.mechanics.states import lever_m, levers_m, shortest_m
from engine_models.scene.scene import Scene
from engine_models.watch import FEWEST_STEPS, quickest_s
from reference_solver.mechanism.contacts import stiffness_of
from reference_solver.mechanism.data import Motor

#: Touch and release are located to this penetration, and steps get no shorter than this. The trapezoidal rule
#: keeps for ever what the multipliers pick up in steps of 1e-15 s (5 N in set R), so it is to need none; but
#: with friction it may need 1e-13 s, as the switching error at touch still counts on the impact before.
#: DOPRI5 must not get to a shortest step: if its error is too large there, it tries it again and again,
#: without a look at the clock.
EVENT_GAP_M = {"explicit": 1e-12, "implicit": 1e-9}
SHORTEST_STEP_S = {"explicit": 1e-100, "implicit": 1e-13}
#: With error control the penetration is a part of the tolerance, so that events leave no larger error than
#: steps do. It ends above round-off.
GAP_PART, LEAST_GAP_M = 1e-4, 1e-13
#: Newton's bound grows up to steps in which a body turns by this, and shrinks no further than to this.
LARGEST_TURN_RAD, LEAST_INCREMENT = 0.1, 1e-12
#: Exudyn takes a run for finished 1e-10 s ahead of its end. Where samples lie between steps it is to go on.
OVERRUN_S = 2e-10
#: Steps after which a run tells how far it has come: some milliseconds.
TELLS_EVERY = 1000


@contextmanager
def silence() -> Iterator[None]:
    """Keep Exudyn off the terminal: it prints its failures even at verbosity 0."""
    before = exu.config.printToConsole, exu.config.suppressWarnings
    exu.config.printToConsole, exu.config.suppressWarnings = False, True
    try:
        yield
    finally:
        exu.config.printToConsole, exu.config.suppressWarnings = before


def simulation_settings(
    engine: ExudynEngine, scene: Scene, run: RunSettings, every: int
) -> exu.SimulationSettings:
    """Return all settings of a run: equal steps to the end, unless events or a tolerance shorten them.

    Of equal steps one in ``every`` is recorded, of steps as they come all, however short; if it is 0, the
    ends alone are.
    """
    solver, steps = engine.solver_of(scene), run.samples * run.steps_per_sample(scene.end_time_s)
    as_they_come, step_s = engine.steps_as_they_come(scene), scene.end_time_s / steps
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 0.0 if as_they_come and every else step_s * (every or steps)
    integration = settings.timeIntegration
    integration.solverType = getattr(exu.DynamicSolverType, solver)
    integration.endTime = scene.end_time_s + OVERRUN_S * as_they_come
    integration.numberOfSteps = steps
    integration.adaptiveStep = bool(scene.clearances)
    integration.automaticStepSize = solver == "DOPRI5"
    kind = "implicit" if solver in IMPLICIT else "explicit"
    integration.minimumStepSize = SHORTEST_STEP_S[kind]
    if scene.clearances:  # steps end where contacts switch
        gap = EVENT_GAP_M[kind]
        if solver == "DOPRI5":
            gap = max(GAP_PART * engine.step_tolerance, LEAST_GAP_M)
        # Steps grow again at once, however many iterations the last one took.
        integration.adaptiveStepRecoverySteps, integration.adaptiveStepRecoveryIterations = 1, 1000
        integration.discontinuous.ignoreMaxIterations = False
        if kind == "explicit":
            # A step in which a contact switches is to be shorter: taken again as it is, it would seem not to.
            integration.discontinuous.maxIterations = 1
        # The switching error is the gap times the stiffness.
        stiffness = min(stiffness_of(wall) for wall in scene.clearances.values())
        integration.discontinuous.iterationTolerance = gap * stiffness
    if solver in IMPLICIT:
        integration.generalizedAlpha.spectralRadius = engine.spectral_radius
        newton = integration.newton
        # Full Newton, and Jacobians kept over steps, are slower than one Jacobian a step.
        newton.useModifiedNewton = newton.modifiedNewtonJacUpdatePerStep = True
        # Residuals are forces: no bound fits both a light mechanism and a heavy one. Judge the increments,
        # which asks for both tolerances to be the same.
        newton.residualMode = 1
        bound = newton_bound(scene, solver, step_s)
        newton.relativeTolerance = newton.absoluteTolerance = bound
        # Only the initial accelerations rest on differences (of the joints, along the velocity): the default
        # 1e-9 m or rad loses half their digits, and the trapezoidal rule keeps that error for ever.
        newton.numericalDifferentiation.relativeEpsilon = 1e-8
        newton.numericalDifferentiation.minimumCoordinateSize = 1.0
        return settings
    explicit = integration.explicit
    explicit.useLieGroupIntegration = False  # there is none among planar coordinates
    # The last stage of an embedded pair is at the step's end: its acceleration need not be computed again.
    explicit.computeEndOfStepAccelerations = solver != "DOPRI5"
    if solver == "DOPRI5":
        # A relative tolerance counts the sign of the coordinate: the error's scale is 0 at a negative value.
        integration.absoluteTolerance, integration.relativeTolerance = engine.step_tolerance, 0.0
        # Begin with the longest (0), but for what the driver does in a time that no error estimate would see.
        first_s = quickest_s(scene) / FEWEST_STEPS
        integration.initialStepSize = first_s if math.isfinite(first_s) else 0.0
        # As Hairer, Norsett and Wanner have it; at Exudyn's 0.9 up to three times as many steps are rejected.
        integration.stepSizeMaxIncrease, integration.stepSizeSafety = 5.0, 0.8
    return settings


def newton_bound(scene: Scene, solver: str, step_s: float) -> float:
    """Return the increment, in m and rad, below which Newton's method need not go on in steps of a length.

    Powers are of the angle that the quickest body turns in a step. The first increment is of the second
    power, the step's own error of the third. In the trapezoidal rule, whose Jacobian lacks what velocities
    owe to coordinates, an iteration gains one power. Forces go by increments over the squared step, so that
    they need two iterations, in every step: a single one in some of them costs all their digits. In the
    generalized-alpha method an iteration doubles the power, and with ideal joints one is enough.
    """
    of, lever = scene.mechanism, lever_m(scene)
    if of.drive.prescribes:
        speed = float(np.abs(driven_speeds(of, np.linspace(0.0, scene.end_time_s, 1001))).max())
        speed /= 1.0 if of.drive.guide is None else lever
    else:
        speed = float(np.abs(start_state(scene)[1][:, 2]).max())
        if not isinstance(of.drive.law, Motor):  # what is free may swing
            speed = max(speed, math.sqrt(math.hypot(*of.gravity_m_s2) / lever))
    angle = min(speed * step_s, LARGEST_TURN_RAD)
    # The norm of what the longest link moves and turns by where the shortest one turns by 1 rad.
    size = shortest_m(scene) * math.hypot(1.0, 1 / (max(levers_m(of)) or 1.0)) if len(of.bodies) > 1 else 1.0
    if scene.clearances:  # no coarser than touch and release are told apart
        bound = min(size * angle**3 / 25, EVENT_GAP_M["implicit"])
    else:
        bound = size * (angle**2 if solver == "GeneralizedAlpha" else angle**3 / 25)
    return max(bound, LEAST_INCREMENT)


def solve(mbs: exu.MainSystem, settings: exu.SimulationSettings, timeout_s: float) -> float:
    """Run the solver; return its wall time in s.

    Where somebody listens, Exudyn calls back before every step, which takes 1 us, and tells now and then.

    Raises:
        SimulationFailed: Exudyn gave up, or ran out of time.
    """
    listener, raised, steps = watch.listener(), list[BaseException](), count()

    def before_step(_: exu.MainSystem, time_s: float) -> bool:
        try:
            if next(steps) % TELLS_EVERY == 0:
                watch.tell(time_s)
        except BaseException as error:
            raised.append(error)
        return not raised

    if listener is not None:
        mbs.SetPreStepUserFunction(before_step)
    exu.special.solver.timeout = timeout_s
    began = time.perf_counter()
    try:
        succeeded, reason = mbs.SolveDynamic(settings), "no reason given"
    except exu.ExudynError as error:
        succeeded, reason = False, mbs.sys["dynamicSolver"].GetErrorString() or str(error)
    solve_time = time.perf_counter() - began
    if raised:
        raise raised[0]
    solver = mbs.sys["dynamicSolver"]
    when = f"t = {solver.it.currentTime:.6g} s"
    if solver.output.simulationTimeout:
        raise SimulationFailed(f"Exudyn stopped at {when}: not finished after {timeout_s:g} s")
    if not succeeded:
        raise EngineFailed(f"Exudyn failed at {when}: {' '.join(reason.split())}")
    return solve_time

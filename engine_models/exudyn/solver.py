"""Exudyn's solver settings, all of them that matter to the answer, and the run with its ways to fail."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import exudyn as exu
import numpy as np

from engine_models import progress
from engine_models.engine import EngineFailed, RunSettings, SimulationFailed
from engine_models.exudyn.model import Model
from engine_models.exudyn.settings import (
    ADAPTIVE,
    IMPLICIT,
    ExudynSettings,
    integrates_work,
    steps_as_they_come,
)
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.contact_law import stiffness_of
from engine_models.mechanics.crank_motion import FEWEST_STEPS, SPEEDS, crank_motion, quickest_s
from engine_models.mechanics.states import lever_m, shortest_m
from engine_models.pace import Pace
from engine_models.scene.mechanism import levers_m
from engine_models.scene.scene import Scene
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
LEAST_GAP_M = 1e-13
#: Newton's bound grows up to steps in which a body turns by this, and shrinks no further than to this.
LARGEST_TURN_RAD, LEAST_INCREMENT = 0.1, 1e-12
#: After an event steps may grow by this factor each: DOPRI5's (Hairer, Norsett, Wanner) and the others'.
GROWTH_ADAPTIVE, GROWTH = 5.0, 2.0
#: Exudyn takes a run for finished 1e-10 s ahead of its end. Where samples lie between steps it is to go on.
OVERRUN_S = 2e-10
#: Steps after which the pace of a run is judged, if anybody listens: a few seconds.
OUTLASTING = 300_000


@contextmanager
def silence() -> Iterator[None]:
    """Keep Exudyn off the terminal: it prints its failures even at verbosity 0."""
    before = exu.config.printToConsole, exu.config.suppressWarnings
    exu.config.printToConsole, exu.config.suppressWarnings = False, True
    try:
        yield
    finally:
        exu.config.printToConsole, exu.config.suppressWarnings = before


def record_every(scene: Scene, run: RunSettings) -> int:
    """Return how many steps of a run of ideal joints go by between two that are recorded.

    It is 1 where a work has to be integrated over every step, else samples are enough.
    """
    return 1 if integrates_work(scene) else run.steps_per_sample(scene.end_time_s)


def simulation_settings(engine: ExudynSettings, scene: Scene, run: RunSettings) -> exu.SimulationSettings:
    """Return all settings of a run: equal steps to the end, unless events or a tolerance shorten them.

    Of equal steps every so manieth is recorded, of steps as they come every one, however short.
    """
    solver, steps = engine.solver_of(scene), run.samples * run.steps_per_sample(scene.end_time_s)
    as_they_come = steps_as_they_come(engine, scene)
    every = 0 if as_they_come else record_every(scene, run)
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = (scene.end_time_s / steps) * every
    settings.linearSolver.solverType = exu.LinearSolverType.EXUdense
    settings.parallel.numberOfThreads = 1
    integration = settings.timeIntegration
    integration.solverType = getattr(exu.DynamicSolverType, solver)
    integration.startTime = 0.0
    integration.endTime = scene.end_time_s + OVERRUN_S * as_they_come
    integration.numberOfSteps = steps
    integration.adaptiveStep = integration.automaticStepSize = False
    if scene.joints_with_clearance:
        _set_events(integration, scene, engine, solver)
    if solver in IMPLICIT:
        bound = engine.newton_tolerance or newton_bound(scene, solver, scene.end_time_s / steps)
        _set_implicit(integration, engine, bound)
    else:
        _set_explicit(integration, solver)
    if solver in ADAPTIVE:
        _set_adaptive(integration, engine, quickest_s(scene) / FEWEST_STEPS)
    return settings


def newton_bound(scene: Scene, solver: str, step_s: float) -> float:
    """Return the increment, in m and rad, below which Newton's method need not go on in steps of a length.

    Powers are of the angle that the quickest body turns in a step. The first increment is of the second
    power, the step's own error of the third. In the trapezoidal rule, whose Jacobian lacks what velocities
    owe to coordinates, an iteration gains one power. Forces go by increments over the squared step, so that
    they need two iterations, in every step: a single one in some of them costs all their digits. In the
    generalized-alpha method an iteration doubles the power, and with ideal joints one is enough.
    """
    turned = min(_quickest_rad_s(scene) * step_s, LARGEST_TURN_RAD)
    # The norm of what the longest link moves and turns by where the shortest one turns by 1 rad.
    longest = max(levers_m(scene.mechanism))
    size = shortest_m(scene) * math.hypot(1.0, 1 / longest) if len(scene.mechanism.bodies) > 1 else 1.0
    if scene.joints_with_clearance:  # no coarser than touch and release are told apart
        bound = min(size * turned**3 / 25, EVENT_GAP_M["implicit"])
    else:
        bound = size * (turned**2 if solver == "GeneralizedAlpha" else turned**3 / 25)
    return max(bound, LEAST_INCREMENT)


def _quickest_rad_s(scene: Scene) -> float:
    """Return how fast a body turns at the start, or is driven at the fastest; what is free may swing."""
    of, motion, (_, velocity) = scene.mechanism, crank_motion(scene), start_state(scene)
    if motion is not None:
        speed = float(np.abs(motion.speed_rad_s(np.linspace(0.0, scene.end_time_s, SPEEDS))).max())
        return speed if of.drive.guide is None else speed / lever_m(scene)
    speed = float(np.abs(velocity[:, 2]).max())
    if isinstance(of.drive.law, Motor):
        return speed
    return max(speed, math.sqrt(math.hypot(*of.gravity_m_s2) / lever_m(scene)))


def _set_implicit(integration: exu.TimeIntegrationSettings, engine: ExudynSettings, bound: float) -> None:
    """Set up the implicit methods and their Newton iteration, down to a bound on its increments."""
    integration.generalizedAlpha.spectralRadius = engine.spectral_radius
    integration.generalizedAlpha.computeInitialAccelerations = True
    newton = integration.newton
    newton.useModifiedNewton = engine.modified_newton
    newton.modifiedNewtonJacUpdatePerStep = True
    newton.residualMode = 1  # judge the increments, which asks for both tolerances to be the same
    newton.relativeTolerance = newton.absoluteTolerance = bound
    newton.maxIterations = 25
    # Only the initial accelerations rest on differences (of the joints, along the velocity): the default
    # 1e-9 m or rad loses half their digits, and the trapezoidal rule keeps that error for ever.
    newton.numericalDifferentiation.relativeEpsilon = 1e-8
    newton.numericalDifferentiation.minimumCoordinateSize = 1.0


def _set_explicit(integration: exu.TimeIntegrationSettings, solver: str) -> None:
    """Set up the explicit methods: no Lie group among planar coordinates, each step's last acceleration.

    The last stage of an embedded pair is at the step's end: its acceleration need not be computed again.
    """
    explicit = integration.explicit
    explicit.useLieGroupIntegration = False
    explicit.computeEndOfStepAccelerations = solver not in ADAPTIVE
    explicit.computeMassMatrixInversePerBody, explicit.eliminateConstraints = False, True


def _set_adaptive(integration: exu.TimeIntegrationSettings, engine: ExudynSettings, first_s: float) -> None:
    """Let an embedded Runge-Kutta pair choose its steps, up to the longest one.

    The tolerance is absolute, in m, rad, m/s and rad/s. A relative one counts the sign of the coordinate:
    it makes the error's scale zero at a negative value.
    """
    integration.automaticStepSize, integration.minimumStepSize = True, SHORTEST_STEP_S["explicit"]
    integration.absoluteTolerance, integration.relativeTolerance = engine.step_tolerance, 0.0
    # Begin with the longest (0), but for what the driver does in a time that no error estimate would see.
    integration.initialStepSize = first_s if math.isfinite(first_s) else 0.0
    integration.stepSizeMaxIncrease, integration.stepSizeSafety = GROWTH_ADAPTIVE, engine.step_safety


def _set_events(
    integration: exu.TimeIntegrationSettings, scene: Scene, engine: ExudynSettings, solver: str
) -> None:
    """Set up how a contact's switching is treated: steps that end on it, or steps as they come."""
    kind = "implicit" if solver in IMPLICIT else "explicit"
    locate, gap = engine.locate_events, EVENT_GAP_M[kind]
    if solver in ADAPTIVE:
        gap = max(engine.event_gap * engine.step_tolerance, LEAST_GAP_M)
    integration.minimumStepSize = SHORTEST_STEP_S[kind]
    integration.adaptiveStep = locate
    integration.adaptiveStepDecrease, integration.adaptiveStepIncrease = 0.5, GROWTH
    # Steps grow again at once, however many iterations the last one took.
    integration.adaptiveStepRecoverySteps, integration.adaptiveStepRecoveryIterations = 1, 1000
    switching = integration.discontinuous
    switching.useRecommendedStepSize = locate
    switching.maxIterations, switching.ignoreMaxIterations = 5, not locate
    # The switching error is the gap times the stiffness.
    softest = min(stiffness_of(clearance) for clearance in scene.clearances.values())
    switching.iterationTolerance = softest * gap if locate else 1.0


def _tell_steps(mbs: exu.MainSystem, scene: Scene) -> list[BaseException]:
    """Have Exudyn call back before every step to tell how far it has come; return what was raised there.

    Only if somebody listens: a call takes 1 to 3 us. It changes nothing in the run.
    """
    listener, raised = progress.listener(), list[BaseException]()
    if listener is None:
        return raised

    steps, pace = count(1), Pace(scene, OUTLASTING)

    def before_step(_: exu.MainSystem, time_s: float) -> bool:
        try:
            listener(time_s)
            pace.judge(time_s, next(steps))
        except BaseException as error:
            raised.append(error)
            return False
        return True

    mbs.SetPreStepUserFunction(before_step)
    return raised


def solve(scene: Scene, model: Model, settings: exu.SimulationSettings, timeout_s: float) -> float:
    """Run the solver; return its wall time in s.

    Raises:
        SimulationFailed: Exudyn gave up, or ran out of time.
    """
    exu.special.solver.timeout = timeout_s
    mbs = model.mbs
    raised = _tell_steps(mbs, scene)
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

"""Exudyn's implicit solvers on the crank-slider: settings, the run, and the reading of its sensors."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Literal

import exudyn as exu
import numpy as np
import pydantic
from pydantic import Field
from scipy.integrate import cumulative_trapezoid

from engine_models.engine import (
    BODIES,
    JOINTS,
    SETTINGS_CONFIG,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    require_finite,
    require_ideal,
)
from engine_models.exudyn_model import Model, build_model
from engine_models.scene import Scene

#: A recorded time may differ from its place on the grid by rounding, never by this part of an interval.
TIME_TOLERANCE = 1e-6


@contextmanager
def _silence() -> Iterator[None]:
    """Keep Exudyn off the terminal: it prints its failures even at verbosity 0."""
    before = exu.config.printToConsole, exu.config.suppressWarnings
    exu.config.printToConsole, exu.config.suppressWarnings = False, True
    try:
        yield
    finally:
        exu.config.printToConsole, exu.config.suppressWarnings = before


@pydantic.dataclasses.dataclass(frozen=True, config=SETTINGS_CONFIG)
class ExudynEngine:
    """Exudyn's implicit solvers at a fixed step.

    ``spectral_radius`` (at infinite frequency) matters to the generalized-alpha method alone: 1 would keep
    the spurious oscillation of its multipliers for ever, 0.5 forgets it within some ten steps. Newton's
    method ends when its increment, in m and rad, is below ``newton_tolerance``: residuals are forces, and no
    bound on those fits both a light mechanism and a heavy one. ``modified_newton`` factorises one Jacobian
    a step, not one an iteration.
    """

    solver: Literal["TrapezoidalIndex2", "GeneralizedAlpha"] = "TrapezoidalIndex2"
    spectral_radius: Annotated[float, Field(ge=0, lt=1)] = 0.5
    newton_tolerance: Annotated[float, Field(gt=0, le=1e-6)] = 1e-12
    modified_newton: bool = True

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene if a joint has clearance."""
        require_ideal(scene, "exudyn")

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run an ideal scene.

        Raises:
            UnsupportedScene: a joint has clearance.
            SimulationFailed: Exudyn gave up, stopped short or returned non-finite numbers.
        """
        self.check(scene)
        with _silence(), np.errstate(over="ignore", invalid="ignore"):  # require_finite is the judge
            model = build_model(scene)
            solve_time = _solve(model, self._simulation_settings(scene, settings))
            return require_finite(_trajectory(model, scene, settings, solve_time))

    def _simulation_settings(self, scene: Scene, run: RunSettings) -> exu.SimulationSettings:
        step = run.step_used_s(scene.end_time_s)
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = step * _steps_per_record(scene, run)
        settings.linearSolver.solverType = exu.LinearSolverType.EXUdense
        settings.parallel.numberOfThreads = 1
        integration = settings.timeIntegration
        integration.solverType = getattr(exu.DynamicSolverType, self.solver)
        integration.startTime, integration.endTime = 0.0, scene.end_time_s
        integration.numberOfSteps = run.samples * run.steps_per_sample(scene.end_time_s)
        integration.adaptiveStep = False
        integration.generalizedAlpha.spectralRadius = self.spectral_radius
        integration.generalizedAlpha.computeInitialAccelerations = True
        newton = integration.newton
        newton.useModifiedNewton = self.modified_newton
        newton.modifiedNewtonJacUpdatePerStep = True
        newton.residualMode = 1  # judge the increments, which asks for both tolerances to be the same
        newton.relativeTolerance = newton.absoluteTolerance = self.newton_tolerance
        newton.maxIterations = 25
        # Only the initial accelerations rest on differences (of the joints, along the velocity): the default
        # 1e-9 m or rad loses half their digits, and the trapezoidal rule keeps that error for ever.
        newton.numericalDifferentiation.relativeEpsilon = 1e-8
        newton.numericalDifferentiation.minimumCoordinateSize = 1.0
        return settings


def _steps_per_record(scene: Scene, run: RunSettings) -> int:
    """Return 1 where the driver's work has to be integrated over every step, else samples are enough."""
    return 1 if scene.drive.kind == "constant-speed" else run.steps_per_sample(scene.end_time_s)


def _solve(model: Model, settings: exu.SimulationSettings) -> float:
    """Run the solver; return its wall time in s."""
    began = time.perf_counter()
    try:
        succeeded, reason = model.mbs.SolveDynamic(settings), "no reason given"
    except exu.ExudynError as error:
        succeeded, reason = False, model.mbs.sys["dynamicSolver"].GetErrorString() or str(error)
    solve_time = time.perf_counter() - began
    if not succeeded:
        when = model.mbs.sys["dynamicSolver"].it.currentTime
        raise SimulationFailed(f"Exudyn failed at t = {when:.6g} s: {' '.join(reason.split())}")
    return solve_time


def _read(model: Model, sensor: int, grid_s: FloatArray) -> FloatArray:
    """Return what a sensor recorded at the grid's times, (n, components); one missing is a failed run."""
    record = np.asarray(model.mbs.GetSensorStoredData(sensor), dtype=np.float64)
    tolerance = TIME_TOLERANCE * (grid_s[1] - grid_s[0])
    common = min(len(record), len(grid_s))
    right = np.abs(record[:common, 0] - grid_s[:common]) <= tolerance
    if not right.all() or len(record) != len(grid_s):
        missed = common if right.all() else int(np.argmin(right))
        when = grid_s[min(missed, len(grid_s) - 1)]
        raise SimulationFailed(f"Exudyn recorded nothing at t = {when:.6g} s")
    return record[:, 1:]


def _trajectory(model: Model, scene: Scene, run: RunSettings, solve_time_s: float) -> Trajectory:
    per_sample, step = run.steps_per_sample(scene.end_time_s), run.step_used_s(scene.end_time_s)
    per_record = _steps_per_record(scene, run)
    grid = np.linspace(0.0, scene.end_time_s, run.samples * per_sample // per_record + 1)
    samples = slice(None, None, per_sample // per_record)
    coordinates, speeds, forces = (
        [_read(model, sensor, grid) for sensor in sensors]
        for sensors in (model.coordinates, model.speeds, model.joint_forces)
    )
    position, velocity = np.zeros((2, run.samples + 1, len(BODIES), 3))
    for body, (at, rate) in enumerate(zip(coordinates, speeds, strict=True)):  # the slider has x alone
        position[:, body, : at.shape[1]] = at[samples]
        velocity[:, body, : rate.shape[1]] = rate[samples]
    position += model.reference
    position[:, 0, 2] += scene.start.crank_angle_rad - model.reference[0, 2]  # whole turns
    joint_force = np.stack([force[samples, :2] for force in forces], axis=1)
    torque: FloatArray | None = None
    work: FloatArray | None = None
    if scene.drive.kind == "torque":
        torque = np.full(run.samples + 1, scene.drive.torque_N_m)
        work = scene.drive.torque_N_m * (position[:, 0, 2] - position[0, 0, 2])
    elif model.driver is not None:
        torque = -_read(model, model.driver, grid)[:, 0]
        work = cumulative_trapezoid(torque * speeds[0][:, 2], dx=step, initial=0.0)[samples]
        torque = torque[samples]
    return Trajectory(
        time_s=grid[samples],
        position=position,
        velocity=velocity,
        joint_force_N=joint_force,
        # The slider does not accelerate along y: N + F_B,y - m g = 0.
        guide_normal_force_N=scene.slider.mass_kg * scene.gravity_m_s2 - joint_force[:, JOINTS.index("B"), 1],
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=step,
        steps=run.samples * per_sample,
        solve_time_s=solve_time_s,
    )

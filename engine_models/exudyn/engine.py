"""Exudyn on the crank-slider: settings, what they can and cannot express, and the choice of model."""

from dataclasses import replace
from typing import Annotated, Literal

import pydantic
from pydantic import Field

from engine_models.engine import SETTINGS_CONFIG, RunSettings, Trajectory, UnsupportedScene, require_finite
from engine_models.exudyn.contact import native_twin
from engine_models.exudyn.fast_build import load_build, require_build
from engine_models.mechanics.start_check import unwound, wound
from engine_models.memory import require_memory
from engine_models.scene.scene import Scene

IMPLICIT, ADAPTIVE = ("TrapezoidalIndex2", "GeneralizedAlpha"), ("DOPRI5", "ODE23")


#: What a recorded step takes, with what is made of it after the run (measured).
BYTES_PER_STEP, BYTES_PER_STEP_WITH_CONTACT = 550, 5_000
#: The smallest tolerance that ``sharper`` goes to.
SHARPEST = 1e-14


@pydantic.dataclasses.dataclass(frozen=True, config=SETTINGS_CONFIG)
class ExudynEngine:
    """Settings of Exudyn's solvers; the defaults are its best practice.

    ``solver = auto`` is the implicit trapezoidal rule for ideal joints and DOPRI5 for joints with clearance,
    wherever its model can be built. Implicit solvers run the absolute model: every ideal joint is a
    constraint. Explicit ones run the tree model, which has no constraint, and only scenes with clearance.
    DOPRI5 and ODE23 choose their steps, up to the run's, for a local error of ``tolerance`` in m, rad, m/s
    and rad/s; the others take the run's step. With ``locate_events`` steps are shortened to end on touch and
    release, and grow again; without it they are as they come.

    ``spectral_radius`` (at infinite frequency) matters to the generalized-alpha method alone: 1 would keep
    the spurious oscillation of its multipliers for ever, 0.5 forgets it within some ten steps. Newton's
    method ends when its increment, in m and rad, is below ``newton_tolerance``: residuals are forces, and no
    bound on those fits both a light mechanism and a heavy one. ``modified_newton`` factorises one Jacobian
    a step, not one an iteration.

    ``fast`` takes Exudyn's build without range checks. A process has the build of its first run.
    A run that takes longer than ``timeout_s`` has failed.
    """

    solver: Literal[
        "auto",
        "TrapezoidalIndex2",
        "GeneralizedAlpha",
        "DOPRI5",
        "ODE23",
        "RK67",
        "RK44",
        "RK33",
        "ExplicitMidpoint",
    ] = "auto"
    tolerance: Annotated[float, Field(gt=0, le=1e-3)] = 1e-10
    locate_events: bool = True
    spectral_radius: Annotated[float, Field(ge=0, lt=1)] = 0.5
    newton_tolerance: Annotated[float, Field(gt=0, le=1e-6)] = 1e-12
    modified_newton: bool = True
    fast: bool = False
    timeout_s: Annotated[float, Field(gt=0)] = 120.0

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where the solver's model or Exudyn's contact stand in the way."""
        native_twin(scene)
        if self.solver_of(scene) not in IMPLICIT:
            reason = _no_tree(scene)
            if reason:
                raise UnsupportedScene(f"exudyn's solver {self.solver} cannot run this scene: {reason}")
        require_build(self.fast)

    def twin(self, scene: Scene) -> Scene:
        """Return the scene with the contacts as Exudyn has them: they may pull, friction saturates linearly.

        A friction law that is a hyperbolic tangent becomes linear up to the same speed.
        """
        self.check(scene)
        return native_twin(scene)

    def sharper(self) -> "ExudynEngine":
        """Return the engine with a tenth of its tolerance, which is for solvers that choose their steps."""
        return replace(self, tolerance=max(self.tolerance / 10, SHARPEST))

    def bare_solve_time_s(self, scene: Scene, settings: RunSettings) -> float:
        """Return the wall time of the solve with nothing recorded but its ends.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        self.check(scene)
        load_build(self.fast)
        from engine_models.exudyn.run import bare_run  # which imports Exudyn, in the build of the first run

        return bare_run(self, wound(scene), settings)

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run a scene.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: Exudyn gave up, stopped short, ran out of time or returned non-finite numbers.
        """
        self.check(scene)
        require_memory(scene, settings, *self._recorded(scene, settings))
        load_build(self.fast)
        from engine_models.exudyn.run import exudyn_run

        return unwound(scene, require_finite(exudyn_run(self, wound(scene), settings)))

    def solver_of(self, scene: Scene) -> str:
        """Return the solver that runs a scene: the one set, or what ``auto`` stands for."""
        if self.solver != "auto":
            return self.solver
        return "TrapezoidalIndex2" if _no_tree(scene) else "DOPRI5"

    def _recorded(self, scene: Scene, run: RunSettings) -> tuple[int, int]:
        """Return of how many steps at least Exudyn's sensors keep something, and how many bytes of each."""
        if scene.joints_with_clearance:
            return run.samples * run.steps_per_sample(scene.end_time_s), BYTES_PER_STEP_WITH_CONTACT
        driven = scene.drive.kind == "constant-speed"
        return driven * run.samples * run.steps_per_sample(scene.end_time_s), BYTES_PER_STEP


def _no_tree(scene: Scene) -> str:
    """Return why the scene has no model without constraints, nothing if it has one."""
    if not scene.joints_with_clearance:
        return "explicit solvers take no constraints, and ideal joints alone form a closed loop"
    if scene.drive.kind == "constant-speed" and scene.joints_with_clearance == ("O",):
        return "with clearance at O alone no coordinate is the crank's angle, whose speed is prescribed"
    return ""

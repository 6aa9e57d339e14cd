"""Exudyn on planar mechanisms: its settings, what these can and cannot express, and its runs."""

import contextlib
import math
import sys
from dataclasses import replace
from importlib import import_module
from typing import Annotated, Any, Literal

import pydantic
from pydantic import Field

from engine_models.engine import (
    STRICT,
    BareRun,
    Engine,
    EngineFailed,
    RunSettings,
    Trajectory,
    UnsupportedScene,
)
from engine_models.exudyn.contact import native_twin
from engine_models.exudyn.tree import why_no_tree
from engine_models.mechanics.forces import integrals_of, require_family
from engine_models.mechanics.start import unwound
from engine_models.scene.scene import Scene
from engine_models.watch import require_followed, require_memory

#: Solvers of the absolute model and of the tree, by their orders; None where a tolerance decides.
IMPLICIT = {"TrapezoidalIndex2": 2, "GeneralizedAlpha": 2}
EXPLICIT = {"DOPRI5": None, "RK44": 4}
#: What a recorded step of three bodies takes, with what is made of it after the run (measured).
BYTES_PER_STEP, BYTES_PER_STEP_WITH_CONTACT = 550, 5_000
#: The smallest tolerance that ``sharper`` goes to.
SHARPEST = 1e-14


@pydantic.dataclasses.dataclass(frozen=True, config=STRICT)
class ExudynEngine(Engine):
    """Exudyn's solvers on a scene, implicit and explicit; their defaults are its best practice.

    ``solver = auto`` is the implicit trapezoidal rule for ideal joints and DOPRI5 for joints with clearance,
    wherever its model can be built. Implicit solvers run the absolute model: ideal joints are constraints,
    but for a pin or a guide on the ground. Explicit ones run the tree model, which has no constraint, and
    only scenes whose ideal joints close no loop. The trapezoidal rule holds velocities to the constraints;
    where it gives up, the generalized-alpha method, which holds positions, may come through.
    DOPRI5 chooses its steps, up to the run's, for a local error of ``step_tolerance`` in m, rad, m/s and
    rad/s; the others take the run's step. In contact, steps end on touch and release and grow again.

    ``spectral_radius`` (at infinite frequency) matters to the generalized-alpha method alone: 1 would keep
    the spurious oscillation of its multipliers for ever, 0.5 forgets it within some ten steps.

    A run that takes longer than ``timeout_s`` has failed.
    """

    solver: Literal["auto", "TrapezoidalIndex2", "GeneralizedAlpha", "DOPRI5", "RK44"] = "auto"
    step_tolerance: Annotated[float, Field(gt=0, le=1e-4)] = 1e-10
    spectral_radius: Annotated[float, Field(ge=0, lt=1)] = 0.5
    timeout_s: Annotated[float, Field(gt=0)] = 120.0

    def solver_of(self, scene: Scene) -> str:
        """Return the solver that runs a scene: the one set, or what ``auto`` stands for."""
        if self.solver != "auto":
            return self.solver
        has_tree = scene.clearances and not why_no_tree(scene.mechanism)
        return "DOPRI5" if has_tree else "TrapezoidalIndex2"

    def steps_as_they_come(self, scene: Scene) -> bool:
        """Return whether samples may lie between steps: with clearance, and without constraints."""
        return bool(scene.clearances) or self.solver_of(scene) in EXPLICIT

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where the solver's model or Exudyn's contact stand in the way."""
        require_family(scene, "exudyn")
        native_twin(scene)
        reason = why_no_tree(scene.mechanism)
        if reason and self.solver_of(scene) in EXPLICIT:
            raise UnsupportedScene(f"exudyn's solver {self.solver} cannot run this scene: {reason}")

    def twin(self, scene: Scene) -> Scene:
        """Return the scene with the contacts as Exudyn has them: they may pull, friction saturates linearly.

        A friction law that is a hyperbolic tangent becomes linear up to the same speed.
        """
        self.check(scene)
        return native_twin(scene)

    @property
    def order(self) -> float | None:
        """The solver's, of ``auto`` that for ideal joints; None where it chooses its steps."""
        return {"auto": 2, **IMPLICIT, **EXPLICIT}[self.solver]

    def sharper(self) -> "ExudynEngine":
        """Return the engine with a tenth of its tolerance, which is for solvers that choose their steps."""
        return replace(self, step_tolerance=max(self.step_tolerance / 10, SHARPEST))

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the solve with nothing recorded but its ends."""
        self.check(scene)
        run: BareRun = _runs().bare_run(self, scene, settings)
        return run

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run a scene.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: Exudyn gave up, stopped short, ran out of time or returned non-finite numbers;
                or the driver's speed changes within a step.
        """
        self.check(scene)
        require_memory(scene, settings, *self._recorded(scene, settings))
        if self.solver_of(scene) != "DOPRI5":
            require_followed(scene, settings.step_used_s(scene.end_time_s))
        try:
            return unwound(scene, _runs().exudyn_run(self, scene, settings))
        except EngineFailed as failure:
            if self.solver_of(scene) != "TrapezoidalIndex2":
                raise
            raise EngineFailed(f"{failure}; solver = GeneralizedAlpha may come through") from failure

    def _recorded(self, scene: Scene, run: RunSettings) -> tuple[int, int]:
        """Return of how many steps at least Exudyn's sensors keep something, and how many bytes of each."""
        steps = run.samples * run.steps_per_sample(scene.end_time_s)
        threes = max(1, math.ceil(len(scene.mechanism.bodies) / 3))
        if self.steps_as_they_come(scene):
            return steps, threes * BYTES_PER_STEP_WITH_CONTACT
        return bool(integrals_of(scene)) * steps, threes * BYTES_PER_STEP


def _runs() -> Any:
    """Return the module ``run``, which imports Exudyn: its build without range checks, which says so."""
    sys.exudynFast = True  # type: ignore[attr-defined]
    with contextlib.redirect_stdout(None):
        return import_module("engine_models.exudyn.run")

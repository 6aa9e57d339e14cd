"""Exudyn on planar mechanisms: what its settings can and cannot express, and its runs."""

import math
from dataclasses import replace
from typing import ClassVar

import pydantic

from engine_models.engine import (
    SETTINGS_CONFIG,
    BareRun,
    Engine,
    RunSettings,
    Trajectory,
    UnsupportedScene,
    require_finite,
)
from engine_models.exudyn.contact_law import native_twin
from engine_models.exudyn.fast_build import load_build, require_build
from engine_models.exudyn.settings import (
    ADAPTIVE,
    IMPLICIT,
    ORDERS,
    ExudynSettings,
    integrates_work,
    no_tree,
    steps_as_they_come,
)
from engine_models.mechanics.crank_motion import require_followed
from engine_models.mechanics.start_check import unwound
from engine_models.memory import require_memory
from engine_models.scene.scene import Scene

#: What a recorded step of three bodies takes, with what is made of it after the run (measured).
BYTES_PER_STEP, BYTES_PER_STEP_WITH_CONTACT = 550, 5_000
#: The smallest tolerance that ``sharper`` goes to.
SHARPEST = 1e-14


@pydantic.dataclasses.dataclass(frozen=True, config=SETTINGS_CONFIG)
class ExudynEngine(ExudynSettings, Engine):
    """Exudyn's solvers on a scene, implicit and explicit; their defaults are its best practice.

    See ``ExudynSettings``.
    """

    any_mechanism: ClassVar[bool] = True

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where the solver's model or Exudyn's contact stand in the way."""
        native_twin(scene)
        if self.solver_of(scene) not in IMPLICIT:
            reason = no_tree(scene)
            if reason:
                raise UnsupportedScene(f"exudyn's solver {self.solver} cannot run this scene: {reason}")
        require_build(self.fast)

    def twin(self, scene: Scene) -> Scene:
        """Return the scene with the contacts as Exudyn has them: they may pull, friction saturates linearly.

        A friction law that is a hyperbolic tangent becomes linear up to the same speed.
        """
        self.check(scene)
        return native_twin(scene)

    @property
    def order(self) -> float | None:
        """The solver's, of ``auto`` that for ideal joints; None where it chooses its steps."""
        return ORDERS.get("TrapezoidalIndex2" if self.solver == "auto" else self.solver)

    def sharper(self) -> "ExudynEngine":
        """Return the engine with a tenth of its tolerance, which is for solvers that choose their steps."""
        return replace(self, step_tolerance=max(self.step_tolerance / 10, SHARPEST))

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the solve with nothing recorded but its ends.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        self.check(scene)
        load_build(self.fast)
        from engine_models.exudyn.run import bare_run  # which imports Exudyn, in the build of the first run

        return bare_run(self, scene, settings)

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run a scene.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: Exudyn gave up, stopped short, ran out of time or returned non-finite numbers;
                or the driver's speed changes within a step.
        """
        self.check(scene)
        require_memory(scene, settings, *self._recorded(scene, settings))
        if self.solver_of(scene) not in ADAPTIVE:
            require_followed(scene, settings.step_used_s(scene.end_time_s))
        load_build(self.fast)
        from engine_models.exudyn.run import exudyn_run

        return unwound(scene, require_finite(exudyn_run(self, scene, settings)))

    def _recorded(self, scene: Scene, run: RunSettings) -> tuple[int, int]:
        """Return of how many steps at least Exudyn's sensors keep something, and how many bytes of each."""
        steps = run.samples * run.steps_per_sample(scene.end_time_s)
        threes = max(1, math.ceil(len(scene.mechanism.bodies) / 3))
        if steps_as_they_come(self, scene):
            return steps, threes * BYTES_PER_STEP_WITH_CONTACT
        return integrates_work(scene) * steps, threes * BYTES_PER_STEP

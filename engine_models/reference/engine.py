"""The crank-slider in the reference solver: the paper's Lagrange-multiplier algorithm, by RK4 or DOP853."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.engine import STRICT, Engine, EngineFailed, RunSettings, Trajectory, UnsupportedScene
from engine_models.mechanics.start import unwound
from engine_models.reference.run import TURN_OF_STEP_RAD, rate_s, reference_run
from engine_models.scene.scene import Scene
from engine_models.watch import MOST_STEPS, require_followed, require_memory
from reference_solver.equations import Baumgarte
from reference_solver.failures import SolverError
from reference_solver.solver import FEWEST_STEPS_PER_CONTACT, LOWEST_FLIGHT, ErrorControl, StepChoice

#: With so many, of order 4, a contact is in error by round-off.
MOST_STEPS_PER_CONTACT = 1e4
#: The smallest tolerance, some times round-off, and one to begin with.
SHARPEST, LOOSE = 1e-14, 1e-6


@dataclass(frozen=True, config=STRICT)
class ReferenceEngine(Engine):
    """Settings of the reference solver.

    ``stabilisation`` holds drift back, by projection after every step or by Baumgarte's terms. Their gains in
    1/s are ``baumgarte_alpha_s`` and ``baumgarte_beta_s``.

    ``method = rk4`` is the paper's. In a scene with clearance the run's step is the longest one, taken in
    flight; a contact takes ``steps_per_contact`` shorter ones, graded at both ends, and touch and release are
    located. That number is for a step in which the mechanism turns by 0.3 degrees, at the rate of its start
    (see ``Scales``), and grows as the step falls, so that halving the step halves both, up to ten thousand.
    Without ``locate_events`` every step has the run's length, as in the paper.

    ``method = dop853``, of order 8, and ``dopri5``, of order 5, take steps up to the run's longest that are
    in error by the ``step_tolerance``: a part of the mechanism's longest lever, a radian, and both times the
    rate of its start (see ``ErrorControl``).

    Pins before rigid walls bounce as long as step or tolerance let them; or, where ``lowest_flight`` is
    given, down to heights of so many times round-off.

    A run fails that would need more than ``max_steps`` at the pace that it has come to, looked at every two
    million, or with another limit than the default, which would take hours, every 200,000.
    """

    method: Literal["rk4", "dop853", "dopri5"] = "rk4"
    step_tolerance: Annotated[float, Field(ge=SHARPEST, lt=1)] = 1e-9
    stabilisation: Literal["none", "baumgarte", "projection"] = "projection"
    baumgarte_alpha_s: Annotated[float, Field(ge=0)] = 100.0
    baumgarte_beta_s: Annotated[float, Field(ge=0)] = 100.0
    steps_per_contact: Annotated[float, Field(ge=4)] = 100.0
    locate_events: bool = True
    lowest_flight: Annotated[float, Field(ge=LOWEST_FLIGHT)] | None = None
    max_steps: Annotated[float, Field(ge=1)] = MOST_STEPS

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where the settings stand in the way of each other, or of rigid contact."""
        if self.controls_error and not self.locate_events:
            raise UnsupportedScene(f"reference needs locate_events with method = {self.method}")
        rigid = any(clearance.law == "rigid" for clearance in scene.clearances.values())
        if rigid and not (self.stabilisation == "projection" and self.locate_events):
            raise UnsupportedScene(
                "reference runs rigid contact with stabilisation = projection and locate_events only"
            )

    def idle(self) -> dict[str, str]:
        """Return the settings other than their defaults that change nothing, with that which says so."""
        of_method = ("steps_per_contact",) if self.controls_error else ("step_tolerance",)
        idle = dict.fromkeys(of_method, f"method = {self.method}")
        if self.stabilisation != "baumgarte":
            of_feedback = ("baumgarte_alpha_s", "baumgarte_beta_s")
            idle |= dict.fromkeys(of_feedback, f"stabilisation = {self.stabilisation}")
        default = ReferenceEngine()
        return {name: by for name, by in idle.items() if getattr(self, name) != getattr(default, name)}

    def sharper(self) -> "ReferenceEngine":
        """Return the engine with a tenth of its tolerance; with RK4 the step alone decides."""
        if self.method == "rk4":
            return self
        return replace(self, step_tolerance=max(self.step_tolerance / 10, SHARPEST))

    @property
    def order(self) -> float | None:
        """RK4's, None with a tolerance."""
        return None if self.controls_error else 4

    @property
    def controls_error(self) -> bool:
        """Whether the tolerance decides, and the step is no more than a limit."""
        return self.method != "rk4"

    def controlling_error(self, step_tolerance: float | None = None) -> "ReferenceEngine":
        """Return the engine with DOP853 and a tolerance, with its events located and all bounces followed.

        Those left out are an error of the order of the square root of their height, which falls too slowly.
        """
        lowest = self.lowest_flight or LOWEST_FLIGHT
        located = replace(self, locate_events=True, lowest_flight=lowest)
        return replace(located, method="dop853", step_tolerance=step_tolerance or LOOSE)

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: singular configuration or overflow, or a tolerance that no step meets.
        """
        self.check(scene)
        require_memory(scene, settings)
        feedback = Baumgarte(self.baumgarte_alpha_s, self.baumgarte_beta_s)
        stabilisation = feedback if self.stabilisation == "baumgarte" else self.stabilisation
        try:
            with np.errstate(all="ignore"):  # require_finite is the judge
                choice = self.step_choice(scene, settings)
                run = reference_run(scene, settings, choice, stabilisation, self.max_steps)
                return unwound(scene, run)
        except SolverError as error:
            raise EngineFailed(str(error)) from error
        except OverflowError:  # Python's own numbers raise where NumPy's become infinite
            raise EngineFailed(f"overflow with step {settings.step_s:.3g} s: shorten the step") from None

    def step_choice(self, scene: Scene, settings: RunSettings) -> StepChoice | ErrorControl:
        """Return how a run of a scene chooses its steps.

        Samples as dense as the steps asked for do not shorten those whose events are located.

        Raises:
            SingularConfiguration, SimulationFailed: as ``rate_s`` does; steps are too long for the driver.
        """
        if self.method != "rk4":
            longest_s = min(settings.step_s, scene.end_time_s)
            return ErrorControl(self.step_tolerance, longest_s, self.method, self.lowest_flight)
        step = settings.step_used_s(scene.end_time_s)
        if scene.drive.kind == "fluctuating":
            require_followed(scene, step)  # a ramp is cut into steps enough
        if not (scene.clearances and self.locate_events):
            return StepChoice(step, locate_events=self.locate_events)
        per_contact = self.steps_per_contact * TURN_OF_STEP_RAD / (rate_s(scene) * step)
        most = max(MOST_STEPS_PER_CONTACT, self.steps_per_contact)
        per_contact = min(max(FEWEST_STEPS_PER_CONTACT, per_contact), most)
        if settings.steps_per_sample(scene.end_time_s) == 1:
            per_contact = max(FEWEST_STEPS_PER_CONTACT, per_contact * step / settings.step_s)
            step = settings.step_s
        return StepChoice(step, per_contact, lowest_flight=self.lowest_flight)

"""heyoka's Taylor integrator on minimal coordinates: the fastest pick of a user who wants the motion."""

import time
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field
from pydantic.dataclasses import dataclass

from engine_models.engine import (
    SETTINGS_CONFIG,
    BareRun,
    Engine,
    RunSettings,
    Trajectory,
    UnsupportedScene,
    require_finite,
)
from engine_models.mechanics.contact_law import exponent_of
from engine_models.mechanics.equations.scope import require_coordinates
from engine_models.mechanics.equations.trajectory import trajectory_of_solution
from engine_models.mechanics.start_check import unwound
from engine_models.memory import require_memory
from engine_models.scene.parts import AnyScene, Clearance

if TYPE_CHECKING:
    from collections.abc import Callable

    from engine_models.heyoka.run import Flight, Piece
    from engine_models.heyoka.systems import Systems

#: The smallest tolerance: that of a double's last place.
SHARPEST = 2.3e-16


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class HeyokaEngine(Engine):
    """Taylor series of the equations of motion in minimal coordinates, by heyoka (Biscani and Izzo 2021).

    heyoka compiles the equations for their Taylor coefficients; the ``step_tolerance`` sets the order of the
    series, 6 at 1e-4 and 20 at round-off, and with it the steps. It gives the motion alone: joint forces
    follow after the solve from the multiplier equations at the samples, works and losses from Gauss's
    quadrature of the series. There is an integrator for flight, and one for every combination of contacts
    (see ``equations``); touch, release and clipping are its terminal events. So are the ends of the pieces of
    drives, gas and other tables, and where coordinates cease to be fit as independent ones (see
    ``equations.partition``). The run's longest step holds in flight.

    On rigid walls an impact is Newton's, without friction. Where bounces come together the pin follows its
    wall, until that would have to pull. The run fails, and says when, where two pins hit at one time, or one
    hits while another follows: for these there is no rule here.

    It tells no evaluations: a step computes Taylor coefficients. A run fails that takes more than
    ``max_steps``; the default takes about a minute.
    """

    step_tolerance: Annotated[float, Field(ge=SHARPEST, lt=1)] = 1e-12
    max_steps: Annotated[int, Field(gt=0)] = 20_000_000
    any_mechanism: ClassVar[bool] = True
    compiles: ClassVar[bool] = True

    def check(self, scene: AnyScene) -> None:
        """Raise UnsupportedScene where there is no heyoka, no ODE, or no Taylor series of a contact."""
        if find_spec("heyoka") is None:
            raise UnsupportedScene(
                "heyoka is not installed: pip install heyoka (Linux, Python 3.11 or later), "
                "or conda install -c conda-forge heyoka.py (Linux, macOS, Windows)"
            )
        require_coordinates("heyoka", scene)
        for joint, clearance in scene.clearances.items():
            if (reason := _without_series(clearance)) is not None:
                raise UnsupportedScene(f"heyoka's model has no contact like that at {joint}: {reason}")

    def sharper(self) -> "HeyokaEngine":
        """Return the engine with a tenth of its tolerance."""
        return replace(self, step_tolerance=max(self.step_tolerance / 10, SHARPEST))

    def simulate(self, scene: AnyScene, settings: RunSettings) -> Trajectory:
        """Run the scene.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: a state that is not finite, or too many steps.
        """
        self.check(scene)
        require_memory(scene, settings)
        from engine_models.heyoka.reading import HeldDerivative, Reading

        reading = Reading(HeldDerivative(scene), settings.times_s(scene))
        flight = self._flown(scene, settings, reading.take)
        solution = reading.solution(flight.steps)
        longest = min(settings.step_s, scene.end_time_s)
        solve_time = self.bare_run(scene, settings).solve_time_s
        run = trajectory_of_solution(scene, solution, longest, solve_time, stabilised=False)
        return unwound(scene, require_finite(run))

    def bare_run(self, scene: AnyScene, settings: RunSettings) -> BareRun:
        """Return the same steps with no series kept; a first run before them compiles what they take.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        self.check(scene)
        if settings not in _systems(self, scene).run_with:
            self._flown(scene, settings)
        flight = self._flight(scene, settings)
        started = time.perf_counter()
        flight.run()
        return BareRun(time.perf_counter() - started, flight.position())

    def compile_time_s(self, scene: AnyScene, settings: RunSettings) -> float:
        """Return what heyoka takes to compile the integrators of a run, in s; it keeps none on disk."""
        self.check(scene)
        import heyoka

        _systems.cache_clear()
        heyoka.llvm_state.clear_memcache()
        return self.set_up_time_s(scene, settings)

    def set_up_time_s(self, scene: AnyScene, settings: RunSettings) -> float:
        """Return what a run takes besides its solve, in s; that is timed in a run of its own."""
        started = time.perf_counter()
        self._flown(scene, settings)
        return time.perf_counter() - started - self.bare_run(scene, settings).solve_time_s

    def _flown(
        self, scene: AnyScene, settings: RunSettings, take: "Callable[[Piece], None] | None" = None
    ) -> "Flight":
        """Return a run that has come to its end, whose pieces somebody may ``take``."""
        flight = self._flight(scene, settings)
        flight.run(take)
        _systems(self, scene).run_with.add(settings)
        return flight

    def _flight(self, scene: AnyScene, settings: RunSettings) -> "Flight":
        from engine_models.heyoka.run import Flight  # which imports heyoka, where there is one

        longest = min(settings.step_s, scene.end_time_s)
        return Flight(scene, _systems(self, scene), longest, self.max_steps)


@lru_cache(maxsize=1)
def _systems(engine: HeyokaEngine, scene: AnyScene) -> "Systems":
    """Return the integrators of a scene; of the same one again, the same."""
    from engine_models.heyoka.systems import Systems

    return Systems(scene, engine.step_tolerance)


def _without_series(clearance: Clearance) -> str | None:
    """Return what of a clearance has no Taylor series, None if all has."""
    if clearance.law == "rigid":
        return "friction in impacts on rigid walls (law = 'rigid')" if clearance.friction else None
    if (2 * exponent_of(clearance)) % 1 != 0:
        return f"twice the exponent is not whole (exponent = {exponent_of(clearance):g})"
    if clearance.friction is None:
        return None
    if clearance.friction.law != "tanh":
        return f"friction has kinks (friction.law = '{clearance.friction.law}')"
    return "friction stops where the force pulls (law = 'kelvin-voigt')" if clearance.damping_N_s_m else None

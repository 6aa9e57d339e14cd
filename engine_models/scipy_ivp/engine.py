"""SciPy's integrators on the reference's own equations: the pick of a user without an engine."""

import time
from dataclasses import replace
from functools import cache
from typing import Annotated, ClassVar, Literal

import numpy as np
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
from engine_models.mechanics.equations import trajectory_of_solution
from engine_models.mechanics.start_check import unwound
from engine_models.memory import require_memory
from engine_models.scene.scene import Scene
from engine_models.scipy_ivp.calls import COMPILED, Calls, Choice
from engine_models.scipy_ivp.derivative import Derivative
from engine_models.scipy_ivp.run import LocatedRun, switching_run

#: Room for rounding in the longest step, so that as many of them fill a run as should.
ROOM = 1e-9


#: The smallest relative tolerance.
SHARPEST = 1e-13


@dataclass(frozen=True, config=SETTINGS_CONFIG)
class ScipyEngine(Engine):
    """Settings of SciPy's integrators: the ``method``; ``rtol`` and ``atol``, the tolerances of a step.

    It integrates the multiplier equations (1)-(10) by the reference's compiled right-hand side, so that the
    two engines differ in the integrator and not in the equations. Every evaluation is one call of compiled
    code; the rest of its time is SciPy's own Python. No constraint is stabilised, as a plain user would have
    it: drift is part of the error and falls with the tolerance. ``atol`` is in m, rad, m/s and rad/s alike.
    Work, impulses and losses are integrated along but left out of the error control.

    Steps are chosen by the method, up to the run's longest, as if there were no samples: these come from the
    method's own interpolant, which is as good as the steps but for Radau's, of order 3. (The first step of
    ``odeint`` alone knows the first sample.)

    Contacts. With ``locate_events`` touch, release and the clipping of a force are terminal events, located
    on the interpolant, and the integration begins anew from there. Without it there is one integration over
    a force that switches by the sign of the penetration; the approach speed that a law needs is then taken
    where the first accepted step inside the wall ends (within that step the present speed stands for it),
    and no tolerance bounds what that costs. From rigid walls pins rebound at located touches by the
    reference's laws of impact, until bounces accumulate: a pin that is to follow its wall ends the run, which
    is this project's limit and not SciPy's. The kinks of a table by the crank's angle are not located: the
    error control shortens steps over them.

    LSODA can come to a standstill where ``atol`` is far below ``rtol`` times a typical value (ideal-driven
    with 1e-12 and 1e-6). ``odeint`` is the same method by an older call, and ``dop853`` DOP853 by an older
    class, ``scipy.integrate.ode``. Both have no events and so are for ideal joints alone; their loops over
    steps are compiled, and take a fifth to an eighth of ``solve_ivp``'s time. ``dop853`` has one ``atol`` for
    all, sums included, and no interpolant: a sample is a step of its own from the last step's end before it.
    A run fails that takes more than ``max_evaluations`` of the right-hand side (more steps between two
    samples, by ``odeint``); the default takes about a minute.
    """

    method: Literal["DOP853", "RK45", "LSODA", "Radau", "odeint", "dop853"] = "DOP853"
    rtol: Annotated[float, Field(ge=SHARPEST, lt=1)] = 1e-10
    atol: Annotated[float, Field(gt=0)] = 1e-12
    locate_events: bool = True
    max_evaluations: Annotated[int, Field(gt=0)] = 5_000_000
    any_mechanism: ClassVar[bool] = True

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where a scene's events need what the method, or this model, has not."""
        if self.method in COMPILED and scene.joints_with_clearance:
            raise UnsupportedScene(
                f"scipy's {self.method} has no events, and contacts need them: method = DOP853 or LSODA has"
            )
        rigid = {name: room for name, room in scene.clearances.items() if room.law == "rigid"}
        if rigid and not self.locate_events:
            raise UnsupportedScene(
                "scipy's pins rebound where their touch is located: locate_events = true (law = 'rigid' at "
                f"{', '.join(rigid)})"
            )
        for joint, room in rigid.items():
            if not room.restitution:
                raise UnsupportedScene(
                    "scipy's model has no pin that follows a rigid wall, as one does that does not rebound "
                    f"(clearance.{joint}.restitution = 0)"
                )

    def sharper(self) -> "ScipyEngine":
        """Return the engine with a tenth of its tolerances."""
        return replace(self, rtol=max(self.rtol / 10, SHARPEST), atol=self.atol / 10)

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene; ``steps`` counts the accepted ones.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: SciPy gives up or warns, a singular configuration, too many evaluations.
        """
        self.check(scene)
        require_memory(scene, settings)
        times = settings.times_s(scene)
        derivative, longest = Derivative(scene), min(settings.step_s, scene.end_time_s)
        located = self._located(scene)
        memory = None if located else np.full(derivative.contact_count, np.nan)
        calls = Calls(scene, derivative, self._choice(longest), memory)
        started = time.perf_counter()
        if located:
            record = LocatedRun(derivative, calls, times).run()
        else:
            record = switching_run(derivative, calls, times)
        solve_time = time.perf_counter() - started
        solution = derivative.solution(times, record.y, record.phases, record.ends, calls.steps)
        run = trajectory_of_solution(scene, solution, longest, solve_time, stabilised=False)
        return unwound(scene, require_finite(run))

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the same steps with nothing of ours between SciPy and the equations.

        Nobody watches such a run, so that a watched one shows before that it comes to its end. Without
        ``locate_events`` there is only that one: its right-hand side sets the contacts' phases.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        watched = _watched(self, scene, settings)
        if not self._located(scene):
            return watched
        derivative, longest = Derivative(scene), min(settings.step_s, scene.end_time_s)
        calls = Calls(scene, derivative, self._choice(longest), bare=True)
        run = LocatedRun(derivative, calls, np.array([0.0, scene.end_time_s]))
        with np.errstate(all="ignore"):
            started = time.perf_counter()
            record = run.run()
            solve_time = time.perf_counter() - started
        return BareRun(solve_time, record.y[-1][: derivative.n].reshape(-1, 3))

    def _located(self, scene: Scene) -> bool:
        """Return whether the run goes from event to event, which it does in one go if there are none."""
        return self.locate_events or not scene.joints_with_clearance

    def _choice(self, longest_s: float) -> Choice:
        return Choice(self.method, self.rtol, self.atol, longest_s * (1 + ROOM), self.max_evaluations)


@cache
def _watched(engine: ScipyEngine, scene: Scene, settings: RunSettings) -> BareRun:
    """Return the watched solve; of the same run again, the same."""
    run = engine.simulate(scene, settings)
    return BareRun(run.solve_time_s, run.position[-1])

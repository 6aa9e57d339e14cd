"""SciPy's integrators on minimal coordinates: the engine ``scipy``, and what reference solutions are by."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as settings_class

from engine_models.engine import SETTINGS_CONFIG, BareRun, Engine, RunSettings, Trajectory, UnsupportedScene
from engine_models.memory import require_memory
from engine_models.minimal import equations as eq
from engine_models.minimal.model import Model, damping_of, wall_of
from engine_models.minimal.run import Choice, solve
from engine_models.scene.scene import Scene

#: The smallest relative tolerance of the engine, and the least one that SciPy takes.
SHARPEST, LEAST_RTOL = 1e-13, 2.3e-14
#: Room for rounding in the longest step, so that as many of them fill a run as should.
ROOM = 1e-9
#: Times at which a drive is looked at for its speed.
LOOKS = 1000


@settings_class(frozen=True, config=SETTINGS_CONFIG)
class ScipyEngine(Engine):
    """Settings of SciPy's integrators: the ``method``; ``rtol`` and ``atol``, the tolerances of a step.

    It integrates Newton's equations in minimal coordinates (see ``equations``) by the classes of
    ``solve_ivp``: the usual pick of a user without a multibody code. Every evaluation is one call of compiled
    code, the same for all mechanisms; the rest of its time is SciPy's own Python and the search for events.
    ``atol`` is in m, rad, m/s and rad/s alike. Work, impulses and losses are integrated along but left out of
    the error control. Which coordinates depend on the others is chosen anew before that is badly posed; a run
    ends where it is for all of them, as in a singular or a limit position.

    Steps are chosen by the method, up to the run's longest, as if there were no samples: these come from the
    method's own interpolant, which is as good as the steps but for Radau's, of order 3.

    Contacts. Touch, release and the clipping of a force are located on the interpolant, and the integration
    begins anew from there. From rigid walls pins rebound with their restitution, until bounces accumulate: a
    pin that is to follow its wall ends the run, which is this project's limit and not SciPy's, and so is
    that on walls that do not give nothing rubs. The kinks of a table by an angle or a speed are not located:
    the error control shortens steps over them.

    LSODA can come to a standstill where ``atol`` is far below ``rtol`` times a typical value. A run fails
    that takes more than ``max_evaluations`` of the right-hand side; the default takes about a minute.
    """

    method: Literal["DOP853", "LSODA", "Radau"] = "DOP853"
    rtol: Annotated[float, Field(ge=SHARPEST, lt=1)] = 1e-10
    atol: Annotated[float, Field(gt=0)] = 1e-12
    max_evaluations: Annotated[int, Field(gt=0)] = 5_000_000

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where a contact has a law that is not known here, or a wall to follow."""
        for pin in scene.mechanism.loose:
            room = pin.clearance
            assert room is not None
            wall_of(room, damping_of)
            lacking = None
            if room.law == "rigid" and not room.restitution:
                lacking = (
                    "no pin that follows a rigid wall, as one does that does not rebound",
                    "restitution = 0",
                )
            elif room.law == "rigid" and room.friction is not None:
                lacking = (
                    "no friction on a rigid wall",
                    f"friction.coefficient = {room.friction.coefficient:g}",
                )
            if lacking is not None:
                raise UnsupportedScene(f"scipy's model has {lacking[0]} (clearance.{pin.name}.{lacking[1]})")

    def sharper(self) -> "ScipyEngine":
        """Return the engine with a tenth of its tolerances."""
        return replace(self, rtol=max(self.rtol / 10, SHARPEST), atol=self.atol / 10)

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the scene; ``steps`` counts the accepted ones.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: SciPy gives up or warns, a singular position, too many evaluations, or a pin
                that is to follow a rigid wall.
        """
        return self._solved(scene, settings)

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the same steps with nothing recorded but the end.

        Raises:
            UnsupportedScene, SimulationFailed: as ``simulate`` does.
        """
        run = self._solved(scene, replace(settings, samples=1, at_s=()), bare=True)
        return BareRun(run.solve_time_s, run.position[-1])

    def _solved(self, scene: Scene, settings: RunSettings, bare: bool = False) -> Trajectory:
        self.check(scene)
        require_memory(scene, settings)
        longest_s = min(settings.step_s, scene.end_time_s)

        def choice(model: Model) -> Choice:
            atol, limit_s = np.full(2 * model.size, self.atol), longest_s * (1 + ROOM)
            return Choice(self.method, self.rtol, atol, limit_s, self.max_evaluations, bare=bare)

        return replace(solve(scene, settings, choice), step_s=longest_s)


@dataclass(frozen=True)
class SharpSolver:
    """DOP853 in minimal coordinates at a tolerance in parts of typical sizes, works and impulses included."""

    tolerance: float = 1e-14

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run a scene; steps are as long as the tolerance lets them be, and end at events.

        Raises:
            UnsupportedScene: a law is not known here.
            AdapterCannot: a pin follows a rigid wall, or rubs on it; loops are singular.
            LimitPosition: what is driven cannot go on.
            SimulationFailed: there is no start, or steps would be too many or too short.
        """
        return solve(scene, settings, self.choice)

    def choice(self, model: Model) -> Choice:
        """Return the tolerances by typical sizes of coordinates, rates, impulses and works."""
        end_s, m = model.scene.end_time_s, model.rows
        q, v = model.start[: model.size], model.start[model.size : 2 * model.size]
        rate = max(1 / end_s, float(np.abs(v / model.unit).max()))
        if model.of.drive.prescribes:
            unit = 1.0 if model.of.drive.guide is None else model.lever_m
            speeds = [model.look(t, q, v)[2][m - 1] for t in np.linspace(0.0, end_s, LOOKS).tolist()]
            rate = max(rate, float(np.abs(speeds).max()) / unit)
        speed = rate * model.lever_m
        impulse = sum(body.mass_kg for body in model.of.bodies) * speed
        works = len(model.sums) - eq.OF_SUMS * len(model.phases)
        of_contact = [impulse, *[impulse * speed] * (eq.OF_SUMS - 1)]
        sums = [*of_contact * len(model.phases), *[impulse * speed] * works]
        unit = model.unit.copy()
        if model.of.loose:  # their pins move in their bearings
            unit[np.arange(model.size) % 3 != 2] = model.contacts[:, eq.C].min()
        atol = self.tolerance * np.concatenate([unit, rate * unit, sums])
        return Choice("DOP853", max(self.tolerance, LEAST_RTOL), atol, sharp=True)

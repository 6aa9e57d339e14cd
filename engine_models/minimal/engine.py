"""SciPy's integrators on minimal coordinates: the engine ``scipy``, and what reference solutions are by."""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as settings_class

from engine_models.engine import STRICT, BareRun, Engine, RunSettings, Trajectory, UnsupportedScene
from engine_models.minimal import equations as eq
from engine_models.minimal.model import Model, damping_of, wall_of
from engine_models.minimal.run import Choice, solve
from engine_models.scene.scene import Scene
from engine_models.watch import require_memory

#: The smallest relative tolerance of the engine, and the least one that SciPy takes.
SHARPEST, LEAST_RTOL = 1e-13, 2.3e-14
#: Room for rounding in the longest step, so that as many of them fill a run as should.
ROOM = 1e-9
#: Times at which a drive is looked at for its speed.
LOOKS = 1000


@settings_class(frozen=True, config=STRICT)
class ScipyEngine(Engine):
    """Settings of SciPy's integrators: the ``method``; ``rtol`` and ``atol``, the tolerances of a step.

    It integrates Newton's equations in minimal coordinates (see ``equations``) by the classes of
    ``solve_ivp``: the usual pick of a user without a multibody code. Every evaluation is one call of compiled
    code; the rest of its time is SciPy's own Python and the search for events. ``atol`` is in m, rad, m/s and
    rad/s alike. Work, impulses and losses are integrated along but left out of the error control.

    Steps are chosen by the method, up to the run's longest, as if there were no samples: these come from the
    method's own interpolant, which is as good as the steps but for Radau's, of order 3. Touch, release and
    clipping of a contact's force are located on it, and the integration begins anew from there; the kinks of
    a table by an angle or a speed are not. A pin that is to follow its rigid wall, or to rub on it, ends the
    run, and so does a singular position: these are this project's limits and not SciPy's.

    LSODA can come to a standstill where ``atol`` is far below ``rtol`` times a typical value. A run fails
    that takes more than ``max_evaluations`` of the right-hand side; the default takes about a minute.
    """

    method: Literal["DOP853", "LSODA", "Radau"] = "DOP853"
    rtol: Annotated[float, Field(ge=SHARPEST, lt=1)] = 1e-10
    atol: Annotated[float, Field(gt=0)] = 1e-12
    max_evaluations: Annotated[int, Field(gt=0)] = 5_000_000

    def check(self, scene: Scene) -> None:
        """Raise UnsupportedScene where a contact has a law that is not known here, or a wall to follow."""
        for name, room in scene.clearances.items():
            wall_of(room.data(), damping_of)
            if room.law != "rigid":
                continue
            at = f"rigid wall (clearance.{name}.law = 'rigid'"
            if not room.restitution:
                raise UnsupportedScene(f"scipy's model has no pin that follows a {at}, restitution = 0)")
            if room.friction is not None:
                raise UnsupportedScene(f"scipy's model has no friction on a {at})")

    def sharper(self) -> "ScipyEngine":
        """Return the engine with a tenth of its tolerances."""
        return replace(self, rtol=max(self.rtol / 10, SHARPEST), atol=self.atol / 10)

    def bare_run(self, scene: Scene, settings: RunSettings) -> BareRun:
        """Return the same steps with nothing recorded but the end."""
        run = self.simulate(scene, replace(settings, samples=1, at_s=()), bare=True)
        return BareRun(run.solve_time_s, run.position[-1])

    def simulate(self, scene: Scene, settings: RunSettings, bare: bool = False) -> Trajectory:
        """Run the scene; ``steps`` counts the accepted ones. Of ``bare`` runs impacts have no largest force.

        Raises:
            UnsupportedScene: see ``check``.
            SimulationFailed: SciPy gives up or warns, a singular position, too many evaluations, or a pin
                that is to follow a rigid wall.
        """
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
            SimulationFailed: a pin follows a rigid wall, or rubs on it; a position is singular.
        """
        return solve(scene, settings, self.choice)

    def choice(self, model: Model) -> Choice:
        """Return the tolerances by typical sizes of coordinates, rates, impulses and works."""
        end_s, of, contacts = model.scene.end_time_s, model.of, len(model.contacts)
        q, v = model.start[: model.size], model.start[model.size : 2 * model.size]
        rate = max(1 / end_s, float(np.abs(v / model.unit).max()))
        if of.drive.prescribes:
            unit = 1.0 if of.drive.guide is None else model.lever_m
            speeds = [model.look(t, q, v)[2][-1] for t in np.linspace(0.0, end_s, LOOKS).tolist()]
            rate = max(rate, float(np.abs(speeds).max()) / unit)
        speed = rate * model.lever_m
        impulse = sum(body.mass_kg for body in of.bodies) * speed
        sums = np.full(len(model.sums), impulse * speed)
        sums[: eq.OF_SUMS * contacts : eq.OF_SUMS] = impulse
        unit = model.unit.copy()
        if contacts:  # their pins move in their bearings
            unit[np.arange(model.size) % 3 != 2] = model.contacts[:, eq.C].min()
        atol = self.tolerance * np.concatenate([unit, rate * unit, sums])
        return Choice("DOP853", max(self.tolerance, LEAST_RTOL), atol, sharp=True)

"""The independent solver at its sharpest: DOP853 near round-off, whose runs are reference solutions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import RunSettings, Trajectory
from engine_models.minimal import equations as eq
from engine_models.minimal.model import Model
from engine_models.minimal.run import Choice, solve
from engine_models.scene.scene import Scene

FloatArray = NDArray[np.float64]
#: The least relative tolerance that SciPy takes, and times at which a drive is looked at for its speed.
LEAST_RTOL, LOOKS = 2.3e-14, 1000


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

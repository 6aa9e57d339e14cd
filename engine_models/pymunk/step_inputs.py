"""What a run sets before each of its steps: the speed of a crank, torques and forces.

A step ends by clearing the loads on its bodies, and a driven crank turns on at the speed that it was given
last. What is known beforehand is computed block by block, outside of the time of the run, and set as numbers.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.slider_load import gas_force
from engine_models.pymunk.model import Model
from engine_models.scene.drives import TorqueDrive

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

#: Called with the number of the step to come.
Input = Callable[[int], None]


class StepInputs:
    """The inputs of a model's steps of ``step_s``; step 0 is the half kick, which moves nothing.

    Made before the first step, since the crank's angle counts from where it then is.
    """

    def __init__(self, model: Model, step_s: float) -> None:
        self._scene, self._bodies, self._dt = model.scene, model.bodies, step_s
        self._start_angle = float(model.bodies[0].angle)
        self._motion = crank_motion(model.scene)

    def of(self, first: int, last: int) -> list[Input]:
        """Return what has to be called before each of the steps from first to last."""
        drive, load, steps = self._scene.drive, self._scene.load.slider, np.arange(first, last + 1)
        inputs: list[Input] = []
        if isinstance(drive, TorqueDrive):
            inputs.append(self._torque(drive.torque_N_m))
        elif self._motion is not None and drive.kind != "constant-speed":
            inputs.append(self._turn(steps))
        if load is not None and load.gas is not None:
            inputs.append(
                self._known_gas(steps) if self._motion is not None else self._gas(load.gas.spline())
            )
        elif load is not None and load.force_N:
            inputs.append(self._force(load.force_N))
        return inputs

    def _torque(self, torque_N_m: float) -> Input:
        crank = self._bodies[0]

        def turn(_: int) -> None:
            crank.torque = torque_N_m

        return turn

    def _force(self, force_N: float) -> Input:
        slider, force = self._bodies[2], (force_N, 0.0)

        def push(_: int) -> None:
            slider.force = force

        return push

    def _turn(self, steps: NDArray[np.int64]) -> Input:
        """Give the crank the speed of half a step later, and the angle that leads it to its own in this step.

        The joints' impulses of kick k are those of the speed at t_k + dt/2, as of any other velocity after
        it. The step moves the crank first, though, by the same speed.
        """
        assert self._motion is not None
        crank, first = self._bodies[0], int(steps[0])
        speed = self._motion.speed_rad_s(np.asarray((steps + 0.5) * self._dt, dtype=np.float64))
        moved = np.where(steps > 0, self._dt, 0.0) * speed
        speeds, angles = speed.tolist(), (self._angle(steps) - moved).tolist()

        def turn(step: int) -> None:
            crank.angle = angles[step - first]
            crank.angular_velocity = speeds[step - first]

        return turn

    def _known_gas(self, steps: NDArray[np.int64]) -> Input:
        """Push by the gas, and by the constant force, where the crank's angles are prescribed."""
        slider, first = self._bodies[2], int(steps[0])
        force = gas_force(self._scene)(self._angle(steps)) + self._constant_force
        forces = [(one, 0.0) for one in force.tolist()]

        def push(step: int) -> None:
            slider.force = forces[step - first]

        return push

    def _gas(self, spline: "CubicSpline") -> Input:
        """Push by the gas, and by the constant force, at the angle to which the step will move the crank."""
        crank, _, slider = self._bodies
        value, constant, dt = of_a_number(spline), self._constant_force, self._dt

        def push(step: int) -> None:
            moved = dt * crank.angular_velocity if step else 0.0
            slider.force = value(crank.angle + moved) + constant, 0.0

        return push

    @property
    def _constant_force(self) -> float:
        load = self._scene.load.slider
        return 0.0 if load is None else load.force_N or 0.0

    def _angle(self, steps: NDArray[np.int64]) -> FloatArray:
        """Return the crank's angles (n,) at steps (n,)."""
        assert self._motion is not None
        time = np.asarray(steps * self._dt, dtype=np.float64)
        return np.asarray(self._start_angle + self._motion.turned_rad(time))


def of_a_number(spline: "CubicSpline") -> Callable[[float], float]:
    """Return a spline of period 2 pi as a function of one number, fifty times as fast as SciPy's."""
    begins, pieces = spline.x[:-1].tolist(), spline.c.T.tolist()
    first, turn = begins[0], 2 * math.pi

    def value(angle: float) -> float:
        at = first + (angle - first) % turn
        piece = bisect_right(begins, at) - 1
        a, b, c, d = pieces[piece]
        part = at - begins[piece]
        return float(((a * part + b) * part + c) * part + d)

    return value

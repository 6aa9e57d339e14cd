"""What a run sets before each of its steps: the speed of a crank, torques and forces, as numbers.

A step ends by clearing the loads on its bodies, and a driven crank turns on at the speed that it was given
last. What is known beforehand is computed block by block, outside of the time of the run.
"""

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.scene.drives import TorqueDrive
from engine_models.scene.scene import Scene


class StepInputs:
    """The inputs of a scene's steps of ``step_s``; step 0 is the half kick, which moves nothing.

    The crank's angle counts from ``start_angle_rad``, where its body is at t = 0.
    """

    def __init__(self, scene: Scene, start_angle_rad: float, step_s: float) -> None:
        self._scene, self._start_angle, self._dt = scene, start_angle_rad, step_s
        self._motion, load = crank_motion(scene), scene.load.slider
        drive, self._gas = scene.drive, None if load is None else load.gas
        #: The constant torque on the crank in N m, and the constant force on the slider in N.
        self.torque_N_m = drive.constant_N_m if isinstance(drive, TorqueDrive) else 0.0
        self.force_N = 0.0 if load is None else load.force_N or 0.0

    def turns(self, steps: NDArray[np.int64]) -> FloatArray:
        """Return the crank's angle before steps (n,) and its speed in them, (n, 2); (0, 2) if it is constant.

        The speed is that of half a step later, and the angle leads it to its own in the step: the joints'
        impulses of kick k are those of the speed at t_k + dt/2, as of any other velocity after it. The step
        moves the crank first, though, by the same speed.
        """
        if self._motion is None or self._scene.drive.kind == "constant-speed":
            return np.zeros((0, 2))
        speed = self._motion.speed_rad_s(np.asarray((steps + 0.5) * self._dt, dtype=np.float64))
        moved = np.where(steps > 0, self._dt, 0.0) * speed
        return np.column_stack([self._angle(steps) - moved, speed])

    def gas_table(self) -> FloatArray:
        """Return the pieces (n, 5) of the gas's force for ``loop.gas_force``."""
        if self._gas is None:
            return np.zeros((0, 5))
        spline = self._gas.spline()
        return np.column_stack([spline.x[:-1], spline.c.T])

    def _angle(self, steps: NDArray[np.int64]) -> FloatArray:
        """Return the crank's angles (n,) at steps (n,)."""
        assert self._motion is not None
        time = np.asarray(steps * self._dt, dtype=np.float64)
        return np.asarray(self._start_angle + self._motion.turned_rad(time))

"""Works of drivers and loads that are no matter of positions alone: added up over the kicks of a run."""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, SLIDER
from engine_models.mechanics.loads import integrated_parts, slider_forces
from engine_models.scene.scene import Scene
from reference_solver.mechanism.motor import motor_torque

#: The driver's among the works, beside the parts of the slider's load.
DRIVER = "driver"


def add_up(scene: Scene) -> bool:
    """Return whether a scene has such works, which take all steps and not its samples alone."""
    return scene.speed_is_prescribed or scene.drive.kind == "motor" or bool(integrated_parts(scene))


class Works:
    """The works since t = 0 of a run, block by block."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._motion = scene, crank_motion(scene)
        self._sums: dict[str, float] = {}

    def since_start(
        self,
        time_s: FloatArray,
        kick_s: FloatArray,
        share: FloatArray,
        position: FloatArray,
        felt: FloatArray,
        mean: FloatArray,
        torque_N_m: FloatArray | None,
    ) -> dict[str, FloatArray]:
        """Return the works in J of the driver and of the parts of the load (n,) at kicks.

        Those are at ``time_s`` (n,), and loads act for ``kick_s`` (n,) in each. Of velocities (n, bodies, 3)
        the loads go by those ``felt``, and a load does its work on the ``mean`` of before and after a kick.
        ``torque_N_m`` (n,) is that of a prescribed speed. ``share`` (n,) of the work at a step is before its
        sample; in smooth motion that is half, and the rule the trapezoidal one.
        """
        scene = self._scene
        forces = slider_forces(scene, position, felt)
        kicks = {part: kick_s * mean[:, SLIDER, 0] * forces[part] for part in integrated_parts(scene)}
        if self._motion is not None and torque_N_m is not None:
            kicks[DRIVER] = kick_s * self._motion.speed_rad_s(time_s) * torque_N_m
        elif scene.drive.kind == "motor":
            kicks[DRIVER] = kick_s * mean[:, CRANK, 2] * motor_torque(scene.drive.line, felt[:, CRANK, 2])
        return self._added(kicks, time_s, share)

    def _added(
        self, kicks: Mapping[str, FloatArray], time_s: FloatArray, share: FloatArray
    ) -> dict[str, FloatArray]:
        works = {}
        for name, kick in kicks.items():
            sums = np.cumsum(np.append(self._sums.get(name, 0.0), kick))
            self._sums[name] = float(sums[-1])
            works[name] = sums[:-1] + share * kick
            works[name][time_s == 0] = 0.0
        return works

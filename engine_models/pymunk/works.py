"""Works of drives and loads that do not follow from positions: added up over the kicks of a run."""

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.crank_motion import motion_of
from engine_models.mechanics.loads import integrated_works, load_powers_W
from engine_models.scene.scene import Scene

#: The drive's among the works, as ``integrated_works`` has it.
DRIVE = "driver"


class Works:
    """The works since t = 0 of a run, block by block, by the names of ``integrated_works``."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._names = scene, integrated_works(scene)
        self._sums = dict.fromkeys(self._names, 0.0)

    def since_start(
        self,
        time_s: FloatArray,
        kick_s: FloatArray,
        share: FloatArray,
        position: FloatArray,
        mean: FloatArray,
        effort: FloatArray | None,
    ) -> dict[str, FloatArray]:
        """Return the works in J (n,) at kicks at ``time_s`` (n,), in which loads act for ``kick_s`` (n,).

        They go by the ``mean`` velocities (n, bodies, 3) of before and after each kick. ``effort`` (n,) is
        the drive's torque or force. ``share`` (n,) of the work at a step is before its sample; in smooth
        motion that is half, and the rule the trapezoidal one.
        """
        drive, powers = self._scene.mechanism.drive, load_powers_W(self._scene, time_s, position, mean)
        if DRIVE in self._names and effort is not None:
            motion = motion_of(drive)
            powers[DRIVE] = effort * (
                mean[:, drive.body, 2] if motion is None else motion.speed_rad_s(time_s)
            )
        works = {}
        for name, power in powers.items():
            kick = kick_s * power
            sums = np.cumsum(np.append(self._sums[name], kick))
            self._sums[name] = float(sums[-1])
            works[name] = sums[:-1] + share * kick
            works[name][time_s == 0] = 0.0
        return works

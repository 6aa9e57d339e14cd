"""The gas of a small single-acting compressor, as a table: its force on the slider over one revolution."""

import math

from engine_models.scene.loads import Gas
from engine_models.scene.scene import Link

#: Bore in m; absolute pressures of suction and discharge in Pa, that of the air behind the piston being the
#: first; the volume left at the outer dead centre as a part of the swept one; the polytropic exponent.
BORE_M, SUCTION_PA, DISCHARGE_PA, DEAD_PART, POLYTROPIC = 0.03, 1e5, 6e5, 0.08, 1.3
#: Entries of the table: one every ten degrees, and the first again.
ENTRIES = 37


def gas(crank: Link, rod: Link) -> Gas:
    """Return the gas of a cylinder beyond the slider's outer dead centre, at crank angle 0.

    Going inwards the gas left expands to the suction pressure, and the cylinder fills; going outwards it is
    compressed to the discharge pressure, and let out. Forces are in whole newtons.
    """
    r, length, area = crank.length_m, rod.length_m, math.pi / 4 * BORE_M**2
    dead = DEAD_PART * 2 * r

    def height(angle: float) -> float:
        """Return the height of the gas in m."""
        x = r * math.cos(angle) + math.sqrt(length**2 - (r * math.sin(angle)) ** 2)
        return dead + r + length - x

    def pressure(angle: float) -> float:
        if angle <= math.pi:
            return max(SUCTION_PA, DISCHARGE_PA * math.pow(dead / height(angle), POLYTROPIC))
        return min(DISCHARGE_PA, SUCTION_PA * math.pow(height(math.pi) / height(angle), POLYTROPIC))

    angles = [2 * math.pi * k / (ENTRIES - 1) for k in range(ENTRIES)]
    forces = [float(round(-area * (pressure(angle) - SUCTION_PA))) for angle in angles]
    return Gas(crank_angle_rad=tuple(angles), force_N=tuple(forces))

"""Loads that Exudyn calls as a function of Python: compiled, on the numbers of ``minimal.equations``."""

from collections.abc import Container

import numpy as np
from numba.extending import register_jitable

from engine_models.engine import FloatArray
from engine_models.exudyn.motion import carry, place_bodies
from engine_models.minimal import equations as eq
from engine_models.minimal.model import Numbers
from reference_solver.machine_code import compiled
from reference_solver.mechanism.data import MechanismData

for each in (carry, place_bodies):
    register_jitable(each)


def numbers_of(of: MechanismData, names: Container[str]) -> FloatArray:
    """Return the numbers of a mechanism without weights, with no other loads than those of these names."""
    numbers = Numbers(of, np.zeros(3 * len(of.bodies)), lambda *_: 0.0)
    numbers.block(eq.SCALARS)[0, [eq.GX, eq.GY]] = 0.0
    others = [name not in names for name in numbers.parts]
    numbers.block(eq.PARTS)[others, eq.CONSTANT : eq.FREE + 1] = 0.0
    return numbers.p


@compiled("(f8[::1], f8[:, ::1], f8, f8[::1], f8[::1], f8[:, ::1], f8[::1])", error_model="numpy")
def generalised(
    p: FloatArray, links: FloatArray, t: float, s: FloatArray, r: FloatArray, at: FloatArray, out: FloatArray
) -> None:
    """Fill what the loads of p put on every link, out (links,); ``at`` (3, 3b) has bodies without a link."""
    frames, unit, still = np.empty((len(links), 9)), np.zeros(len(links)), np.zeros(len(links))
    F, moved, told, powers = np.zeros(at.shape[1]), np.zeros(at.shape), np.empty(p.size), np.empty(p.size)
    place_bodies(links, s, r, still, frames, at)
    eq.forces(p, t, at[0], at[1], F, told, powers)
    for k in range(len(links)):
        unit[k] = 1.0
        place_bodies(links, s, unit, still, frames, moved)
        out[k] = np.sum(F * moved[1])
        unit[k] = 0.0

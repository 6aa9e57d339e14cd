"""The scene's compliant contact and friction laws: their constants, and their forces in one contact.

F = K delta^n (1 + a(e) delta'/v0) + c delta', v0 the approach speed at touch, not below its floor.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

from engine_models.scene.scene import HERTZ_EXPONENT, LINEAR_LAWS, Clearance, ContactLaw

#: a(e) of each law that has one, e the nominal restitution.
DAMPING_FACTORS: dict[ContactLaw, Callable[[float], float]] = {
    "hunt-crossley": lambda e: 3 * (1 - e) / 2,
    "lankarani-nikravesh": lambda e: 3 * (1 - e**2) / 4,
    "gonthier": lambda e: (1 - e**2) / e,
    "zhiying-qishao": lambda e: 3 * (1 - e**2) / 4 * math.exp(2 * (1 - e)),
    "flores": lambda e: 8 * (1 - e) / (5 * e),
    "hu-guo": lambda e: 3 * (1 - e) / (2 * e),
    "carvalho-martins": lambda e: 3 / 2 * (1 - e) * (11 - e) / (1 + 9 * e),
}
#: Floor of the approach speed in laws that divide by it, where the scene gives none.
MINIMUM_IMPACT_SPEED_M_S = 1e-6


def exponent_of(clearance: Clearance) -> float:
    """Return the exponent n of F = K delta^n: as given, else 1 for the linear laws and 3/2 for the others."""
    if clearance.exponent is not None:
        return clearance.exponent
    return 1.0 if clearance.law in LINEAR_LAWS else HERTZ_EXPONENT


def stiffness_of(clearance: Clearance) -> float:
    """Return K in N/m^n: as given, else Hertz's value for a pin in a hole of the same material.

    K = 4/(3 (s_i + s_j)) sqrt(R_i R_j/(R_i - R_j)) with s = (1 - nu^2)/E (Goldsmith 1960).
    """
    if clearance.stiffness is not None:
        return clearance.stiffness
    assert clearance.young_modulus_Pa is not None
    assert clearance.poisson_ratio is not None
    bearing, c = clearance.bearing_radius_m, clearance.radial_clearance_m
    s = (1 - clearance.poisson_ratio**2) / clearance.young_modulus_Pa
    return 4 / (6 * s) * math.sqrt(bearing * (bearing - c) / c)


def damping_factor_of(clearance: Clearance) -> float:
    """Return a(e); 0 for the laws that know no restitution."""
    factor = DAMPING_FACTORS.get(clearance.law)
    return 0.0 if factor is None or clearance.restitution is None else factor(clearance.restitution)


def minimum_impact_speed_of(clearance: Clearance) -> float:
    """Return the floor of v0 in m/s."""
    return clearance.minimum_impact_speed_m_s or MINIMUM_IMPACT_SPEED_M_S


def clips(clearance: Clearance) -> bool:
    """Return whether the force is ever zero where the law would pull; Kelvin-Voigt's is left as it is."""
    return damping_factor_of(clearance) != 0 and not clearance.may_pull


class LawNumbers(NamedTuple):
    """The constants of a clearance's law of normal force and friction, as its formulas take them.

    ``floor`` is that of the approach speed in m/s; without friction ``coefficient`` is 0. ``full`` and
    ``dead`` are the sliding speeds in m/s from which all of the friction acts, and up to which none does.
    """

    stiffness: float
    exponent: float
    factor: float
    damping: float
    floor: float
    clips: bool
    coefficient: float = 0.0
    full: float = 1.0
    dead: float = 0.0
    smooth: bool = False


def law_numbers(clearance: Clearance) -> LawNumbers:
    """Return the constants of a compliant clearance's law."""
    normal = (
        stiffness_of(clearance),
        exponent_of(clearance),
        damping_factor_of(clearance),
        clearance.damping_N_s_m or 0.0,
        minimum_impact_speed_of(clearance),
        clips(clearance),
    )
    friction = clearance.friction
    if friction is None:
        return LawNumbers(*normal)
    dead = friction.dead_band_speed_m_s or 0.0  # Ambrosio's alone has one
    full, smooth = friction.regularisation_speed_m_s, friction.law == "tanh"
    return LawNumbers(*normal, friction.coefficient, full, dead, smooth)


# Numba compiles these two as they stand, for records with the fields of ``LawNumbers``.


def normal_force(law: LawNumbers, delta: float, rate: float, approach: float) -> tuple[float, float, bool]:
    """Return the force in N, its elastic part, and whether it is clipped, with v0 = ``approach``.

    It pushes if positive, until delta = 0; see ``clips``.
    """
    spring = law.stiffness * delta**law.exponent
    share = 1 + law.factor * rate / max(approach, law.floor)
    if share < 0 and law.clips:
        return 0.0, spring, True
    return spring * share + law.damping * rate, spring, False


def friction_force(law: LawNumbers, normal: float, sliding: float) -> float:
    """Return the force in N along the pin's sliding, of speed ``sliding`` in m/s; none where normal pulls."""
    if law.smooth:
        share = math.tanh(sliding / law.full)
    else:
        share = math.copysign(min(1.0, max(0.0, (abs(sliding) - law.dead) / (law.full - law.dead))), sliding)
    return -law.coefficient * max(normal, 0.0) * share

"""Compliant contact laws and friction laws of a pin in its bearing, as data and closed-form factors.

All dissipative laws are one family, F = K delta^n (1 + a(e) delta'/v0), with v0 the approach speed at the
start of the present contact; Kelvin and Voigt's is F = k delta + c delta'.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

#: Damping factor a(e) by law, e the nominal restitution.
DAMPING_FACTORS: Mapping[str, Callable[[float], float]] = MappingProxyType(
    {
        "hunt-crossley": lambda e: 3 * (1 - e) / 2,
        "lankarani-nikravesh": lambda e: 3 * (1 - e**2) / 4,
        "gonthier": lambda e: (1 - e**2) / e,
        "zhiying-qishao": lambda e: 3 * (1 - e**2) / 4 * math.exp(2 * (1 - e)),
        "flores": lambda e: 8 * (1 - e) / (5 * e),
        "hu-guo": lambda e: 3 * (1 - e) / (2 * e),
        "carvalho-martins": lambda e: 3 / 2 * (1 - e) * (11 - e) / (1 + 9 * e),
    }
)


@dataclass(frozen=True)
class ContactLaw:
    """Normal force K delta^n (1 + a delta'/v0) + c delta', K in N/m^n, c in N s/m.

    ``damping_factor`` is a; v0 is floored at ``minimum_impact_speed_m_s``. Where the first factor turns
    negative the law would pull: the force is zero there, unless it ``may_pull``. Kelvin-Voigt's force is left
    as it is until delta = 0.
    """

    stiffness: float
    exponent: float = 1.5
    damping_factor: float = 0.0
    damping_N_s_m: float = 0.0
    minimum_impact_speed_m_s: float = 1e-6
    may_pull: bool = False

    @property
    def clipped(self) -> bool:
        """Whether the force is clipped where the law would pull."""
        return self.damping_factor != 0 and not self.may_pull


@dataclass(frozen=True)
class FrictionLaw:
    """Friction force mu F_n f(v) against the sliding speed v at the contact point; none where F_n is clipped.

    Where a law may pull, F_n is negative and friction drives the sliding, as Exudyn's contact has it.

    f is: saturated linear, v/v_reg up to 1; Ambrosio's (2003), 0 below the dead band, linear from there to 1
    at v_reg; or tanh(v/v_reg).
    """

    kind: Literal["saturated-linear", "ambrosio", "tanh"]
    coefficient: float
    regularisation_speed_m_s: float
    dead_band_speed_m_s: float = 0.0

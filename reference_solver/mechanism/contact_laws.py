"""Compliant contact laws and friction laws of a pin in its bearing: their data, and one function for each.

A normal law is a function of the penetration delta >= 0, its rate and the ``memory`` of the present contact,
set at its touch; it returns the elastic force, which has a potential, and the coefficient of the rate in the
rest, which dissipates: F = elastic + damper delta'. A new law is a function and a line in ``NORMAL_LAWS``.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, Protocol

import numpy as np

from reference_solver.checks import (
    is_number,
    require,
    require_below,
    require_not_negative,
    require_positive,
)
from reference_solver.mechanism.data import HERTZ_EXPONENT, LINEAR_LAWS
from reference_solver.mechanism.lifting import WRITTEN_OUT
from reference_solver.tape import Array, FloatArray, Scalar, larger, power, signed, size, smaller, sqrt, tanh

#: Floor of the approach speed in laws that divide by it, where no other is given.
MINIMUM_IMPACT_SPEED_M_S = 1e-6
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


def hertz_stiffness(E_Pa: float, poisson_ratio: float, bearing_m: float, clearance_m: float) -> float:
    """Return K in N/m^1.5 of a pin in a hole of the same material, by the hole's radius and the clearance.

    K = 4/(3 (s_i + s_j)) sqrt(R_i R_j/(R_i - R_j)) with s = (1 - nu^2)/E (Goldsmith 1960).
    """
    s = (1 - poisson_ratio**2) / E_Pa
    return 4 / (6 * s) * math.sqrt(bearing_m * (bearing_m - clearance_m) / clearance_m)


def stored_J(stiffness: Array, exponent: Array, depth_m: Array) -> FloatArray:
    """Return what the elastic force K delta^n stores, K delta^(n+1)/(n+1), at depths; 0 at negative ones."""
    power = exponent + 1
    return np.asarray(stiffness * np.maximum(depth_m, 0.0) ** power / power)


class Room(Protocol):
    """A clearance's law as a file has it: see ``data.ClearanceData``."""

    @property
    def law(self) -> str: ...  # noqa: D102
    @property
    def radial_clearance_m(self) -> float: ...  # noqa: D102
    @property
    def bearing_radius_m(self) -> float: ...  # noqa: D102
    @property
    def stiffness(self) -> float | None: ...  # noqa: D102
    @property
    def young_modulus_Pa(self) -> float | None: ...  # noqa: D102
    @property
    def poisson_ratio(self) -> float | None: ...  # noqa: D102
    @property
    def exponent(self) -> float | None: ...  # noqa: D102
    @property
    def restitution(self) -> float | None: ...  # noqa: D102
    @property
    def minimum_impact_speed_m_s(self) -> float | None: ...  # noqa: D102
    @property
    def may_pull(self) -> bool: ...  # noqa: D102


def exponent_of(room: Room) -> float:
    """Return the exponent n of F = K delta^n: as given, else 1 for the linear laws and 3/2 for the others."""
    if room.exponent is not None:
        return room.exponent
    return 1.0 if room.law in LINEAR_LAWS else HERTZ_EXPONENT


def stiffness_of(room: Room) -> float:
    """Return K in N/m^n: as given, else Hertz's value for a pin in a hole of the same material."""
    if room.stiffness is not None:
        return room.stiffness
    assert room.young_modulus_Pa is not None
    assert room.poisson_ratio is not None
    material = room.young_modulus_Pa, room.poisson_ratio
    return hertz_stiffness(*material, room.bearing_radius_m, room.radial_clearance_m)


def damping_factor_of(room: Room) -> float:
    """Return a(e); 0 for the laws that know no restitution."""
    factor = DAMPING_FACTORS.get(room.law)
    return 0.0 if factor is None or room.restitution is None else factor(room.restitution)


def minimum_impact_speed_of(room: Room) -> float:
    """Return the floor of v0 in m/s."""
    return room.minimum_impact_speed_m_s or MINIMUM_IMPACT_SPEED_M_S


def clips(room: Room) -> bool:
    """Return whether the force is ever zero where the law would pull; Kelvin-Voigt's is left as it is."""
    return damping_factor_of(room) != 0 and not room.may_pull


@dataclass(frozen=True)
class ContactLaw:
    """A pin's normal force: stiffness K in N/m^n, damping c in N s/m (of law "kuwabara-kono" in N s/m^1.5).

    Of law "dissipative" ``damping_factor`` is a; v0 is floored at ``minimum_impact_speed_m_s``. Where its
    first factor turns negative it would pull: the force is zero there, unless it ``may_pull``. Kelvin-Voigt's
    force is left as it is until delta = 0.
    """

    stiffness: float
    exponent: float = field(default=1.5, metadata={WRITTEN_OUT: (1.0, 1.5)})
    damping_factor: float = 0.0
    damping_N_s_m: float = 0.0
    minimum_impact_speed_m_s: float = MINIMUM_IMPACT_SPEED_M_S
    may_pull: bool = False
    kind: str = "dissipative"

    def __post_init__(self) -> None:
        n, kind = self.exponent, self.kind
        require("ContactLaw.kind", kind, kind in NORMAL_LAWS, " or ".join(NORMAL_LAWS))
        require("ContactLaw.exponent", n, is_number(n) and n >= 1, "a finite number >= 1")
        require_positive(self, "stiffness")
        require_not_negative(self, "damping_factor", "damping_N_s_m", "minimum_impact_speed_m_s")

    @property
    def clipped(self) -> bool:
        """Whether the force is clipped where the law would pull."""
        return (self.damping_factor != 0 or self.kind != "dissipative") and not self.may_pull


@dataclass(frozen=True)
class RigidWall:
    """A wall that does not give (see ``impacts``): Newton's restitution, of the normal speed.

    An approach slower than ``minimum_impact_speed_m_s`` closes without rebound.
    """

    restitution: float
    minimum_impact_speed_m_s: float = 0.0

    def __post_init__(self) -> None:
        e = self.restitution
        valid, wanted = is_number(e) and 0 <= e <= 1, "a finite number >= 0 and <= 1"
        require("RigidWall.restitution", e, valid, wanted)
        require_not_negative(self, "minimum_impact_speed_m_s")


def dissipative(law: ContactLaw, depth: Scalar, memory: Scalar) -> tuple[Scalar, Scalar]:
    """Return elastic force and damper of F = K delta^n (1 + a delta'/v0) + c delta'; the memory is a/v0.

    All of ``DAMPING_FACTORS`` are of this kind, v0 the approach speed at the start of the present contact;
    so are Hertz's law, the linear one, and Kelvin and Voigt's with a = 0.
    """
    elastic = law.stiffness * power(depth, law.exponent)
    return elastic, (elastic * memory if law.damping_factor else 0.0) + law.damping_N_s_m


def kuwabara_kono(law: ContactLaw, depth: Scalar, memory: Scalar) -> tuple[Scalar, Scalar]:  # noqa: ARG001
    """Return elastic force and damper of F = K delta^1.5 + D delta^0.5 delta' (Kuwabara and Kono 1987)."""
    return law.stiffness * power(depth, 1.5), law.damping_N_s_m * sqrt(depth)


#: The normal laws by kind.
NORMAL_LAWS: Mapping[str, Callable[[ContactLaw, Scalar, Scalar], tuple[Scalar, Scalar]]] = MappingProxyType(
    {"dissipative": dissipative, "kuwabara-kono": kuwabara_kono}
)


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

    def __post_init__(self) -> None:
        require("FrictionLaw.kind", self.kind, self.kind in FRICTION_LAWS, " or ".join(FRICTION_LAWS))
        require_not_negative(self, "coefficient", "dead_band_speed_m_s")
        require_positive(self, "regularisation_speed_m_s")
        require_below(self, "dead_band_speed_m_s", "regularisation_speed_m_s")


def saturated_linear(law: FrictionLaw, sliding: Scalar) -> Scalar:
    """Return f(v) = v/v_reg within -1 and 1."""
    return smaller(1.0, larger(-1.0, sliding / law.regularisation_speed_m_s))


def ambrosio(law: FrictionLaw, sliding: Scalar) -> Scalar:
    """Return f(v), 0 in the dead band, of size 1 from v_reg on, linear between (Ambrosio 2003)."""
    ramp = law.regularisation_speed_m_s - law.dead_band_speed_m_s
    part = (size(sliding) - law.dead_band_speed_m_s) / ramp
    return signed(smaller(1.0, larger(0.0, part)), sliding)


def hyperbolic(law: FrictionLaw, sliding: Scalar) -> Scalar:
    """Return f(v) = tanh(v/v_reg)."""
    return tanh(sliding / law.regularisation_speed_m_s)


#: The friction laws by kind: the part of mu F_n that acts at a sliding speed in m/s, with the speed's sign.
FRICTION_LAWS: Mapping[str, Callable[[FrictionLaw, Scalar], Scalar]] = MappingProxyType(
    {"saturated-linear": saturated_linear, "ambrosio": ambrosio, "tanh": hyperbolic}
)


def steepest(law: FrictionLaw) -> float:
    """Return the largest slope of the law's f(v), in s/m."""
    return 1 / (law.regularisation_speed_m_s - law.dead_band_speed_m_s)

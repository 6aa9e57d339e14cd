"""Stiffness and exponent of a clearance's compliant law, and the energy that a penetration stores."""

import math

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene.scene import Clearance


def exponent_of(clearance: Clearance) -> float:
    """Return the exponent n of F = K delta^n: as given, else 1 for the linear laws and 3/2 for the others."""
    if clearance.exponent is not None:
        return clearance.exponent
    return 1.0 if clearance.law in ("linear", "kelvin-voigt") else 1.5


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


def elastic_energy_J(clearance: Clearance, penetration_m: FloatArray) -> FloatArray:
    """Return K delta^(n+1)/(n+1) where delta is positive, else 0, in the shape of the penetration."""
    n = exponent_of(clearance)
    return np.asarray(stiffness_of(clearance) * np.maximum(penetration_m, 0.0) ** (n + 1) / (n + 1))

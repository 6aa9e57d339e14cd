"""Joints in any states of the bodies: their gaps, and what those with clearance do where they touch.

The surfaces of a pin and its bearing meet in the middle of the penetration.
"""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import Contact, FloatArray
from engine_models.mechanics.states import JointGap, pin_gap
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import ClearanceData

CRANK, ROD, SLIDER = range(3)


def joint_gap(scene: Scene, joint: str, position: FloatArray, velocity: FloatArray) -> JointGap:
    """Return a joint's gap in states (n, bodies, 3)."""
    pin = next(pin for pin in scene.mechanism.pins if pin.name == joint)
    return pin_gap(pin, position, velocity)


def gaps(scene: Scene, position: FloatArray) -> dict[str, FloatArray]:
    """Return the vector (n, 2) in m from the bearing to the pin of each joint in positions (n, bodies, 3)."""
    at_rest = np.zeros_like(position)
    return {pin.name: pin_gap(pin, position, at_rest).gap_m for pin in scene.mechanism.pins}


def penetration_m(clearance: Clearance, gap_m: FloatArray) -> FloatArray:
    """Return how far a pin is in its bearing's wall, (n,) from gaps (n, 2): negative in flight."""
    return np.asarray(np.hypot(gap_m[:, 0], gap_m[:, 1]) - clearance.radial_clearance_m)


def directions(gap_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors along gaps (n, 2) and 90 degrees counter-clockwise of them; zero without a gap."""
    distance = np.hypot(gap_m[:, 0], gap_m[:, 1])
    normal = gap_m / np.maximum(distance, np.finfo(float).tiny)[:, None]
    return normal, np.stack([-normal[:, 1], normal[:, 0]], axis=-1)


def levers(clearance: Clearance | ClearanceData, penetration: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far in m the surfaces in contact are from the centres of bearing and pin, each (n,)."""
    radius, depth = clearance.bearing_radius_m, np.maximum(penetration, 0.0)
    return radius + depth / 2, radius - clearance.radial_clearance_m - depth / 2


@dataclass(frozen=True)
class ContactForces:
    """The forces of a joint with clearance and where they act; shapes and signs as in ``engine.Contact``."""

    gap_m: FloatArray
    penetration_m: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray


def contact_force(contact: Contact | ContactForces) -> FloatArray:
    """Return the force on the pin of a joint with clearance, (n, 2) in N."""
    normal, across = directions(contact.gap_m)
    force = -contact.normal_force_N[:, None] * normal
    if contact.friction_force_N is not None:
        force += contact.friction_force_N[:, None] * across
    return np.asarray(force)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the z component of a x b, (n,) from two (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def axis(angle_rad: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 2) along the x axis of a body at angles (n,)."""
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)

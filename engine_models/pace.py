"""What forces a run's steps to be as short as they are, and the end of runs that would take them for ever."""

import math

import numpy as np

from engine_models.contact_stiffness import exponent_of, stiffness_of
from engine_models.engine import FloatArray, SimulationFailed
from engine_models.scene import Clearance, Scene
from engine_models.start_check import joint_gap

#: A run that needs more steps than this would take hours or more.
MOST_STEPS = 1e10


def require_pace(
    scene: Scene, position: FloatArray, velocity: FloatArray, reached_s: float, passed_s: float, steps: int
) -> None:
    """Check that a run that passed so much time in its last steps comes to its end.

    ``position`` and ``velocity`` (bodies, 3) are those reached. ``steps`` are to be enough of them to outlast
    any one contact.

    Raises:
        SimulationFailed: at this pace the run would need more than ``MOST_STEPS``; the message names the
            field of the scene that forces it.
    """
    if passed_s * MOST_STEPS >= steps * scene.end_time_s:
        return
    mean = f"steps of {passed_s / steps:.3g} s at t = {reached_s:.6g} s, {MOST_STEPS:.0e} and more in all"
    field, value = forcing_field(scene, position, velocity)
    raise SimulationFailed(f"{field}: expected a value that a run can follow, got {value:g} (forces {mean})")


def forcing_field(scene: Scene, position: FloatArray, velocity: FloatArray) -> tuple[str, float]:
    """Return name and value of the field that makes the shortest time in a state, each (bodies, 3)."""
    shortest, found = math.inf, ("end_time_s", scene.end_time_s)
    for joint in scene.joints_with_clearance:
        clearance: Clearance = getattr(scene.clearance, joint)
        gap = joint_gap(scene, joint, position[None], velocity[None])
        distance, speed = float(np.hypot(*gap.gap_m[0])), float(np.hypot(*gap.rate_m_s[0]))
        for field, value, time_s in _times(scene, clearance, distance, speed):
            if time_s < shortest:
                shortest, found = time_s, (f"clearance.{joint}.{field}", value)
    return found


def _times(
    scene: Scene, clearance: Clearance, distance_m: float, speed_m_s: float
) -> list[tuple[str, float, float]]:
    """Return fields of a joint, their values, and the time in s that each makes with the lightest body."""
    c = clearance.radial_clearance_m
    times = [("radial_clearance_m", c, c / speed_m_s if speed_m_s > 0 else math.inf)]
    if distance_m <= c or clearance.law == "rigid":
        return times
    mass, n = min(body.mass_kg for body in scene.bodies), exponent_of(clearance)
    depth = np.float64(distance_m - c)
    spring = stiffness_of(clearance) * depth**n
    stiff = "young_modulus_Pa" if clearance.stiffness is None else "stiffness"
    times = [(stiff, getattr(clearance, stiff), float(np.sqrt(mass * depth / spring)))]
    if clearance.damping_N_s_m:
        times.append(("damping_N_s_m", clearance.damping_N_s_m, mass / clearance.damping_N_s_m))
    if clearance.friction is not None and clearance.friction.coefficient > 0:
        full = clearance.friction.regularisation_speed_m_s
        rate = clearance.friction.coefficient * spring / mass
        times.append(("friction.regularisation_speed_m_s", full, float(full / rate)))
    return times

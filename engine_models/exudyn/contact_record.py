"""What a contact did in an Exudyn run: Exudyn's law at the recorded motion, its work, its impacts.

Geometry and signs are those of ``engine.Contact``. The law is evaluated here, at the states that Exudyn
recorded, because Exudyn gives forces at its steps only, and no energies.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts
from engine_models.exudyn.laws import damping_factor, minimum_impact_speed_m_s
from engine_models.exudyn.motion import APPROACH_SPEED, Motion
from engine_models.mechanics.contact_law import exponent_of, stiffness_of
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.mechanics.joints import joint_gap
from engine_models.scene.scene import Clearance, Scene

#: Gauss's points and weights on (0, 1): of order 6, above the order of the motion between the steps.
POINTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18
#: A time of touch is halved down to round-off this often.
HALVINGS = 60


@dataclass(frozen=True)
class ContactStates:
    """A contact at n times: ``gap_m`` (n, 2), all else (n,); forces and signs as in ``Contact``.

    ``rate_m_s`` is the penetration's derivative, ``sliding_m_s`` the speed of the pin's surface along the
    friction force, ``damping_W`` what the normal force dissipates. ``pin_arm_m`` and ``bearing_arm_m`` reach
    from the two centres to the point where the forces act, in the middle of the penetration.
    """

    gap_m: FloatArray
    penetration_m: FloatArray
    rate_m_s: FloatArray
    sliding_m_s: FloatArray
    pin_arm_m: FloatArray
    bearing_arm_m: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray
    damping_W: FloatArray

    @property
    def force_on_pin_N(self) -> FloatArray:
        """Force on the pin in the global frame, (n, 2)."""
        normal = self.gap_m / np.maximum(np.hypot(*self.gap_m.T), np.finfo(float).tiny)[:, None]
        across = np.stack([-normal[:, 1], normal[:, 0]], axis=-1)
        return np.asarray(-self.normal_force_N[:, None] * normal + self.friction_force_N[:, None] * across)


def contact_states(scene: Scene, joint: str, motion: Motion, time_s: FloatArray) -> ContactStates:
    """Return a contact at times (n,) of a motion."""
    clearance: Clearance = getattr(scene.clearance, joint)
    position, velocity, _ = motion.at(time_s)
    between = joint_gap(scene, joint, position, velocity)
    gap, gap_rate = between.gap_m, between.rate_m_s
    distance = np.hypot(*gap.T)
    normal = gap / np.maximum(distance, np.finfo(float).tiny)[:, None]
    penetration = distance - clearance.radial_clearance_m
    depth = np.maximum(penetration, 0.0)
    rate = np.sum(normal * gap_rate, axis=1)
    bearing_arm = clearance.bearing_radius_m + depth / 2
    pin_arm = clearance.bearing_radius_m - clearance.radial_clearance_m - depth / 2
    sliding = normal[:, 0] * gap_rate[:, 1] - normal[:, 1] * gap_rate[:, 0]
    sliding += between.pin_spin_rad_s * pin_arm - between.bearing_spin_rad_s * bearing_arm
    # The approach speed is stored at the end of the step that touches.
    history = motion.histories[joint]
    step_end = np.clip(np.searchsorted(motion.time_s, time_s, "left"), 0, len(history) - 1)
    approach = np.maximum(history[step_end, APPROACH_SPEED], minimum_impact_speed_m_s(clearance))
    spring = stiffness_of(clearance) * depth ** exponent_of(clearance)
    damping = spring * damping_factor(clearance) / approach
    damping += np.where(depth > 0, clearance.damping_N_s_m or 0.0, 0.0)
    force = spring + damping * rate
    friction = np.zeros_like(force)
    if clearance.friction is not None:
        share = np.clip(sliding / clearance.friction.regularisation_speed_m_s, -1.0, 1.0)
        friction = -clearance.friction.coefficient * force * share
    return ContactStates(
        gap, penetration, rate, sliding, pin_arm, bearing_arm, force, friction, damping * rate**2
    )


def contact_record(scene: Scene, joint: str, motion: Motion, time_s: FloatArray) -> Contact:
    """Return all that a contact did, at the samples' times (n,).

    Impulse and losses are Gauss's quadrature, of order 6, over the parts into which steps, samples, touches
    and releases cut the time.
    """
    clearance: Clearance = getattr(scene.clearance, joint)
    touch, release = _touches_and_releases(scene, joint, motion)
    ended = touch[: len(release)]
    grid = np.unique(np.concatenate([motion.time_s, time_s, ended, release]))
    sums = _sums(scene, joint, motion, grid)

    def since_start(total: FloatArray, at: FloatArray) -> FloatArray:
        return np.asarray(total[np.searchsorted(grid, at)])

    def over_impacts(total: FloatArray) -> FloatArray:
        return since_start(total, release) - since_start(total, ended)

    impulse, normal_loss, friction_loss = sums
    states = contact_states(scene, joint, motion, time_s)
    has_friction = clearance.friction is not None
    return Contact(
        gap_m=states.gap_m,
        penetration_m=states.penetration_m,
        normal_force_N=states.normal_force_N,
        friction_force_N=states.friction_force_N if has_friction else None,
        elastic_energy_J=elastic_energy_J(clearance, states.penetration_m),
        normal_impulse_N_s=since_start(impulse, time_s),
        normal_loss_J=since_start(normal_loss, time_s),
        friction_loss_J=since_start(friction_loss, time_s) if has_friction else None,
        clipped_loss_J=None,
        impacts=Impacts(
            time_s=ended,
            duration_s=release - ended,
            approach_speed_m_s=contact_states(scene, joint, motion, ended).rate_m_s,
            normal_impulse_N_s=over_impacts(impulse),
            energy_lost_J=over_impacts(normal_loss + friction_loss),
        ),
    )


def _sums(scene: Scene, joint: str, motion: Motion, grid: FloatArray) -> FloatArray:
    """Return the integrals of normal force, normal loss and friction loss up to the grid's times, (3, g)."""

    def rates(time: FloatArray) -> FloatArray:
        states = contact_states(scene, joint, motion, time)
        return np.stack(
            [states.normal_force_N, states.damping_W, -states.friction_force_N * states.sliding_m_s]
        )

    return integral(grid, rates)


def integral(grid: FloatArray, rates: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the integrals of rates (m, n) of times (n,) from the grid's (g,) start to its times, (m, g)."""
    width = np.diff(grid)
    values = rates((grid[:-1, None] + width[:, None] * POINTS).ravel())
    pieces = values.reshape(len(values), -1, len(POINTS)) @ WEIGHTS * width
    return np.concatenate([np.zeros((len(values), 1)), np.cumsum(pieces, axis=1)], axis=1)


def _touches_and_releases(scene: Scene, joint: str, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the times of all touches and of all releases, in order; the last contact may have no release.

    A change of sign between two steps is halved down to its time. What begins closed touches at the start.
    """
    clearance: Clearance = getattr(scene.clearance, joint)

    def closed_at(time_s: FloatArray) -> NDArray[np.bool_]:
        position, velocity, _ = motion.at(time_s)
        distance = np.hypot(*joint_gap(scene, joint, position, velocity).gap_m.T)
        return np.asarray(distance > clearance.radial_clearance_m)

    closed = closed_at(motion.time_s)
    changes = np.flatnonzero(closed[1:] != closed[:-1])
    low, high = motion.time_s[changes], motion.time_s[changes + 1]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if not ((low < middle) & (middle < high)).any():
            break
        before = closed_at(middle) == closed[changes]
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    opening = closed[changes]
    begun_closed = motion.time_s[:1][closed[:1]]
    return np.concatenate([begun_closed, high[~opening]]), high[opening]

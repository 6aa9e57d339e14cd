"""A joint with clearance in Exudyn: its native law, the scene that this solves, and what the contact did.

Exudyn's sphere in a hollow sphere knows three normal laws, f = K delta^n + d delta' and
f = K delta^n (1 + a(e') delta'/v0) with one of two damping factors a of a restitution e' in (0, 1]:
impact model 1 a = 3(1-e')/2 (Hunt-Crossley); impact model 2 a = 3/2 (1-e')(11-e')/(1+9e') (Carvalho-Martins)
for e' > 1/3, else (1-e'^2)/e' (Gonthier). Model 1 reaches a < 3/2 and model 2 any a, so every law of the
family has an e' that makes it Exudyn's own, exactly. The force is never clipped: it may pull. Friction is
saturated linear. It follows the sign of the normal force: where that pulls, friction drives the sliding.

After a run the law is evaluated here, at the states that Exudyn recorded, because Exudyn gives forces at its
steps only, and no energies. Geometry and signs are those of ``engine.Contact``.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts, UnsupportedScene
from engine_models.exudyn.motion import APPROACH_SPEED, Motion, integral
from engine_models.mechanics.contact_law import (
    damping_factor_of,
    exponent_of,
    minimum_impact_speed_of,
    stiffness_of,
)
from engine_models.mechanics.joints import (
    clearances,
    cross,
    directions,
    gaps,
    joint_gap,
    levers,
    penetration_m,
)
from engine_models.mechanics.reactions import ContactForces
from engine_models.mechanics.trajectory import contact_of
from engine_models.scene.scene import Clearance, Clearances, Scene

#: Hunt-Crossley's form ends at e' = 0; Carvalho-Martins' gives way to Gonthier's at e' = 1/3.
LARGEST_OF_MODEL_1, LARGEST_OF_CARVALHO_MARTINS = 1.5, 8 / 3
#: A time of touch is halved down to round-off this often.
HALVINGS = 60


@dataclass(frozen=True)
class NativeLaw:
    """Exudyn's parameters of a normal law; the restitution is Exudyn's e', not that of the scene."""

    impact_model: int
    restitution: float
    damping_N_s_m: float


def native_law(clearance: Clearance) -> NativeLaw:
    """Return the law in Exudyn's parameters, with Exudyn's e' solved for from the law's own damping."""
    a = damping_factor_of(clearance)
    if a == 0:
        return NativeLaw(0, 1.0, clearance.damping_N_s_m or 0.0)
    if a < LARGEST_OF_MODEL_1:
        return NativeLaw(1, 1 - 2 * a / 3, 0.0)
    if a < LARGEST_OF_CARVALHO_MARTINS:  # 3/2 e'^2 - (18 + 9a) e' + 33/2 - a = 0, its smaller root
        b = 18 + 9 * a
        return NativeLaw(2, 2 * (16.5 - a) / (b + math.sqrt(b * b - 6 * (16.5 - a))), 0.0)
    return NativeLaw(2, 2 / (a + math.sqrt(a * a + 4)), 0.0)  # e'^2 + a e' - 1 = 0


def native_twin(scene: Scene) -> Scene:
    """Return the scene with the contact laws as Exudyn has them.

    Raises:
        UnsupportedScene: a law has no counterpart in Exudyn.
    """
    twins = {name: _native_twin(name, clearance) for name, clearance in clearances(scene).items()}
    return scene.model_copy(update={"clearance": Clearances(**twins)})


def _native_twin(name: str, clearance: Clearance) -> Clearance:
    if clearance.law == "rigid":
        raise UnsupportedScene(
            f"exudyn has no rigid contact (clearance at {name}): its contacts are compliant"
        )
    friction = clearance.friction
    if friction is not None:
        if friction.law == "ambrosio":
            raise UnsupportedScene(f"exudyn's friction has no dead band (clearance at {name})")
        friction = friction.model_copy(update={"law": "saturated-linear"})
    changed: dict[str, object] = {"friction": friction}
    if damping_factor_of(clearance) != 0:
        changed |= {"may_pull": True, "minimum_impact_speed_m_s": minimum_impact_speed_of(clearance)}
    return clearance.model_copy(update=changed)


@dataclass(frozen=True)
class ContactStates(ContactForces):
    """A contact's forces, the rate (n,) of its penetration, and what normal force and friction dissipate."""

    rate_m_s: FloatArray
    damping_W: FloatArray
    friction_W: FloatArray


def contact_states(scene: Scene, joint: str, motion: Motion, time_s: FloatArray) -> ContactStates:
    """Return a contact at times (n,) of a motion."""
    clearance = clearances(scene)[joint]
    position, velocity, _ = motion.at(time_s)
    between = joint_gap(scene, joint, position, velocity)
    normal, _ = directions(between.gap_m)
    penetration = penetration_m(clearance, between.gap_m)
    depth = np.maximum(penetration, 0.0)
    rate = np.sum(normal * between.rate_m_s, axis=1)
    bearing_lever, pin_lever = levers(clearance, penetration)
    sliding = cross(normal, between.rate_m_s)
    sliding += between.pin_spin_rad_s * pin_lever - between.bearing_spin_rad_s * bearing_lever
    # The approach speed is stored at the end of the step that touches.
    history = motion.histories[joint]
    step_end = np.clip(np.searchsorted(motion.time_s, time_s, "left"), 0, len(history) - 1)
    approach = np.maximum(history[step_end, APPROACH_SPEED], minimum_impact_speed_of(clearance))
    spring = stiffness_of(clearance) * depth ** exponent_of(clearance)
    damping = spring * damping_factor_of(clearance) / approach
    damping += np.where(depth > 0, clearance.damping_N_s_m or 0.0, 0.0)
    force = spring + damping * rate
    friction = np.zeros_like(force)
    if clearance.friction is not None:
        share = np.clip(sliding / clearance.friction.regularisation_speed_m_s, -1.0, 1.0)
        friction = -clearance.friction.coefficient * force * share
    losses = damping * rate**2, -friction * sliding
    return ContactStates(between.gap_m, penetration, force, friction, rate, *losses)


def contact_record(scene: Scene, joint: str, motion: Motion, time_s: FloatArray) -> Contact:
    """Return all that a contact did, at the samples' times (n,).

    Impulse and losses are Gauss's quadrature, of order 6, over the parts into which steps, samples, touches
    and releases cut the time.
    """

    def powers(time: FloatArray) -> FloatArray:
        states = contact_states(scene, joint, motion, time)
        return np.stack([states.normal_force_N, states.damping_W, states.friction_W])

    touch, release = _touches_and_releases(scene, joint, motion)
    ended = touch[: len(release)]
    grid = np.unique(np.concatenate([motion.time_s, time_s, ended, release]))
    sums = integral(grid, powers)

    def since_start(at: FloatArray) -> FloatArray:
        return np.asarray(sums[:, np.searchsorted(grid, at)])

    impulse, normal_loss, friction_loss = since_start(time_s)
    impulses, normal_losses, friction_losses = since_start(release) - since_start(ended)
    states = contact_states(scene, joint, motion, time_s)
    return contact_of(
        clearances(scene)[joint],
        states.gap_m,
        normal_force_N=states.normal_force_N,
        friction_force_N=states.friction_force_N,
        normal_impulse_N_s=impulse,
        normal_loss_J=normal_loss,
        friction_loss_J=friction_loss,
        clipped_loss_J=None,
        impacts=Impacts(
            time_s=ended,
            duration_s=release - ended,
            approach_speed_m_s=contact_states(scene, joint, motion, ended).rate_m_s,
            normal_impulse_N_s=impulses,
            energy_lost_J=normal_losses + friction_losses,
        ),
    )


def _touches_and_releases(scene: Scene, joint: str, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the times of all touches and of all releases, in order; the last contact may have no release.

    A change of sign between two steps is halved down to its time. What begins closed touches at the start.
    """

    def closed_at(time_s: FloatArray) -> NDArray[np.bool_]:
        return penetration_m(clearances(scene)[joint], gaps(scene, motion.at(time_s)[0])[joint]) > 0

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

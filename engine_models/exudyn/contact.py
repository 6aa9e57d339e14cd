"""A joint with clearance in Exudyn: a sphere in a hollow one, with the friction of both, and what it did.

After a run the law is evaluated here, at the states that Exudyn recorded, because Exudyn gives forces at its
steps only, and no energies. Geometry and signs are those of ``engine.Contact``.
"""

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts
from engine_models.exudyn.contact_law import native_law
from engine_models.exudyn.motion import APPROACH_SPEED, Motion, integral
from engine_models.mechanics.contact_law import (
    damping_factor_of,
    exponent_of,
    minimum_impact_speed_of,
    stiffness_of,
)
from engine_models.mechanics.impacts import along_steps, largest
from engine_models.mechanics.joints import (
    ContactForces,
    cross,
    directions,
    gaps,
    joint_gap,
    levers,
    penetration_m,
)
from engine_models.mechanics.states import JointGap
from engine_models.mechanics.trajectory import contact_of
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene

items: Any = itemInterface  # its constructors carry no types
#: A time of touch is halved down to round-off this often.
HALVINGS = 60
#: A contact that lasts no more than this part of the time is round-off.
BLINK = 1e-12


def add_contact(mbs: exu.MainSystem, markers: list[Any], clearance: Clearance, start: JointGap) -> Any:
    """Add the contact of pin, a sphere, and bearing, a hollow one, from one state of its gap.

    Returns:
        The node of its history: gap (negative in contact), tangential speed (of the centres, which the first
        step corrects), approach speed of the latest touch, and a plastic depth that no law here uses. A
        contact that is closed at the start touches there.
    """
    c, bearing_radius, law = clearance.radial_clearance_m, clearance.bearing_radius_m, native_law(clearance)
    friction = clearance.friction
    (gap,), (rate,) = start.gap_m, start.rate_m_s
    distance = float(np.hypot(*gap))
    normal = gap / distance if distance > 0 else np.zeros(2)
    approach, across = normal @ rate, normal[0] * rate[1] - normal[1] * rate[0]
    begin = [c - distance, abs(across), max(approach, 0.0) if distance > c else 0.0, 0.0]
    history = mbs.AddNode(items.NodeGenericData(initialCoordinates=begin, numberOfDataCoordinates=len(begin)))
    contact = items.ObjectContactSphereSphere(
        markerNumbers=markers,
        nodeNumber=history,
        spheresRadii=[bearing_radius - c, bearing_radius],
        isHollowSphere1=True,
        contactStiffness=stiffness_of(clearance),
        contactStiffnessExponent=exponent_of(clearance),
        contactDamping=law.damping_N_s_m,
        impactModel=law.impact_model,
        restitutionCoefficient=law.restitution,
        minimumImpactVelocity=minimum_impact_speed_of(clearance),
        dynamicFriction=0.0 if friction is None else friction.coefficient,
        frictionProportionalZone=1.0 if friction is None else friction.regularisation_speed_m_s,
    )
    mbs.AddObject(contact)
    return history


@dataclass(frozen=True)
class ContactStates(ContactForces):
    """A contact's forces, the rate (n,) of its penetration, and what normal force and friction dissipate."""

    rate_m_s: FloatArray
    damping_W: FloatArray
    friction_W: FloatArray


def contact_states(scene: Scene, joint: str, motion: Motion, time_s: FloatArray) -> ContactStates:
    """Return a contact at times (n,) of a motion."""
    clearance = scene.clearances[joint]
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
    inside = [along_steps(motion.time_s, *ends) for ends in zip(ended, release, strict=True)]
    within = contact_states(scene, joint, motion, np.concatenate([np.zeros(0), *inside]))
    ends = np.cumsum([len(times) for times in inside], dtype=int)[:-1]
    forces, depths = (
        np.reshape([largest(*each) for each in zip(inside, np.split(of, ends), strict=False)], (-1, 2)).T
        for of in (within.normal_force_N, within.penetration_m)
    )
    return contact_of(
        scene.clearances[joint],
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
            largest_normal_force_N=forces[0],
            largest_normal_force_time_s=forces[1],
            largest_penetration_m=depths[0],
            largest_penetration_time_s=depths[1],
        ),
    )


def _touches_and_releases(scene: Scene, joint: str, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return the times of all touches and of all releases, in order; the last contact may have no release.

    A change of sign between two steps is halved down to its time. What begins closed touches at the start. A
    step that ends on the wall may be closed by round-off alone: that is no contact.
    """

    def closed_at(time_s: FloatArray) -> NDArray[np.bool_]:
        return penetration_m(scene.clearances[joint], gaps(scene, motion.at(time_s)[0])[joint]) > 0

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
    touch, release = np.concatenate([begun_closed, high[~opening]]), high[opening]
    lasts = release - touch[: len(release)] > BLINK * release
    return touch[np.append(lasts, True)[: len(touch)]], release[lasts]

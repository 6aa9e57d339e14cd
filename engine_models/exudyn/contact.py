"""A joint with clearance in Exudyn: the law in its parameters, and what a contact did in a run.

Exudyn's sphere in a hollow sphere knows three normal laws, f = K delta^n + d delta' and
f = K delta^n (1 + a(e') delta'/v0) with one of two damping factors a of a restitution e' in (0, 1]:
impact model 1 a = 3(1-e')/2 (Hunt-Crossley); impact model 2 a = 3/2 (1-e')(11-e')/(1+9e') (Carvalho-Martins)
for e' > 1/3, else (1-e'^2)/e' (Gonthier). Model 1 reaches a < 3/2 and model 2 any a, so every law of the
family has an e' that makes it Exudyn's own, exactly. The force is never clipped: it may pull. Friction is
saturated linear. It follows the sign of the normal force: where that pulls, friction drives the sliding.

Exudyn gives forces at its steps only, and no energies: after a run the law is evaluated at the states that
Exudyn recorded.
"""

import math

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts, UnsupportedScene
from engine_models.exudyn.motion import Motion, integral
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.mechanics.forces import contact_states
from engine_models.mechanics.impacts import along_steps, largest
from engine_models.mechanics.states import pin_gap
from engine_models.mechanics.trajectory import ContactStates
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import damping_factor_of, minimum_impact_speed_of
from reference_solver.mechanism.data import Pin

#: Hunt-Crossley's form ends at e' = 0; Carvalho-Martins' gives way to Gonthier's at e' = 1/3.
LARGEST_OF_MODEL_1, LARGEST_OF_CARVALHO_MARTINS = 1.5, 8 / 3
#: A time of touch is halved down to round-off this often.
HALVINGS = 60
#: A contact that lasts no more than this part of the time is round-off.
BLINK = 1e-12


def native_law(clearance: Clearance) -> tuple[int, float]:
    """Return Exudyn's impact model and its restitution e', solved for from the law's own damping factor."""
    a = damping_factor_of(clearance)
    if a == 0:
        return 0, 1.0
    if a < LARGEST_OF_MODEL_1:
        return 1, 1 - 2 * a / 3
    if a < LARGEST_OF_CARVALHO_MARTINS:  # 3/2 e'^2 - (18 + 9a) e' + 33/2 - a = 0, its smaller root
        b = 18 + 9 * a
        return 2, 2 * (16.5 - a) / (b + math.sqrt(b * b - 6 * (16.5 - a)))
    return 2, 2 / (a + math.sqrt(a * a + 4))  # e'^2 + a e' - 1 = 0


def native_twin(scene: Scene) -> Scene:
    """Return the scene with the contact laws as Exudyn has them.

    Raises:
        UnsupportedScene: a law has no counterpart in Exudyn.
    """
    return scene.replace({f"clearance.{name}": _native(name, of) for name, of in scene.clearances.items()})


def _native(name: str, clearance: Clearance) -> Clearance:
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


def contact_record(motion: Motion, pin: Pin, clearance: Clearance, time_s: FloatArray) -> Contact:
    """Return all that a contact did, at the samples' times (n,).

    Impulse and losses are Gauss's quadrature, of order 6, over the parts into which steps, samples, touches
    and releases cut the time.
    """

    def states(at: FloatArray) -> ContactStates:
        return contact_states(pin, *motion.at(at)[:2], motion.approach_m_s(pin.name, at))

    def powers(at: FloatArray) -> FloatArray:
        of = states(at)
        return np.stack([of.normal_force_N, of.normal_loss_W, of.friction_loss_W])

    touch, release = _touches_and_releases(motion, pin, clearance.radial_clearance_m)
    ended = touch[: len(release)]
    grid = np.unique(np.concatenate([motion.time_s, time_s, ended, release]))
    sums = integral(grid, powers)
    impulse, normal_loss, friction_loss = sums[:, np.searchsorted(grid, time_s)]
    over = sums[:, np.searchsorted(grid, release)] - sums[:, np.searchsorted(grid, ended)]
    inside = [along_steps(motion.time_s, *ends) for ends in zip(ended, release, strict=True)]
    within = states(np.concatenate([np.zeros(0), *inside]))
    ends = np.cumsum([len(times) for times in inside], dtype=int)[:-1]
    peaks = [
        np.reshape([largest(*each) for each in zip(inside, np.split(of, ends), strict=False)], (-1, 2)).T
        for of in (within.normal_force_N, within.penetration_m)
    ]
    sampled, rubs = states(time_s), clearance.friction is not None
    return Contact(
        gap_m=sampled.gap_m,
        penetration_m=sampled.penetration_m,
        normal_force_N=sampled.normal_force_N,
        friction_force_N=sampled.friction_force_N if rubs else None,
        elastic_energy_J=elastic_energy_J(clearance, sampled.penetration_m),
        normal_impulse_N_s=impulse,
        normal_loss_J=normal_loss,
        friction_loss_J=friction_loss if rubs else None,
        clipped_loss_J=None,
        impacts=Impacts(
            ended, release - ended, states(ended).rate_m_s, over[0], over[1] + over[2], *peaks[0], *peaks[1]
        ),
    )


def _touches_and_releases(motion: Motion, pin: Pin, clearance_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the times of all touches and of all releases, in order; the last contact may have no release.

    A change of sign between two steps is halved down to its time. What begins closed touches at the start. A
    step that ends on the wall may be closed by round-off alone: that is no contact.
    """

    def closed_at(time_s: FloatArray) -> NDArray[np.bool_]:
        gap = pin_gap(pin, *motion.at(time_s)[:2])[0]
        return np.asarray(np.hypot(*gap.T) - clearance_m > 0)

    closed = closed_at(motion.time_s)
    changes = np.flatnonzero(closed[1:] != closed[:-1])
    low, high = motion.time_s[changes], motion.time_s[changes + 1]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        before = closed_at(middle) == closed[changes]
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    opening = closed[changes]
    begun_closed = motion.time_s[:1][closed[:1]]
    touch, release = np.concatenate([begun_closed, high[~opening]]), high[opening]
    lasts = release - touch[: len(release)] > BLINK * release
    return touch[np.append(lasts, True)[: len(touch)]], release[lasts]

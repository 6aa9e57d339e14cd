"""The contact laws of a scene in Exudyn's parameters, and the scene that Exudyn then really solves.

Exudyn's sphere in a hollow sphere knows three normal laws, f = K delta^n + d delta' and
f = K delta^n (1 + a(e') delta'/v0) with one of two damping factors a of a restitution e' in (0, 1]:
impact model 1 a = 3(1-e')/2 (Hunt-Crossley); impact model 2 a = 3/2 (1-e')(11-e')/(1+9e') (Carvalho-Martins)
for e' > 1/3, else (1-e'^2)/e' (Gonthier). Model 1 reaches a < 3/2 and model 2 any a, so every law of the
family has an e' that makes it Exudyn's own, exactly. The force is never clipped: it may pull. Friction is
saturated linear. It follows the sign of the normal force: where that pulls, friction drives the sliding.
"""

import math
from dataclasses import dataclass

from engine_models.engine import UnsupportedScene
from engine_models.mechanics.contact_law import damping_factor_of, minimum_impact_speed_of
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene

#: Hunt-Crossley's form ends at e' = 0; Carvalho-Martins' gives way to Gonthier's at e' = 1/3.
LARGEST_OF_MODEL_1, LARGEST_OF_CARVALHO_MARTINS = 1.5, 8 / 3


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
    rooms = scene.clearances.items()
    return scene.with_clearances({name: _native_twin(name, clearance) for name, clearance in rooms})


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

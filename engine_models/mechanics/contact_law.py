"""The scene's compliant contact and friction laws: their constants, and their forces in one contact.

F = K delta^n (1 + a(e) delta'/v0) + c delta', v0 the approach speed at touch, not below its floor.
"""

import math
from typing import NamedTuple

from engine_models.engine import UnsupportedScene
from engine_models.scene.format import Clearance
from engine_models.scene.plain_words import shown
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contact_laws import (
    NORMAL_LAWS,
    clips,
    damping_factor_of,
    exponent_of,
    minimum_impact_speed_of,
    stiffness_of,
)

__all__ = [
    "LawNumbers",
    "clips",
    "damping_factor_of",
    "exponent_of",
    "friction_force",
    "law_numbers",
    "minimum_impact_speed_of",
    "normal_force",
    "stiffness_of",
]


def require_family(scene: Scene, engine: str) -> None:
    """Refuse laws that the reference has by functions of their own, which an engine has no form for.

    Raises:
        UnsupportedScene: a joint has one.
    """
    for name, room in scene.clearances.items():
        if room.law in NORMAL_LAWS:
            expected = "a law of a stiffness and a damping, or of the dissipative family"
            raise UnsupportedScene(
                f"{engine}: clearance.{name}.law: expected {expected}, got {shown(room.law)}"
            )


class LawNumbers(NamedTuple):
    """The constants of a clearance's law of normal force and friction, as its formulas take them.

    ``floor`` is that of the approach speed in m/s; without friction ``coefficient`` is 0. ``full`` and
    ``dead`` are the sliding speeds in m/s from which all of the friction acts, and up to which none does.
    """

    stiffness: float
    exponent: float
    factor: float
    damping: float
    floor: float
    clips: bool
    coefficient: float = 0.0
    full: float = 1.0
    dead: float = 0.0
    smooth: bool = False


def law_numbers(clearance: Clearance) -> LawNumbers:
    """Return the constants of a compliant clearance's law."""
    normal = (
        stiffness_of(clearance),
        exponent_of(clearance),
        damping_factor_of(clearance),
        clearance.damping_N_s_m or 0.0,
        minimum_impact_speed_of(clearance),
        clips(clearance),
    )
    friction = clearance.friction
    if friction is None:
        return LawNumbers(*normal)
    dead = friction.dead_band_speed_m_s or 0.0  # Ambrosio's alone has one
    full, smooth = friction.regularisation_speed_m_s, friction.law == "tanh"
    return LawNumbers(*normal, friction.coefficient, full, dead, smooth)


# Numba compiles these two as they stand, for records with the fields of ``LawNumbers``.


def normal_force(law: LawNumbers, delta: float, rate: float, approach: float) -> tuple[float, float, bool]:
    """Return the force in N, its elastic part, and whether it is clipped, with v0 = ``approach``.

    It pushes if positive, until delta = 0; see ``clips``.
    """
    spring = law.stiffness * delta**law.exponent
    share = 1 + law.factor * rate / max(approach, law.floor)
    if share < 0 and law.clips:
        return 0.0, spring, True
    return spring * share + law.damping * rate, spring, False


def friction_force(law: LawNumbers, normal: float, sliding: float) -> float:
    """Return the force in N along the pin's sliding, of speed ``sliding`` in m/s; none where normal pulls."""
    if law.smooth:
        share = math.tanh(sliding / law.full)
    else:
        share = math.copysign(min(1.0, max(0.0, (abs(sliding) - law.dead) / (law.full - law.dead))), sliding)
    return -law.coefficient * max(normal, 0.0) * share

"""The scene's compliant contact and friction laws as numbers and functions of one contact, for the hook.

F = K delta^n (1 + a(e) delta'/v0) + c delta', v0 the approach speed at touch, not below its floor.
"""

import math
from collections.abc import Callable

from engine_models.mechanics.contact_stiffness import exponent_of, stiffness_of
from engine_models.scene.scene import Clearance, ContactLaw, Friction

#: a(e) of each law that has one, e the nominal restitution.
DAMPING_FACTORS: dict[ContactLaw, Callable[[float], float]] = {
    "hunt-crossley": lambda e: 3 * (1 - e) / 2,
    "lankarani-nikravesh": lambda e: 3 * (1 - e**2) / 4,
    "gonthier": lambda e: (1 - e**2) / e,
    "zhiying-qishao": lambda e: 3 * (1 - e**2) / 4 * math.exp(2 * (1 - e)),
    "flores": lambda e: 8 * (1 - e) / (5 * e),
    "hu-guo": lambda e: 3 * (1 - e) / (2 * e),
    "carvalho-martins": lambda e: 3 / 2 * (1 - e) * (11 - e) / (1 + 9 * e),
}
#: Floor of the approach speed in laws that divide by it, where the scene gives none.
MINIMUM_IMPACT_SPEED_M_S = 1e-6


class NormalLaw:
    """One contact's normal force, pushing positive; zero where the law would pull, unless it may.

    Kelvin-Voigt's force is left as it is until delta = 0.
    """

    def __init__(self, room: Clearance) -> None:
        self.stiffness, self.exponent = stiffness_of(room), exponent_of(room)
        factor = DAMPING_FACTORS.get(room.law)
        self.factor = 0.0 if factor is None or room.restitution is None else factor(room.restitution)
        self.damping = room.damping_N_s_m or 0.0
        self.floor = room.minimum_impact_speed_m_s or MINIMUM_IMPACT_SPEED_M_S
        self.clips = self.factor != 0 and not room.may_pull

    def force(self, delta: float, rate: float, approach: float) -> tuple[float, float, bool]:
        """Return the force in N, its elastic part, and whether it is clipped, with v0 = ``approach``."""
        spring = self.stiffness * delta**self.exponent
        share = 1 + self.factor * rate / max(approach, self.floor)
        if share < 0 and self.clips:
            return 0.0, spring, True
        return spring * share + self.damping * rate, spring, False


def friction_share(law: Friction, sliding: float) -> float:
    """Return the part of mu F_n that acts at a sliding speed in m/s, with the speed's sign."""
    full = law.regularisation_speed_m_s
    if law.law == "tanh":
        return math.tanh(sliding / full)
    dead = law.dead_band_speed_m_s or 0.0  # Ambrosio's alone has one
    return math.copysign(min(1.0, max(0.0, (abs(sliding) - dead) / (full - dead))), sliding)

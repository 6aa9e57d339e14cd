"""Mechanisms of tests of the truth: joints loosened, and walls."""

from engine_models.scene.parts import AnyScene
from tests.engines.mechanism_texts import WALL, scene

#: Friction at both surfaces of a loose pin.
RUBBING = 'friction = { law = "tanh", coefficient = 0.1, regularisation_speed_m_s = 0.01 }\n'
RIGID_WALL = WALL.replace("lankarani-nikravesh", "rigid").replace(
    "young_modulus_Pa = 207e9\npoisson_ratio = 0.3\n", ""
)


def loosened(text: str, pins: str, end_s: float, more: str, wall: str = WALL) -> AnyScene:
    """Return a mechanism with such walls around some of its pins, until another end."""
    rooms = "".join(f"[clearance.{pin}]{wall}{more}" for pin in pins)
    return scene(text.replace("end_time_s = 0.5", f"end_time_s = {end_s}") + rooms)

"""A scene in other units of time, length and mass: the same physics, in other numbers."""

from dataclasses import dataclass
from typing import Any

from engine_models.mechanics.contact_law import exponent_of
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contact_laws import MINIMUM_IMPACT_SPEED_M_S


@dataclass(frozen=True)
class Units:
    """By how much the numbers of times, lengths and masses change; with powers of 4 no digit does."""

    time: float
    length: float
    mass: float

    def factor(self, field: str) -> float:
        """Return by how much the number of a scene's field changes, which the end of its name decides."""
        t, m, kg = self.time, self.length, self.mass
        force = kg * m / t**2
        ends = {
            "torque_N_m": force * m,
            "spring_N_m": force / m,
            "_N_s_m": force * t / m,
            "_kg_m2": kg * m**2,
            "_rad_s": 1 / t,
            "_m_s2": m / t**2,
            "_m_s": m / t,
            "_Pa": force / m**2,
            "_kg": kg,
            "_Hz": 1 / t,
            "_N": force,
            "_s": t,
            "_m": m,
        }
        return next((by for end, by in ends.items() if field.endswith(end)), 1.0)


def in_units(scene: Scene, units: Units) -> Scene:
    """Return the scene in other units; what has a default with units is written out."""
    data = _in_units(scene.model_dump(exclude_none=True), units)
    for joint in scene.joints_with_clearance:
        clearance, contact = getattr(scene.clearance, joint), data["clearance"][joint]
        if clearance.stiffness is not None:
            n = exponent_of(clearance)
            contact["stiffness"] *= units.mass / units.time**2 / units.length ** (n - 1)
        if clearance.law != "rigid":
            slowest = clearance.minimum_impact_speed_m_s or MINIMUM_IMPACT_SPEED_M_S
            contact["minimum_impact_speed_m_s"] = slowest * units.length / units.time
    return Scene.model_validate(data)


def _in_units(part: Any, units: Units, field: str = "") -> Any:
    if isinstance(part, dict):
        return {name: _in_units(value, units, name) for name, value in part.items()}
    if isinstance(part, list | tuple):
        return tuple(_in_units(value, units, field) for value in part)
    if isinstance(part, float) and field != "stiffness":
        return part * units.factor(field)
    return part

"""Random crank-sliders by a seeded recipe: scenes that nobody has tuned anything for.

Links weigh from 50 g to 2 kg, now and then one a thousand times less; there is clearance at O, A, B or at
several; every law and friction law occurs, three drives, and both signs of speed.
"""

from typing import Any

import numpy as np
from numpy.random import Generator

from engine_models.scene.scene import Scene

#: Every law of a compliant contact, and those that have a restitution.
WITH_RESTITUTION = (
    "hunt-crossley",
    "lankarani-nikravesh",
    "gonthier",
    "zhiying-qishao",
    "flores",
    "hu-guo",
    "carvalho-martins",
)
COMPLIANT = ("linear", "kelvin-voigt", "hertz", *WITH_RESTITUTION)
LIGHT = 1e-3


def random_scene(seed: int, rigid: bool) -> Scene:
    """Return the scene of a seed, of compliant contacts or rigid ones."""
    rng = np.random.default_rng([seed, int(rigid)])
    speed = float(rng.choice([-1.0, 1.0]) * _between(rng, 20.0, 300.0))
    crank_m = _between(rng, 0.02, 0.2)
    masses = [_between(rng, 0.05, 2.0) for _ in range(3)]
    if rng.random() < 0.25:
        masses[int(rng.integers(3))] *= LIGHT
    rod_m = crank_m * _between(rng, 1.5, 5.0)
    link, rod = (_link(rng, *of) for of in ((crank_m, masses[0]), (rod_m, masses[1])))
    joints = [name for name in "OAB" if rng.random() < 0.4] or [str(rng.choice(list("OAB")))]
    swing_J = 0.5 * (masses[0] + masses[1] + masses[2]) * (crank_m * speed) ** 2
    drive: dict[str, Any] = {"kind": str(rng.choice(["free", "torque", "constant-speed"]))}
    if drive["kind"] == "torque":
        drive["torque_N_m"] = float(rng.choice([-1.0, 1.0]) * rng.random() * swing_J)
    return Scene.checked(
        {
            "name": f"random-{'rigid' if rigid else 'compliant'}-{seed}",
            "end_time_s": _between(rng, 0.1, 0.6) * 2 * np.pi / abs(speed),
            "gravity_m_s2": float(rng.choice([0.0, 9.81])),
            "crank": link,
            "rod": rod,
            "slider": {"mass_kg": masses[2], "inertia_kg_m2": masses[2] * 1e-4},
            "start": {"crank_angle_rad": float(rng.uniform(-np.pi, np.pi)), "crank_speed_rad_s": speed},
            "drive": drive,
            "clearance": {name: _clearance(rng, rigid, crank_m * abs(speed)) for name in joints},
        }
    )


def _between(rng: Generator, low: float, high: float) -> float:
    """Return a number between two, equally likely in each part of their ratio."""
    return float(low * (high / low) ** rng.random())


def _link(rng: Generator, length_m: float, mass_kg: float) -> dict[str, float]:
    return {
        "length_m": length_m,
        "mass_kg": mass_kg,
        "inertia_kg_m2": mass_kg * length_m**2 * _between(rng, 0.03, 0.3),
        "centre_of_mass_m": length_m * float(rng.uniform(0.2, 0.8)),
    }


def _clearance(rng: Generator, rigid: bool, speed_m_s: float) -> dict[str, Any]:
    bearing_m = _between(rng, 0.003, 0.02)
    clearance: dict[str, Any] = {
        "radial_clearance_m": bearing_m * _between(rng, 2e-3, 5e-2),
        "bearing_radius_m": bearing_m,
        "law": "rigid" if rigid else str(rng.choice(COMPLIANT)),
    }
    law = clearance["law"]
    if law in WITH_RESTITUTION or rigid:
        clearance["restitution"] = float(rng.uniform(0.3 if not rigid else 0.0, 0.95))
    if law in ("linear", "kelvin-voigt"):
        clearance["stiffness"] = _between(rng, 1e6, 1e8)
        if law == "kelvin-voigt":
            clearance["damping_N_s_m"] = _between(rng, 1e1, 1e3)
    elif not rigid and rng.random() < 0.5:
        clearance |= {"young_modulus_Pa": _between(rng, 1e9, 2e11), "poisson_ratio": 0.3}
    elif not rigid:
        clearance["stiffness"] = _between(rng, 1e8, 1e11)
    if rng.random() < 0.5:
        clearance["friction"] = _friction(rng, speed_m_s)
    return clearance


def _friction(rng: Generator, speed_m_s: float) -> dict[str, Any]:
    law = str(rng.choice(["saturated-linear", "ambrosio", "tanh"]))
    limit = speed_m_s * _between(rng, 1e-3, 5e-2)
    friction = {"law": law, "coefficient": float(rng.uniform(0.01, 0.3)), "regularisation_speed_m_s": limit}
    return friction | ({"dead_band_speed_m_s": 0.3 * limit} if law == "ambrosio" else {})

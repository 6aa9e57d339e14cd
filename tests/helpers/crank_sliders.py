"""Crank-sliders: where they start, their independent solution, and some unusual ones."""

import numpy as np

from engine_models.mechanics.assembly import start_state
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Link, Scene, Start


def start(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    q, v = start_state(scene)
    return q.ravel(), v.ravel()


#: A crank that is held while a load pushes the slider.
HELD = Scene.checked(
    {
        "name": "held",
        "end_time_s": 0.01,
        "crank": {"length_m": 1.0, "mass_kg": 1.0, "inertia_kg_m2": 0.1, "centre_of_mass_m": 0.5},
        "rod": {"length_m": 2.5, "mass_kg": 1.0, "inertia_kg_m2": 0.5, "centre_of_mass_m": 1.25},
        "slider": {"mass_kg": 1.0, "inertia_kg_m2": 0.1},
        "start": {"crank_angle_rad": np.pi / 3, "crank_speed_rad_s": 0.0},
        "drive": {"kind": "constant-speed"},
        "load": {"slider": {"force_N": -400.0}},
    }
)


def pendulum() -> Scene:
    """Return a crank alone, let go from rest half a radian above the horizontal."""
    link = Link(length_m=0.5, mass_kg=1.2, inertia_kg_m2=0.02, centre_of_mass_m=0.3)
    free = SCENES["ideal-free"]().drive
    start = Start(crank_angle_rad=0.5, crank_speed_rad_s=0.0)
    return Scene(name="p", end_time_s=1.0, gravity_m_s2=9.81, crank=link, start=start, drive=free)


def short_rod() -> Scene:
    """Return a free crank-slider whose rod is shorter than its crank."""
    links = [
        {"length_m": 0.3, "mass_kg": 1.0, "inertia_kg_m2": 0.0075, "centre_of_mass_m": 0.15},
        {"length_m": 0.2, "mass_kg": 0.6, "inertia_kg_m2": 0.002, "centre_of_mass_m": 0.1},
    ]
    data = {
        "name": "short",
        "end_time_s": 1.0,
        "crank": links[0],
        "rod": links[1],
        "slider": {"mass_kg": 0.5, "inertia_kg_m2": 1e-3},
        "start": {"crank_angle_rad": 0.0, "crank_speed_rad_s": 5.0},
        "drive": {"kind": "free"},
    }
    return Scene.checked(data)

"""Crank-sliders by their parts, and unusual ones: one that is held, and a pendulum."""

import numpy as np

from engine_models.scene.scene import Scene
from engine_models.scene.short import Link, Slider

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
    link = {"length_m": 0.5, "mass_kg": 1.2, "inertia_kg_m2": 0.02, "centre_of_mass_m": 0.3}
    start, drive = {"crank_angle_rad": 0.5, "crank_speed_rad_s": 0.0}, {"kind": "free"}
    return Scene.checked(
        {"name": "p", "end_time_s": 1.0, "gravity_m_s2": 9.81, "crank": link, "start": start, "drive": drive}
    )


def crank_slider(scene: Scene) -> tuple[Link, Link, Slider]:
    """Return crank, rod and slider of a scene that is written as a crank-slider."""
    rod, slider = scene.short.rod, scene.short.slider
    assert rod is not None
    assert slider is not None
    return scene.short.crank, rod, slider

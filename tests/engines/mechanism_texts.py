"""Scenes of mechanisms as texts: the library's, and some that none of it serves for."""

from pathlib import Path

from engine_models.scene import library
from engine_models.scene.file import from_toml
from engine_models.scene.scene import Scene

FOLDER = Path(library.__file__).parent
NAMES = (
    *("offset-crank-slider", "four-bar", "andrews-squeezer"),
    *("scotch-yoke", "quick-return", "v-twin", "four-bar-clearance"),
)
TEXTS = {name: (FOLDER / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES}
OFFSET_CRANK_SLIDER, FOUR_BAR, ANDREWS, SCOTCH_YOKE, QUICK_RETURN, V_TWIN, FOUR_BAR_CLEARANCE = TEXTS.values()
WALL = """
radial_clearance_m = 5e-4
bearing_radius_m = 0.01
law = "lankarani-nikravesh"
young_modulus_Pa = 207e9
poisson_ratio = 0.3
restitution = 0.9
"""
#: A crank and a rocker of one length on a base of another: flat, and singular, whenever the crank is along x.
PARALLELOGRAM = """
name = "parallelogram"
end_time_s = 1.0
observe = "B.x"
ground.pins_m = { O = 0.0, C = 0.2 }
[body]
left = { pins_m = { O = 0.0, A = 0.1 }, mass_kg = 0.2, inertia_kg_m2 = 2e-4 }
coupler = { pins_m = { A = 0.0, B = 0.2 }, mass_kg = 0.5, inertia_kg_m2 = 7e-3 }
right = { pins_m = { C = 0.0, B = 0.1 }, mass_kg = 0.2, inertia_kg_m2 = 2e-4 }
[start]
angle_rad = { left = 1.0, right = 1.0 }
hold = ["left"]
speed_rad_s = { left = 2.0 }
[drive]
kind = "constant-speed"
"""


def scene(text: str, **changes: object) -> Scene:
    """Return the scene of a text, with other values in some fields, whose dots are written as __."""
    return from_toml(text, changes={path.replace("__", "."): value for path, value in changes.items()})


def four_bars(count: int, end_time_s: float) -> str:
    """Return the text of four-bars in a row: links of 1 m and 1 kg, 1 m apart, upright at -1 rad/s.

    Every link that hangs on the ground turns as the first does, and no other one turns.
    """
    bars = range(count + 1)
    link = "mass_kg = 1.0, inertia_kg_m2 = 0.08333333333333333, centre_of_mass_m = 0.5"
    pins = ", ".join(f"G{k} = [{k}.0, 0.0]" for k in bars)
    legs = "\n".join(f"leg{k} = {{ pins_m = {{ G{k} = 0.0, B{k} = 1.0 }}, {link} }}" for k in bars)
    coupler = "coupler{0} = {{ pins_m = {{ B{0} = 0.0, B{1} = 1.0 }}, {2} }}"
    couplers = "\n".join(coupler.format(k, k + 1, link) for k in range(count))
    angles = ", ".join(f"leg{k} = 1.5707963267948966" for k in bars)
    return f"""
name = "four-bars"
end_time_s = {end_time_s}
gravity_m_s2 = 9.81
observe = "B0.x"
ground.pins_m = {{ {pins} }}
[body]
{legs}
{couplers}
[start]
angle_rad = {{ {angles} }}
hold = ["leg0"]
speed_rad_s = {{ leg0 = -1.0 }}
"""

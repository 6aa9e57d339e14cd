"""Scenes of mechanisms with loads, springs and drives of all kinds, and with positions that are singular."""

import math

from engine_models.scene.file import from_toml
from engine_models.scene.general import GeneralScene
from engine_models.scene.scene import Scene
from tests.engine_models.reference.mechanism_texts import FOUR_BAR, PARALLELOGRAM, QUICK_RETURN, V_TWIN, WALL

#: Gravity aslant, springs and dampers, dampers along a line and of a turning, torques and forces by the time.
LOADED = (
    FOUR_BAR.replace("gravity_m_s2 = 9.81", "gravity_m_s2 = [3.0, -8.0]")
    + """
[spring.hung]
between = ["ground.C", "crank.A"]
stiffness_N_m = 400.0
free_length_m = 0.1
damping_N_s_m = 3.0
[spring.short]
between = ["crank.O", "rocker.B"]
stiffness_N_m = 150.0
free_length_m = 0.0
[load.crank]
torque_N_m = 0.4
viscous_N_m_s = 0.01
by_time = { time_s = [0.0, 0.1, 0.23, 0.31, 0.6], torque_N_m = [0.0, 0.5, -0.7, 0.2, 0.0] }
[load.coupler]
along_rad = 0.7
force_N = 2.0
viscous_N_s_m = 1.5
by_time = { time_s = [0.0, 0.17, 0.4, 0.6], force_N = [1.0, -6.0, 5.0, 0.0], interpolation = "linear" }
"""
)
#: Two cylinders whose gas repeats after two turns and after one, a motor by a table, and springs of pistons.
ENGINE = (
    V_TWIN
    + """
[drive]
kind = "motor"
body = "crank"
speed_rad_s = [0.0, 20.0, 45.0, 70.0]
torque_N_m = [3.0, 2.5, 1.0, -1.0]
interpolation = "linear"
[load.piston1]
viscous_N_s_m = 4.0
[load.piston1.gas]
angle_rad = [0.0, 0.5, 1.5, 3.0, 6.0, 9.0, 11.0, 12.566370614359172]
force_N = [-60.0, -200.0, -80.0, -10.0, 0.0, 5.0, -20.0, -60.0]
[load.piston2]
spring_N_m = 300.0
free_position_m = 0.1
[load.piston2.gas]
angle_rad = [0.3, 1.1, 2.0, 4.0, 6.583185307179586]
force_N = [0.0, -90.0, -20.0, 5.0, 0.0]
interpolation = "linear"
body = "crank"
"""
)
#: Loads along guides of moving bodies: a block that keeps the lever's angle, and a bead that does not.
ON_BODIES = (
    QUICK_RETURN
    + """
[drive]
kind = "torque"
body = "crank"
time_s = [0.0, 0.2, 0.35, 0.6]
torque_N_m = [2.0, -1.0, 3.0, 0.0]
[load.block]
viscous_N_s_m = 5.0
spring_N_m = 60.0
free_position_m = 0.05
[load.ram]
force_N = -4.0
"""
)
BEAD = """
name = "bead"
end_time_s = 0.6
gravity_m_s2 = 9.81
observe = "wire.along"
ground.pins_m = { O = 0.0 }
[body]
bar = { pins_m = { O = 0.0 }, centre_of_mass_m = [0.1, 0.02], mass_kg = 0.5, inertia_kg_m2 = 2e-3 }
bead = { pins_m = { P = [0.01, 0.0] }, centre_of_mass_m = [0.0, 0.015], mass_kg = 0.3, inertia_kg_m2 = 1e-4 }
[guide]
wire = { body = "bead", pin = "P", on = "bar", through_m = [0.05, 0.03], angle_rad = 0.2, turns = true }
[load.bead]
spring_N_m = 40.0
free_position_m = 0.12
viscous_N_s_m = 0.5
[start]
angle_rad = { bar = 0.3, bead = -0.4 }
position_m = { wire = 0.1 }
hold = ["bar", "bead", "wire"]
speed_rad_s = { bar = 4.0, bead = 7.0 }
speed_m_s = { wire = 0.2 }
"""
#: A pendulum on a cart whose motion along its guide is prescribed, and a crank that carries one.
CART = """
name = "cart"
end_time_s = 0.8
gravity_m_s2 = 9.81
observe = "arm.angle"
[body]
cart = { pins_m = { C = 0.0 }, mass_kg = 1.0, inertia_kg_m2 = 1e-3 }
arm = { pins_m = { C = 0.0 }, centre_of_mass_m = [0.2, 0.05], mass_kg = 0.4, inertia_kg_m2 = 2e-3 }
[guide]
rail = { body = "cart", pin = "C", through_m = [0.1, 0.2], angle_rad = 0.4 }
[start]
angle_rad = { arm = -1.0 }
position_m = { rail = 0.05 }
hold = ["arm", "rail"]
speed_rad_s = { arm = 1.5 }
speed_m_s = { rail = 0.3 }
[drive]
guide = "rail"
"""
TABLE = """kind = "table"
time_s = [0.0, 0.3, 0.5, 0.9]
position_m = [0.0, 0.1, 0.05, 0.2]
end_slopes = [0.3, 0.0]
"""
SWUNG = """
name = "swung"
end_time_s = 0.5
gravity_m_s2 = 9.81
observe = "arm.angle"
ground.pins_m = { O = 0.0 }
[body]
crank = { pins_m = { O = 0.0, A = 0.1 }, mass_kg = 1.0, inertia_kg_m2 = 1e-3 }
arm = { pins_m = { A = 0.0 }, centre_of_mass_m = 0.2, mass_kg = 0.4, inertia_kg_m2 = 2e-3 }
[start]
angle_rad = { crank = 0.2, arm = -1.0 }
hold = ["crank", "arm"]
speed_rad_s = { crank = 12.0, arm = 1.5 }
[drive]
body = "crank"
"""
#: A four-bar in which nothing turns round: its bars come into line one after the other.
SWINGING = (
    FOUR_BAR.replace("C = [0.28, 0.0]", "C = [0.28, -0.02]")
    .replace("A = 0.1 }", "A = 0.19 }")
    .replace("A = 0.0, B = 0.25 }", "A = 0.0, B = 0.2 }")
    .replace("B = 0.2 }, mass_kg = 0.35", "B = 0.21 }, mass_kg = 0.35")
    .replace("crank = 0.7, coupler = 0.5, rocker = 1.8", "crank = 1.7, coupler = 0.1, rocker = 1.9")
    .replace("crank = 20.0", "crank = 6.0")
    .replace("end_time_s = 0.5", "end_time_s = 1.5")
)
#: A parallelogram whose left side turns at 3 rad/s, as nothing pulls: flat after the rest of half a turn.
FLAT = PARALLELOGRAM.replace("left = 2.0", "left = 3.0").replace("constant-speed", "free")
FLAT_S = (math.pi - 1.0) / 3.0
#: It is refused from an angle of 1e-4 rad on (``partition.SINGULAR``); a tolerance of 1e-3 is as far off.
FLAT_WITHIN_S = 1e-4
#: The same four-bar with a loose pin at A, which a torque drives.
LOOSE_AND_LOADED = (
    LOADED.replace("end_time_s = 0.5", "end_time_s = 0.05").replace("= 20.0", "= 60.0")
    + f"""
[clearance.A]{WALL}bearing = "coupler"
friction = {{ law = "tanh", coefficient = 0.1, regularisation_speed_m_s = 0.1 }}
"""
)
#: Two cranks, two couplers: one crank's motion is prescribed, and a loop is left with a freedom.
FIVE_BAR = """
name = "five-bar"
end_time_s = 0.4
gravity_m_s2 = 9.81
observe = "B.y"
ground.pins_m = { O = 0.0, C = 0.3 }
[body]
left = { pins_m = { O = 0.0, A = 0.08 }, centre_of_mass_m = 0.03, mass_kg = 0.4, inertia_kg_m2 = 4e-4 }
up = { pins_m = { A = 0.0, B = [0.2, 0.01] }, centre_of_mass_m = 0.1, mass_kg = 0.3, inertia_kg_m2 = 1e-3 }
down = { pins_m = { D = 0.0, B = 0.22 }, centre_of_mass_m = 0.1, mass_kg = 0.3, inertia_kg_m2 = 1e-3 }
right = { pins_m = { C = 0.0, D = 0.1 }, centre_of_mass_m = 0.05, mass_kg = 0.3, inertia_kg_m2 = 5e-4 }
[start]
angle_rad = { left = 1.0, up = 0.6, down = 2.2, right = 1.2 }
hold = ["left", "right"]
speed_rad_s = { left = 15.0, right = -2.0 }
[drive]
body = "left"
kind = "fluctuating"
amplitude_rad_s = 4.0
frequency_Hz = 9.0
"""
#: A slider whose motion is prescribed, with a loose pin at its rod; and bars between two loose pins.
DRIVEN_SLIDER = f"""
name = "driven-slider"
end_time_s = 0.02
gravity_m_s2 = 9.81
observe = "A.y"
ground.pins_m = {{ O = 0.0 }}
[body]
slider = {{ pins_m = {{ B = 0.0 }}, mass_kg = 0.5, inertia_kg_m2 = 1e-3 }}
rod = {{ pins_m = {{ B = 0.0, A = 0.2 }}, centre_of_mass_m = 0.08, mass_kg = 0.3, inertia_kg_m2 = 1e-3 }}
crank = {{ pins_m = {{ A = 0.0, O = 0.06 }}, centre_of_mass_m = 0.02, mass_kg = 0.4, inertia_kg_m2 = 4e-4 }}
[guide]
bed = {{ body = "slider", pin = "B", through_m = [0.0, 0.01], angle_rad = 0.1 }}
[start]
position_m = {{ bed = 0.21 }}
angle_rad = {{ rod = 2.9, crank = 4.0 }}
hold = ["bed"]
speed_m_s = {{ bed = -1.0 }}
[drive]
guide = "bed"
kind = "fluctuating"
amplitude_m_s = 3.0
frequency_Hz = 40.0
[clearance.A]{WALL}
"""
FLOATING = (
    FOUR_BAR.replace("end_time_s = 0.5", "end_time_s = 0.03").replace("= 20.0", "= 40.0")
    + f"[clearance.O]{WALL}[clearance.B]{WALL}"
)
RIGID = (
    FOUR_BAR.replace("end_time_s = 0.5", "end_time_s = 0.025")
    + """
[clearance.B]
radial_clearance_m = 5e-4
bearing_radius_m = 0.01
law = "rigid"
restitution = 0.6
"""
)
#: A block that a slot of a bar and one of a cart lead: the way along the first is a coordinate in a loop.
CROSSING = """
name = "crossing"
end_time_s = 0.4
gravity_m_s2 = 9.81
observe = "P.y"
ground.pins_m = { O = 0.0 }
[body]
bar = { pins_m = { O = 0.0 }, centre_of_mass_m = 0.1, mass_kg = 0.5, inertia_kg_m2 = 2e-3 }
block = { pins_m = { P = [0.01, 0.02] }, mass_kg = 0.3, inertia_kg_m2 = 2e-4 }
cart = { pins_m = { C = 0.0 }, mass_kg = 0.8, inertia_kg_m2 = 1e-3 }
[guide]
bed = { body = "cart", pin = "C", through_m = [0.0, -0.1] }
wire = { body = "block", pin = "P", on = "bar", through_m = [0.0, 0.01], angle_rad = 0.1, turns = true }
post = { body = "block", pin = "P", on = "cart", angle_rad = 1.4, turns = true }
[spring.back]
between = ["ground.O", "cart.C"]
stiffness_N_m = 90.0
free_length_m = 0.15
[start]
angle_rad = { bar = 0.4, block = 0.2 }
position_m = { bed = 0.1, wire = 0.15, post = 0.15 }
hold = ["bar", "block", "bed"]
speed_rad_s = { bar = 3.0, block = 5.0 }
speed_m_s = { bed = 0.4 }
"""

TEXTS = {
    "loaded": LOADED,
    "engine": ENGINE,
    "on-bodies": ON_BODIES,
    "bead": BEAD,
    "cart-constant": CART + 'kind = "constant-speed"\n',
    "cart-ramp": CART + 'kind = "ramp"\nfinal_speed_m_s = -0.5\nramp_time_s = 0.35\n',
    "cart-table": CART + TABLE,
    "swung-fluctuating": SWUNG + 'kind = "fluctuating"\namplitude_rad_s = 5.0\nfrequency_Hz = 7.0\n',
    "swung-ramp": SWUNG + 'kind = "ramp"\nfinal_speed_rad_s = 3.0\nramp_time_s = 0.3\n',
    "swinging": SWINGING,
    "loose-and-loaded": LOOSE_AND_LOADED,
    "five-bar": FIVE_BAR,
    "driven-slider": DRIVEN_SLIDER,
    "floating": FLOATING,
    "rigid": RIGID,
    "crossing": CROSSING,
}


def scene(name: str) -> Scene | GeneralScene:
    """Return the scene of this name."""
    return from_toml(TEXTS[name])

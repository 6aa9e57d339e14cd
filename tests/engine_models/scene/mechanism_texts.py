"""Files of mechanisms: a four-bar, a quick return with a slot and a bed, an engine and more."""

FOUR_BAR = """\
name = "four-bar"
end_time_s = 0.5
gravity_m_s2 = 9.81
observe = "B.x"

[ground]
pins_m = { O = [0.0, 0.0], C = [0.28, 0.0] }

[body.crank]
pins_m = { O = 0.0, A = 0.1 }
mass_kg = 0.4
inertia_kg_m2 = 4e-4
centre_of_mass_m = 0.04

[body.coupler]
pins_m = { A = 0.0, B = 0.25 }
mass_kg = 0.3
inertia_kg_m2 = 2e-3
centre_of_mass_m = 0.1

[body.rocker]
pins_m = { C = 0.0, B = 0.2 }
mass_kg = 0.35
inertia_kg_m2 = 1.2e-3
centre_of_mass_m = 0.09

[start]
angle_rad = { crank = 0.7, coupler = 0.5, rocker = 1.8 }
hold = ["crank"]
speed_rad_s = { crank = 20.0 }

[drive]
kind = "free"
"""
QUICK_RETURN = """\
name = "quick-return"
end_time_s = 0.5
gravity_m_s2 = 9.81
observe = "E.x"

[ground]
pins_m = { C = [0.0, 0.0], O = [0.0, 0.2] }

[body.crank]
pins_m = { O = 0.0, A = 0.08 }
mass_kg = 1.0
inertia_kg_m2 = 2e-3

[body.block]
pins_m = { A = 0.0 }
mass_kg = 0.2
inertia_kg_m2 = 5e-5

[body.lever]
pins_m = { C = 0.0, D = 0.4 }
mass_kg = 1.5
inertia_kg_m2 = 2e-2
centre_of_mass_m = 0.2

[body.rod]
pins_m = { D = 0.0, E = 0.15 }
mass_kg = 0.3
inertia_kg_m2 = 6e-4
centre_of_mass_m = 0.075

[body.ram]
pins_m = { E = 0.0 }
mass_kg = 2.0
inertia_kg_m2 = 1e-2

[guide.slot]
body = "block"
pin = "A"
on = "lever"

[guide.bed]
body = "ram"
pin = "E"
through_m = [0.0, 0.42]

[load.ram]
force_N = -40.0

[start]
angle_rad = { crank = 0.3, lever = 1.2, block = 1.2, rod = 0.2 }
hold = ["crank"]
speed_rad_s = { crank = 12.0 }

[drive]
kind = "constant-speed"
"""
#: Its pistons have gas over two revolutions and over one.
TWIN = """\
name = "v-twin"
end_time_s = 0.2
gravity_m_s2 = 9.81
observe = "left.along"

[ground]
pins_m = { O = 0.0 }

[body.crank]
pins_m = { O = 0.0, A = 0.05 }
mass_kg = 1.0
inertia_kg_m2 = 2e-3

[body.rod1]
pins_m = { A = 0.0, B = 0.15 }
mass_kg = 0.3
inertia_kg_m2 = 6e-4
centre_of_mass_m = 0.05

[body.rod2]
pins_m = { A = 0.0, D = 0.15 }
mass_kg = 0.3
inertia_kg_m2 = 6e-4
centre_of_mass_m = 0.05

[body.piston1]
pins_m = { B = 0.0 }
mass_kg = 0.25
inertia_kg_m2 = 1e-4

[body.piston2]
pins_m = { D = 0.0 }
mass_kg = 0.25
inertia_kg_m2 = 1e-4

[guide.left]
body = "piston1"
pin = "B"
angle_rad = "135 deg"

[guide.right]
body = "piston2"
pin = "D"
angle_rad = "45 deg"

[load.piston1.gas]
body = "crank"
angle_rad = ["0 turn", "0.5 turn", "1 turn", "1.5 turn", "2 turn"]
force_N = [-100.0, -10.0, -2.0, -10.0, -100.0]

[load.piston2.gas]
body = "crank"
angle_rad = [0.0, 2.0, 4.0, "1 turn"]
force_N = [-2.0, -10.0, -50.0, -2.0]

[start]
angle_rad = { crank = 0.1, rod1 = 2.3, rod2 = 0.8 }
hold = ["crank"]
speed_rad_s = { crank = 40.0 }

[drive]
kind = "motor"
body = "crank"
stall_torque_N_m = 5.0
no_load_speed_rad_s = 100.0
"""
#: Room of a pin in its bearing, to be put under the head of a section.
ROOM = """\
radial_clearance_m = 5e-4
bearing_radius_m = 0.01
law = "lankarani-nikravesh"
young_modulus_Pa = "207 GPa"
poisson_ratio = 0.3
restitution = 0.9
"""

"""Scenes of mechanisms that have every kind of part: as texts."""

#: An arm with a block in a slot of it, and a link to a cart that is driven along a rail. The link has the
#: bearing of the pin of the arm, though it is named later. Loads are of every kind.
DRIVEN = """
name = "machine"
end_time_s = 0.2
gravity_m_s2 = [1.5, -9.0]
observe = "slot.along"
ground.pins_m = { O = [0.1, 0.2], C = [-0.2, 0.3] }
[body.arm]
pins_m = { O = 0.0, P = [0.3, 0.02], Q = [0.1, -0.05] }
centre_of_mass_m = [0.12, 0.01]
mass_kg = 1.2
inertia_kg_m2 = 0.02
[body.block]
pins_m = { S = [0.01, 0.02], V = [0.03, 0.0] }
mass_kg = 0.3
inertia_kg_m2 = 4e-4
[body.cart]
pins_m = { T = [0.02, 0.01] }
mass_kg = 0.8
inertia_kg_m2 = 3e-3
[body.link]
pins_m = { T = 0.0, P = 0.25 }
centre_of_mass_m = [0.1, -0.01]
mass_kg = 0.4
inertia_kg_m2 = 5e-3
[guide.slot]
body = "block"
pin = "S"
on = "arm"
through_m = [0.05, 0.03]
angle_rad = 0.2
[guide.rail]
body = "cart"
pin = "T"
through_m = [0.0, -0.1]
angle_rad = 0.1
[spring.outer]
between = ["ground.C", "arm.Q"]
stiffness_N_m = 300.0
free_length_m = 0.2
damping_N_s_m = 3.0
[spring.inner]
between = ["link.T", "block.V"]
stiffness_N_m = 200.0
free_length_m = 0.3
damping_N_s_m = 2.0
[load.arm]
force_N = 5.0
along_rad = 2.1
torque_N_m = 0.4
viscous_N_m_s = 0.03
by_time = { time_s = [0.0, 0.1, 0.2, 0.3], torque_N_m = [0.1, 0.5, -0.2, 0.1] }
[load.block]
force_N = 3.0
viscous_N_s_m = 1.5
spring_N_m = 80.0
free_position_m = 0.1
by_time = { time_s = [0.0, 0.1, 0.2, 0.3], force_N = [2.0, -3.0, 4.0, 1.0] }
gas = { body = "link", angle_rad = [0.0, 1.5, 4.0, 6.283185307179586], force_N = [1.0, 4.0, -2.0, 1.0] }
[load.cart]
viscous_N_s_m = 2.0
torque_N_m = 0.3
[clearance.P]
bearing = "link"
radial_clearance_m = 5e-4
bearing_radius_m = 0.02
law = "kelvin-voigt"
stiffness = 1e6
damping_N_s_m = 50.0
friction = { law = "tanh", coefficient = 0.2, regularisation_speed_m_s = 0.01 }
[drive]
kind = "fluctuating"
guide = "rail"
amplitude_m_s = 0.3
frequency_Hz = 4.0
[start]
time_s = 0.05
angle_rad = { arm = 0.3, block = 0.5, link = 1.2 }
position_m = { slot = 0.1, rail = 0.3 }
hold = ["slot", "rail"]
speed_m_s = { slot = 0.2, rail = 0.28531695488854607 }
"""
#: The same with a motor on the arm and a cart that is free.
TURNED = (
    DRIVEN.split("[drive]")[0]
    + """
[drive]
kind = "motor"
body = "arm"
stall_torque_N_m = 6.0
no_load_speed_rad_s = 40.0
[start]
angle_rad = { arm = 0.3, block = 0.5, link = 1.2 }
position_m = { slot = 0.1, rail = 0.3 }
hold = ["slot", "rail"]
speed_m_s = { slot = 0.2, rail = -0.1 }
"""
)
MACHINES = {"driven": DRIVEN, "turned": TURNED}

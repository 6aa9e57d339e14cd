"""Scenes of mechanisms as texts, and where they end: by an independent integration in minimal coordinates.

That integration has the angles of bodies and the ways along guides as coordinates of a spanning tree, closes
loops by Newton's method at every evaluation, and takes DOP853's steps at a tolerance of 1e-13: neither
multipliers nor absolute coordinates, nothing in common with the reference but the data.
"""

from engine_models.scene.file import from_toml
from engine_models.scene.general import GeneralScene
from engine_models.scene.scene import Scene

CRANK_SLIDER = """
name = "crank-slider"
end_time_s = 1.0
gravity_m_s2 = 9.81
crank = { length_m = 0.05, mass_kg = 0.3, inertia_kg_m2 = 1e-05, centre_of_mass_m = 0.025 }
rod = { length_m = 0.12, mass_kg = 0.21, inertia_kg_m2 = 2.5e-05, centre_of_mass_m = 0.06 }
slider = { mass_kg = 0.14, inertia_kg_m2 = 0.0001 }
start = { crank_angle_rad = 0.0, crank_speed_rad_s = 62.83185307179586 }
drive = { kind = "free" }
"""
OFFSET_CRANK_SLIDER = CRANK_SLIDER.replace(
    "0.0001 }", "0.0001, guide_offset_m = 0.02, guide_angle_rad = 0.3 }"
)
WALL = """
radial_clearance_m = 5e-4
bearing_radius_m = 0.01
law = "lankarani-nikravesh"
young_modulus_Pa = 207e9
poisson_ratio = 0.3
restitution = 0.9
"""
CRANK_SLIDER_CLEARANCE = (
    CRANK_SLIDER.replace("1e-05", "1e-4")
    .replace("2.5e-05", "2.5e-4")
    .replace("end_time_s = 1.0", "end_time_s = 0.006")
    .replace("62.83185307179586", "523.5987755982989")
    .replace("free", "constant-speed")
    + f"[clearance.B]{WALL}"
)
FOUR_BAR = """
name = "four-bar"
end_time_s = 0.5
gravity_m_s2 = 9.81
observe = "B.x"
ground.pins_m = { O = [0.0, 0.0], C = [0.28, 0.0] }
[body]
crank = { pins_m = { O = 0.0, A = 0.1 }, mass_kg = 0.4, inertia_kg_m2 = 4e-4, centre_of_mass_m = 0.04 }
coupler = { pins_m = { A = 0.0, B = 0.25 }, mass_kg = 0.3, inertia_kg_m2 = 2e-3, centre_of_mass_m = 0.1 }
rocker = { pins_m = { C = 0.0, B = 0.2 }, mass_kg = 0.35, inertia_kg_m2 = 1.2e-3, centre_of_mass_m = 0.09 }
[start]
angle_rad = { crank = 0.7, coupler = 0.5, rocker = 1.8 }
hold = ["crank"]
speed_rad_s = { crank = 20.0 }
"""
FOUR_BAR_CLEARANCE = FOUR_BAR.replace("0.5\n", "0.1\n", 1).replace("= 20.0", "= 60.0") + (
    f'[drive]\nkind = "constant-speed"\nbody = "crank"\n[clearance.B]{WALL}'
)
ANDREWS = """
name = "andrews-squeezer"
end_time_s = 0.03
observe = "K3.angle"
ground.pins_m = { O = 0.0, A = [-0.06934, -0.00227], B = [-0.03635, 0.03273], C = [0.014, 0.072] }
[body]
K1 = { pins_m = { O = -92e-5, P = 608e-5 }, mass_kg = 0.04325, inertia_kg_m2 = 2.194e-6 }
K2 = { pins_m = { P = 115e-4, E = -165e-4 }, mass_kg = 0.00365, inertia_kg_m2 = 4.410e-7 }
K4 = { pins_m = { G = [0.0, 579e-5], E = [0.0, -1421e-5] }, mass_kg = 0.00706, inertia_kg_m2 = 5.667e-7 }
K6 = { pins_m = { H = -579e-5, E = 1421e-5 }, mass_kg = 0.00706, inertia_kg_m2 = 5.667e-7 }
[body.K3]
pins_m = { B = [-1043e-5, 1874e-5], E = [-1043e-5, -1626e-5], D = [957e-5, 74e-5] }
mass_kg = 0.02373
inertia_kg_m2 = 5.255e-6
[body.K5]
pins_m = { A = [-2308e-5, -916e-5], G = [1692e-5, -916e-5] }
mass_kg = 0.07050
inertia_kg_m2 = 1.169e-5
[body.K7]
pins_m = { H = [449e-5, -2772e-5], A = [449e-5, 1228e-5] }
mass_kg = 0.05498
inertia_kg_m2 = 1.912e-5
[spring.D]
between = ["ground.C", "K3.D"]
stiffness_N_m = 4530.0
free_length_m = 0.07785
[drive]
kind = "torque"
body = "K1"
torque_N_m = 0.033
[start]
angle_rad = { K1 = -0.0617138900142764496, K2 = -0.06, K3 = 0.46, K4 = 0.71, K5 = 0.49, K6 = 1.0, K7 = 1.23 }
hold = ["K1"]
speed_rad_s = { K1 = 0.0 }
"""
SCOTCH_YOKE = """
name = "scotch-yoke"
end_time_s = 0.3
gravity_m_s2 = 9.81
observe = "Y.x"
ground.pins_m = { O = 0.0 }
[body]
crank = { pins_m = { O = 0.0, A = 0.05 }, centre_of_mass_m = 0.02, mass_kg = 0.4, inertia_kg_m2 = 4e-4 }
yoke = { pins_m = { Y = 0.0 }, mass_kg = 0.6, inertia_kg_m2 = 1e-3 }
[guide]
frame = { body = "yoke", pin = "Y" }
slot = { body = "crank", pin = "A", on = "yoke", angle_rad = 1.5707963267948966, turns = true }
[start]
angle_rad = { crank = 0.4 }
hold = ["crank"]
speed_rad_s = { crank = 30.0 }
"""
QUICK_RETURN = """
name = "quick-return"
end_time_s = 0.5
gravity_m_s2 = 9.81
observe = "E.x"
ground.pins_m = { C = 0.0, O = [0.0, 0.20] }
[body]
crank = { pins_m = { O = 0.0, A = 0.08 }, mass_kg = 1.0, inertia_kg_m2 = 2e-3 }
block = { pins_m = { A = 0.0 }, mass_kg = 0.2, inertia_kg_m2 = 5e-5 }
lever = { pins_m = { C = 0.0, D = 0.40 }, centre_of_mass_m = 0.2, mass_kg = 1.5, inertia_kg_m2 = 2e-2 }
rod = { pins_m = { D = 0.0, E = 0.15 }, centre_of_mass_m = 0.075, mass_kg = 0.3, inertia_kg_m2 = 6e-4 }
ram = { pins_m = { E = 0.0 }, mass_kg = 2.0, inertia_kg_m2 = 1e-2 }
[guide]
slot = { body = "block", pin = "A", on = "lever" }
bed = { body = "ram", pin = "E", through_m = [0.0, 0.42] }
[start]
angle_rad = { crank = 0.3, lever = 1.2, block = 1.2, rod = 0.2 }
hold = ["crank"]
speed_rad_s = { crank = 12.0 }
"""
V_TWIN = """
name = "v-twin"
end_time_s = 0.2
gravity_m_s2 = 9.81
observe = "B.x"
ground.pins_m = { O = 0.0 }
[body]
crank = { pins_m = { O = 0.0, A = 0.05 }, mass_kg = 1.0, inertia_kg_m2 = 2e-3 }
rod1 = { pins_m = { A = 0.0, B = 0.15 }, centre_of_mass_m = 0.05, mass_kg = 0.3, inertia_kg_m2 = 6e-4 }
rod2 = { pins_m = { A = 0.0, D = 0.15 }, centre_of_mass_m = 0.05, mass_kg = 0.3, inertia_kg_m2 = 6e-4 }
piston1 = { pins_m = { B = 0.0 }, mass_kg = 0.25, inertia_kg_m2 = 1e-4 }
piston2 = { pins_m = { D = 0.0 }, mass_kg = 0.25, inertia_kg_m2 = 1e-4 }
[guide]
left = { body = "piston1", pin = "B", angle_rad = 2.356194490192345 }
right = { body = "piston2", pin = "D", angle_rad = 0.7853981633974483 }
[start]
angle_rad = { crank = 0.1, rod1 = 2.3, rod2 = 0.8 }
hold = ["crank"]
speed_rad_s = { crank = 40.0 }
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
#: The mechanisms of the truth, by their names.
TEXTS = {
    "crank-slider": CRANK_SLIDER,
    "offset-crank-slider": OFFSET_CRANK_SLIDER,
    "four-bar": FOUR_BAR,
    "andrews": ANDREWS,
    "scotch-yoke": SCOTCH_YOKE,
    "quick-return": QUICK_RETURN,
    "v-twin": V_TWIN,
    "four-bar-clearance": FOUR_BAR_CLEARANCE,
    "crank-slider-clearance": CRANK_SLIDER_CLEARANCE,
}

#: Where the bodies are at the end: x and y of centres of mass in m, angles in rad.
ENDS: dict[str, dict[str, tuple[float, float, float]]] = {
    "crank-slider": {
        "crank": (0.021162412124577624, -0.01330985774039415, 43.420870599288406),
        "rod": (0.1008299324614342, -0.01330985774039415, 0.22369181682515024),
        "slider": (0.15933504067371312, 0.0, 0.0),
    },
    "offset-crank-slider": {
        "crank": (0.02463856659076287, -0.004235686054530467, 56.37841908144221),
        "rod": (0.09655102411377492, 0.02847695987123027, 0.6634079406349943),
        "slider": (0.1438249150460241, 0.06542529185152147, 0.0),
    },
    "four-bar": {
        "crank": (-0.02997839782844288, -0.026481987531898194, 10.148328316407612),
        "coupler": (-0.0014591316469459714, 0.001615979096139017, 0.7453233684751164),
        "rocker": (0.20294702323268315, 0.046506330443234586, 2.5985573740464045),
    },
    "scotch-yoke": {
        "crank": (0.0043196887266223425, 0.019527936125077118, 7.636281682497942),
        "yoke": (0.010799221816555864, 0.0, 0.0),
    },
    "quick-return": {
        "crank": (0.0, 0.2, 4.563190586263945),
        "block": (-0.011891638386943739, 0.12088875594155932, 1.6688493141768705),
        "lever": (-0.019579188595787788, 0.19903933122358147, 1.6688493141768705),
        "rod": (0.03503639176132058, 0.4090393312235815, 0.14666752142295508),
        "ram": (0.10923116071421674, 0.42000000000000004, 0.0),
    },
    "v-twin": {
        "crank": (0.0, 0.0, 8.001946901963464),
        "rod1": (-0.049037694843684726, 0.07709260008052006, 2.5558973831872907),
        "rod2": (0.03616275579948376, 0.07404605705972785, 0.514211010216763),
        "piston1": (-0.13237049049594105, 0.13237049049594102, 0.0),
        "piston2": (0.12323086143356442, 0.12323086143356439, 0.0),
    },
    "andrews": {
        "K1": (-0.0009151423246976501, -9.441676517960567e-05, 15.81077119515303),
        "K2": (-0.018446027217581058, -0.0013436814839730385, 0.054400136742036365),
        "K3": (-0.02516389303546865, 0.014431270235940881, 0.04082224011963937),
        "K4": (-0.034774971660382833, 0.011968402202972466, -0.010320150462137176),
        "K5": (-0.053947934888532945, 0.01721528500187664, 0.5244099658799539),
        "K6": (-0.03475089602296668, -0.016449815495207513, 1.582810857384029),
        "K7": (-0.06094135428600625, -0.0122910403736745, 1.0480807410419377),
    },
    "four-bar-clearance": {
        "crank": (0.03657532592941263, 0.01619399682466426, 6.700000000000009),
        "coupler": (0.16861859969543175, 0.10407118259932632, 0.6891247499439827),
        "rocker": (0.28196882744410323, 0.08997846252573638, 1.548918721134911),
    },
    "crank-slider-clearance": {
        "crank": (-0.025, 0.0, 3.1415926535897905),
        "rod": (0.009999624611170418, -0.00021224165150063602, -0.0035373682355077873),
        "slider": (0.06972746061699639, 0.0, 0.0),
    },
}


def scene(text: str, **changes: object) -> Scene | GeneralScene:
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

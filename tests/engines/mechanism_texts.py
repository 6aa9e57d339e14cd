"""Scenes of mechanisms as texts, and where they end: by an independent integration in minimal coordinates.

That integration has the angles of bodies and the ways along guides as coordinates of a spanning tree, closes
loops by Newton's method at every evaluation, and takes DOP853's steps at a tolerance of 1e-13: neither
multipliers nor absolute coordinates, nothing in common with the reference but the data.
"""

from pathlib import Path

from engine_models.scene import library
from engine_models.scene.file import from_toml
from engine_models.scene.scene import Scene

#: Of the files of the library's mechanisms.
FOLDER = Path(library.__file__).parent

#: The library's mechanisms of the truth, by short names.
FILES = {"crank-slider": "ideal-free", "andrews": "andrews-squeezer"}
NAMES = (
    *("crank-slider", "offset-crank-slider", "four-bar", "andrews"),
    *("scotch-yoke", "quick-return", "v-twin", "four-bar-clearance"),
)
TEXTS = {name: (FOLDER / f"{FILES.get(name, name)}.toml").read_text(encoding="utf-8") for name in NAMES}
CRANK_SLIDER, OFFSET_CRANK_SLIDER, FOUR_BAR, ANDREWS = (TEXTS[name] for name in NAMES[:4])
SCOTCH_YOKE, QUICK_RETURN, V_TWIN, FOUR_BAR_CLEARANCE = (TEXTS[name] for name in NAMES[4:])
TEXTS["crank-slider-clearance"] = library.clearance_driven_05().replace("end_time_s", 0.006).to_toml()
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

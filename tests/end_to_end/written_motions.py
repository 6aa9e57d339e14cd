"""The study of motions on curves with round numbers.

A run has 13 samples, a millisecond and 30 degrees apart, and each engine is off the truth by its own part.
"""

import json
import math
import re
from pathlib import Path
from typing import Any

from reports.results import Results
from tests.end_to_end.written_rows import results_of, row

SAMPLES = 13
TIMES_S = [0.001 * k for k in range(SAMPLES)]
ANGLES_RAD = [0.5 + math.radians(30 * k) for k in range(SAMPLES)]
#: By how much of the truth each engine is off, and its colour.
ARMS = {("reference", "none"): (0.001, "#000000"), ("exudyn", "trapezoidal"): (0.01, "#D55E00")}
LOOSE, CLEARANCE_M = "clearance-driven-0.5mm", 5e-4
#: Where the pin is, in m, and how far that is in the wall: 0.5 mm of clearance are used up from sample 4 on.
GAP_M = [(1e-4 * k, 0.75e-4 * k) for k in range(SAMPLES)]
DEPTH_M = [1.25e-4 * k - CLEARANCE_M for k in range(SAMPLES)]
FORCE_N = [max(depth, 0.0) * 4e6 for depth in DEPTH_M]
LAWS = {"hertz": (0.0, 1.0), "flores": (3.0, 0.8), "gonthier": (2.0, 0.9)}
SCENE = {
    "name": LOOSE,
    "end_time_s": 0.024,
    "gravity_m_s2": 9.81,
    "crank": {"length_m": 0.05, "mass_kg": 0.3, "inertia_kg_m2": 1e-4, "centre_of_mass_m": 0.025},
    "rod": {"length_m": 0.12, "mass_kg": 0.21, "inertia_kg_m2": 2.5e-4, "centre_of_mass_m": 0.06},
    "slider": {"mass_kg": 0.14, "inertia_kg_m2": 1e-4},
    "start": {"crank_angle_rad": 0.0, "crank_speed_rad_s": 523.5987755982989},
    "drive": {"kind": "constant-speed"},
    "load": {},
    "clearance": {
        "B": {
            "radial_clearance_m": CLEARANCE_M,
            "bearing_radius_m": 0.01,
            "law": "lankarani-nikravesh",
            "young_modulus_Pa": 2.07e11,
            "poisson_ratio": 0.3,
            "restitution": 0.9,
        }
    },
}


def held(name: str, true: list[float], off: float) -> dict[str, list[float]]:
    """Return a curve that is off the truth by a part of it, the truth's, and its error."""
    errors = re.sub(r"^(.*?)(_m_s|_N_m|_m|_N)$", r"\1_error\2", name)
    return {name: [(1 + off) * x for x in true], f"true_{name}": true, errors: [off * x for x in true]}


def loose(off: float) -> dict[str, list[float]]:
    """Return the curves of the pin and its contact; the pin's own way is the truth's."""
    curves = held("contact_B_normal_force_N", FORCE_N, off)
    for prefix in ("", "true_"):
        curves |= {f"{prefix}clearance_B_{axis}_m": [at[k] for at in GAP_M] for k, axis in enumerate("xy")}
        curves[f"{prefix}contact_B_penetration_m"] = DEPTH_M
    return curves


def motions(folder: Path) -> Results:
    """Write the study and read it."""
    rows: list[dict[str, Any]] = []
    curves: dict[str, Any] = {}
    common = {"time_s": TIMES_S, "crank_angle_rad": ANGLES_RAD, "true_crank_angle_rad": ANGLES_RAD}

    def add(scene: str, arm: tuple[str, str], of: dict[str, list[float]], **columns: Any) -> None:
        rows.append(row(len(rows), scene, *arm, 1e-3, end_time_s=0.012, **columns))
        curves[rows[-1]["case"]] = {**common, **of}

    touching = {"contacts_ended": 7, "shortest_contact_s": 2.4e-5, "contact_B_normal_force_N": FORCE_N[-1]}
    for arm, (off, _) in ARMS.items():
        add(f"{LOOSE}-first-impact", arm, loose(off), view="impact", scene_json=json.dumps(SCENE), **touching)
    for law, (loss, less) in LAWS.items():
        depth = [
            1e-5 * (3 - abs(k - 4)) for k in range(9)
        ]  # in at the second sample, out at the last but one
        force = [(1.0 if k <= 4 else less) * 2e8 * max(x, 0.0) for k, x in enumerate(depth)]
        columns = {"dissipated_energy_J": loss, "law": law, "restitution": None if law == "hertz" else 0.5}
        of_law = {"contact_B_penetration_m": depth, "contact_B_normal_force_N": force}
        add(f"{LOOSE}-{law}", ("reference", "none"), of_law, view="law", **columns, **touching)
    rows.append(row(len(rows), LOOSE, "pymunk", "tuned", 1e-3, view="impact", status="failed"))
    rows[-1] |= {"reason": "not finite at t = 0.003 s", "setting_iterations": 30}
    return results_of(folder, rows, curves)

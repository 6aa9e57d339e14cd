"""Random chains of bars by a seeded recipe: pins of which some have clearance, loads, springs, any drive.

``python -m tests.helpers.random_mechanisms ENGINE COUNT`` runs the first so many, each in a process of its
own, and prints how each ends: no scene may end the process that runs it.
"""

import math
import sys
from collections import Counter
from multiprocessing import get_context
from typing import Any

import numpy as np

from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene

#: Exit codes of a run that fails, and of one that an engine refuses.
FAILED, REFUSED = 3, 4
FORK = get_context("fork")
WALL: dict[str, Any] = {"radial_clearance_m": 2e-4, "bearing_radius_m": 0.015, "law": "kelvin-voigt"}
WALL |= {"stiffness": 1e8, "damping_N_s_m": 2e3}
DRIVES: tuple[dict[str, Any], ...] = (
    {"kind": "free"},
    {"kind": "torque", "torque_N_m": 5.0},
    {"kind": "motor", "stall_torque_N_m": 6.0, "no_load_speed_rad_s": 40.0},
    {"kind": "ramp", "final_speed_rad_s": 12.0, "ramp_time_s": 6e-3},
    {"kind": "fluctuating", "amplitude_rad_s": 2.0, "frequency_Hz": 50.0},
    {"kind": "table", "time_s": [0.0, 0.01, 0.02, 0.03], "angle_rad": [0.0, 0.05, 0.15, 0.2]},
    {"kind": "constant-speed"},
)
BY_TIME = {"time_s": [0.0, 0.005, 0.01, 0.02], "force_N": [2.0, -30.0, 40.0, 1.0]}


def random_mechanism(seed: int) -> Scene:
    """Return the scene of a seed: two to six bars from one pin of the ground, mostly to another."""
    chance, count = np.random.default_rng([seed, 5]), 2 + seed % 5
    lengths, angles = chance.uniform(0.2, 0.5, count), chance.uniform(-math.pi, math.pi, count)
    end = np.cumsum([lengths * np.cos(angles), lengths * np.sin(angles)], axis=1)[:, -1]
    closed, ground, driven = count > 2 and chance.random() < 0.8, {"P0": [0.0, 0.0]}, f"b{1 + seed % 2}"
    if closed:
        ground[f"P{count}"] = end.tolist()
    bodies = {
        f"b{k + 1}": {
            "pins_m": {f"P{k}": 0.0, **({f"P{k + 1}": length} if closed or k < count - 1 else {})},
            "mass_kg": 1.0,
            "inertia_kg_m2": 0.02,
            "centre_of_mass_m": length / 2,
        }
        for k, length in enumerate(lengths.tolist())
    }
    joints = [f"P{k}" for k in range(count + closed)]
    loose = {joint: dict(WALL) for joint in joints if chance.random() < 0.4}
    data: dict[str, Any] = {
        "name": f"random-{seed}",
        "end_time_s": 0.01,
        "gravity_m_s2": 9.81,
        "observe": "P1.y",
        "ground": {"pins_m": ground},
        "body": bodies,
        "drive": {**DRIVES[int(chance.integers(len(DRIVES)))], "body": driven},
        "clearance": loose,
        "start": {"angle_rad": dict(zip(bodies, angles.tolist(), strict=True)), "hold": [driven]},
    }
    if data["drive"]["kind"] == "free":
        del data["drive"]["body"]
    names = sorted(bodies, key=lambda name: name != driven)[: count - 2 * closed]
    data["start"]["speed_rad_s"] = dict.fromkeys(names, 6.0)
    if data["drive"]["kind"] == "table":
        del data["start"]["speed_rad_s"][driven]
    if chance.random() < 0.5:
        data["load"] = {"b2": {"force_N": 3.0, "along_rad": 1.0, "viscous_N_m_s": 0.1, "by_time": BY_TIME}}
    if chance.random() < 0.5:
        ends = {"between": ["ground.P0", "b2.P1"], "stiffness_N_m": 300.0, "free_length_m": 0.2}
        data["spring"] = {"pull": {**ends, "damping_N_s_m": 3.0}}
    return Scene.model_validate(data)


def run_alone(engine: str, seed: int) -> int:
    """Return the exit code of a process that runs a random mechanism: negative for a signal's."""
    process = FORK.Process(target=_run, args=(engine, seed))
    process.start()
    process.join()
    return int(process.exitcode or 0)


def _run(name: str, seed: int) -> None:
    settings = {"timeout_s": 10.0} if name == "exudyn" else {}
    try:
        make_engine(name, **settings).simulate(random_mechanism(seed), RunSettings(1e-4, 10))
    except UnsupportedScene as refusal:
        print(seed, refusal)
        sys.exit(REFUSED)
    except SimulationFailed as failure:
        print(seed, failure)
        sys.exit(FAILED)


if __name__ == "__main__":
    engine, count = sys.argv[1], int(sys.argv[2])
    print(Counter(run_alone(engine, seed) for seed in range(count)))

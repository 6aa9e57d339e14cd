"""Crank-sliders: how far those with clearance are followed, runs of theirs, and some unusual ones."""

import numpy as np

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import CLEARANCE_SCENES, SCENES
from engine_models.scene.scene import Link, Scene, Start
from reference_solver.solution import Solution
from reference_solver.solver import StepChoice, solve
from studies.judges.converged_truth import COLLOCATION
from studies.truth.solver import TrueSolver

#: How far each scene is followed: until two independent integrations still agree within the tolerances below,
#: and short enough for a test. Joints touch 5 to 20 times in that time.
HORIZON_S = {name: 0.003 if "driven" in name else 0.016 for name in CLEARANCE_SCENES}
HORIZON_S["clearance-pendulum"] = 0.07  # it falls through its clearance in 0.01 s
HORIZON_S |= {"clearance-start-up": 0.007, "clearance-compressor": 0.006}
#: Asked of the reference: slider positions and impact times against the independent integration.
POSITION_M, IMPACT_S = 1e-9, 1e-10
#: An event-located run at these rates is converged far below that (see the ledger's order below).
FINE = {"driven": StepChoice(5e-6, 400), "free": StepChoice(2e-5, 400)}


def start(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    q, v = start_state(scene)
    return q.ravel(), v.ravel()


def short(name: str) -> Scene:
    return CLEARANCE_SCENES[name]().model_copy(update={"end_time_s": HORIZON_S[name]})


def solved(scene: Scene, choice: StepChoice, samples: int = 30) -> Solution:
    end = scene.end_time_s
    return solve(mechanism_of(scene), *start(scene), end_time_s=end, samples=samples, step=choice)


def touches(run: Solution) -> np.ndarray:
    return np.asarray(run.events[run.events["what"] == 1])


def in_minimal_coordinates(scene: Scene, samples: int = 30, solver: TrueSolver = COLLOCATION) -> Trajectory:
    """Return the independent solution of a scene."""
    return solver.simulate(scene, RunSettings(scene.end_time_s, samples))


def assert_same_touches(scene: Scene, run: Solution, truth: Trajectory) -> None:
    """Assert that all contacts of a truth that are over began in a run too, and but one more a joint did."""
    found, count = touches(run), 0
    for k, joint in enumerate(scene.joints_with_clearance):
        own, true = found[found["contact"] == k], truth.contacts[joint].impacts
        count += len(own)
        assert len(own) - len(true.time_s) in (0, 1)
        own = own[: len(true.time_s)]
        late = np.abs(own["time_s"] - true.time_s).max(initial=0.0)
        assert late < IMPACT_S, f"impacts at {joint} off by {late:.1e} s"
        np.testing.assert_allclose(own["rate"], true.approach_speed_m_s, rtol=1e-6)
    assert count > 1


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

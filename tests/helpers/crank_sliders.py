"""The crank-sliders with clearance: how far and how finely they are followed, and runs of theirs."""

import numpy as np

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.reference.model import mechanism_of
from engine_models.scene.library import CLEARANCE_SCENES
from engine_models.scene.scene import Scene
from reference_solver.solution import Solution
from reference_solver.solver import StepChoice, solve
from studies.independent.solver import IndependentSolver
from studies.judges.converged_truth import COLLOCATION

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


def in_minimal_coordinates(
    scene: Scene, samples: int = 30, solver: IndependentSolver = COLLOCATION
) -> Trajectory:
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

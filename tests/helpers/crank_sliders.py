"""The crank-sliders with clearance: how far and how finely they are followed, and runs of theirs."""

import numpy as np

from engine_models.mechanics.assembly import start_state
from engine_models.reference.model import mechanism_of
from engine_models.scene.library import CLEARANCE_SCENES
from engine_models.scene.scene import Scene
from reference_solver.solution import Solution
from reference_solver.solver import StepChoice, solve

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

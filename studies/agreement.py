"""Agreement: every engine on every ideal scene, at several steps and settings, against the truth."""

from dataclasses import replace

import numpy as np

from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.pymunk.engine import LIBRARY_ERROR_BIAS, LIBRARY_ITERATIONS
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.scene import Scene
from studies.judges.metrics import (
    constraint_violation_m,
    energy_balance_residual_J,
    errors,
    kinetic_energy_J,
    uncertainties,
)
from studies.judges.truth import exact, exact_twins
from studies.ladders import AS_IT_COMES, newcomers
from studies.running.case import Case, Curves, Row, Value

SAMPLES = 200
#: Steps per sample interval, halving the step from one to the next: quick, then what the full set adds.
LADDER, FINER = (2, 4, 8, 16, 32, 64, 128, 256), (512, 1024)
#: Each engine's own settings worth showing, by the name that tables and figures give them.
ARMS: dict[str, dict[str, dict[str, Value]]] = {
    "reference": {
        "none": {"stabilisation": "none"},
        "Baumgarte": {"stabilisation": "baumgarte"},
        "projection": {"stabilisation": "projection"},
    },
    "exudyn": {
        "trapezoidal": {"solver": "TrapezoidalIndex2"},
        "generalized-alpha": {"solver": "GeneralizedAlpha"},
    },
    "pymunk": {
        "out of the box": {
            "iterations": LIBRARY_ITERATIONS,
            "error_bias": LIBRARY_ERROR_BIAS,
            "half_kick_start": False,
        },
        "tuned": {"iterations": 20, "error_bias": 0.0, "half_kick_start": True},
    },
}
#: The reference by DOP853 with a tolerance that leaves its steps as long as they may be, so many intervals
#: between samples. At order 8 shorter ones are in error by round-off alone; none is a step of the ladder, at
#: which engines are compared, since one of these is three of RK4's.
EIGHTH_ORDER: dict[str, Value] = {"method": "dop853", "tolerance": 0.999}
INTERVALS = tuple(2 ** (k / 2 + 0.25) for k in range(1, -7, -1))
#: Pymunk's solver iterations, shown at one step of the ladder.
ITERATIONS, ITERATIONS_STEPS_PER_SAMPLE = (2, 5, 7, 10, 15, 20, 50, 100), 32


def cases(full: bool) -> list[Case]:
    """Return the ladder of steps for every scene, engine and arm, then Pymunk's sweep of iterations."""
    out = []
    for make in IDEAL_SCENES.values():
        scene = make()
        arms = [(engine, arm, settings) for engine in ARMS for arm, settings in ARMS[engine].items()]
        for engine, arm, settings in [*arms, *((name, AS_IT_COMES, {}) for name in newcomers())]:
            for count in LADDER + (FINER if full else ()):
                out.append(_case(scene, engine, arm, count, settings))
        for intervals in INTERVALS:
            case = _case(scene, "reference", "DOP853", 1 / intervals, EIGHTH_ORDER)
            out.append(replace(case, columns={"step_s": case.run.step_s}))
        for iterations in ITERATIONS:
            arm = f"{iterations} iterations"
            out.append(_case(scene, "pymunk", arm, ITERATIONS_STEPS_PER_SAMPLE, {"iterations": iterations}))
    return out


def _case(scene: Scene, engine: str, arm: str, steps_per_sample: float, settings: dict[str, Value]) -> Case:
    step = scene.end_time_s / (SAMPLES * steps_per_sample)
    return Case("agreement", scene, engine, arm, RunSettings(step_s=step, samples=SAMPLES), settings)


def measure(case: Case) -> tuple[Row, Curves]:
    """Run one case and return the largest error of every signal with the truth's uncertainty, and curves."""
    trajectory = make_engine(case.engine, **case.settings).simulate(case.scene, case.run)
    truth, twins = exact(case.scene, case.run.samples), exact_twins(case.scene, case.run.samples)
    curves: Curves = dict(errors(case.scene, trajectory, truth))
    row: Row = {"steps": trajectory.steps}
    row |= {name: float(curve.max()) for name, curve in curves.items()}
    row |= uncertainties(case.scene, truth, twins)
    curves["energy_balance_residual_J"] = energy_balance_residual_J(case.scene, trajectory)
    curves["constraint_violation_m"] = constraint_violation_m(case.scene, trajectory)
    row["energy_balance_residual_J"] = float(np.abs(curves["energy_balance_residual_J"]).max())
    row["constraint_violation_m"] = float(curves["constraint_violation_m"].max())
    row["largest_kinetic_energy_J"] = float(kinetic_energy_J(case.scene, truth).max())
    curves["time_s"] = trajectory.time_s
    return row, curves

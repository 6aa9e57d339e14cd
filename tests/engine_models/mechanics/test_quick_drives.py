"""A drive whose speed changes within a step is followed all the same, or fails in one plain line."""

import numpy as np
import pytest

from engine_models.engine import Engine, RunSettings, SimulationFailed
from engine_models.engines import make_engine
from engine_models.scene.drives import Drive, FluctuatingDrive, RampDrive
from engine_models.scene.library import ideal_driven
from engine_models.scene.scene import Scene
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES, STEP_S = 20, 1e-5
RAMP = RampDrive(kind="ramp", final_speed_rad_s=-50.0, ramp_time_s=1e-6)
FLUCTUATION = FluctuatingDrive(kind="fluctuating", amplitude_rad_s=5.0, frequency_Hz=1e5)


def scene(drive: Drive) -> Scene:
    start = ideal_driven().start.model_copy(update={"crank_speed_rad_s": 100.0})
    return ideal_driven().model_copy(update={"drive": drive, "start": start, "end_time_s": 0.004})


@pytest.mark.parametrize(
    ("engine", "step_s"),
    [
        (make_engine("reference"), STEP_S),
        (make_engine("reference", method="dop853"), 1.0),
        (make_engine("scipy"), STEP_S),
    ],
    ids=["rk4", "dop853", "scipy"],
)
def test_a_ramp_within_a_step_is_cut_into_steps_enough(engine: Engine, step_s: float) -> None:
    of = scene(RAMP)
    run, true = engine.simulate(of, RunSettings(step_s, SAMPLES)), exact(of, SAMPLES)
    assert np.abs(run.position[:, -1, 0] - true.position[:, -1, 0]).max() < 1e-9
    assert run.driver_work_J is not None
    assert true.driver_work_J is not None
    off = np.abs(run.driver_work_J - true.driver_work_J).max() / np.abs(true.driver_work_J).max()
    # RK4's quadrature of a polynomial of degree 9 in sixteen steps: 4e-6 measured.
    assert off < 2e-5, f"work off by {off:.1e}"


@pytest.mark.parametrize("drive", [RAMP, FLUCTUATION], ids=["ramp", "fluctuation"])
@pytest.mark.parametrize("engine", ["exudyn", "pymunk"])
def test_an_engine_of_equal_steps_says_which_field_is_too_quick(engine: str, drive: Drive) -> None:
    field = "ramp_time_s" if drive is RAMP else "frequency_Hz"
    with pytest.raises(SimulationFailed, match=rf"drive\.{field}: expected at least 4 steps .* shorten"):
        make_engine(engine).simulate(scene(drive), RunSettings(STEP_S, SAMPLES))
    make_engine(engine).simulate(scene(drive), RunSettings(2e-7, SAMPLES))

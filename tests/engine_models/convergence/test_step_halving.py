import numpy as np
import pytest

from engine_models.convergence.step_halving import FEWEST_SAMPLES, simulate_to_tolerance
from engine_models.engine import SimulationFailed
from engine_models.engines import make_engine
from engine_models.scene.library import IDEAL_SCENES, SCENES
from engine_models.scene.scene import Scene
from tests.helpers.arrays import joint_forces
from tests.helpers.engines import supporting
from tests.studies.truth.closed_forms.crank_slider import exact

IDEAL = list(IDEAL_SCENES)
#: An order of 1, the hardest case for the estimate: each halving only halves the error.
FIRST_ORDER = {"iterations": 10, "error_bias": 0.9**60, "half_kick_start": False}


@pytest.mark.parametrize("tolerance_m", [1e-3, 1e-7])
@pytest.mark.parametrize(
    ("scene", "engine"), [(scene, e) for scene in IDEAL for e in supporting(SCENES[scene]())]
)
def test_the_promised_tolerance_is_kept(scene: str, engine: str, tolerance_m: float) -> None:
    short = SCENES[scene]().model_copy(update={"end_time_s": 0.05})
    run = simulate_to_tolerance(make_engine(engine), short, tolerance_m, 7)
    truth = exact(short, 7)
    error = np.abs(run.position[:, -1, 0] - truth.position[:, -1, 0]).max()
    assert error <= tolerance_m, f"{error:.3g} m with {run.steps} steps"
    np.testing.assert_allclose(run.time_s, truth.time_s, rtol=1e-12)
    assert joint_forces(run).shape == joint_forces(truth).shape


@pytest.mark.parametrize("tolerance_m", [1e-3, 1e-4, 1e-5])
def test_the_promised_tolerance_is_kept_by_a_method_of_order_1(tolerance_m: float) -> None:
    short = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.05})
    run = simulate_to_tolerance(make_engine("pymunk", **FIRST_ORDER), short, tolerance_m, 7)
    error = np.abs(run.position[:, -1, 0] - exact(short, 7).position[:, -1, 0]).max()
    assert error <= tolerance_m, f"{error:.3g} m with {run.steps} steps"


def test_a_tighter_tolerance_takes_more_steps() -> None:
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.05})
    engine = make_engine("exudyn")
    loose, tight = (simulate_to_tolerance(engine, scene, tol, 10).steps for tol in (1e-4, 1e-7))
    assert FEWEST_SAMPLES <= loose < tight


def test_one_sample_alone_does_not_converge_by_chance() -> None:
    # 4.2 m of crank path between two samples: at the end alone the positions of two bad runs may well agree.
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 1.0})
    run = simulate_to_tolerance(make_engine("reference"), scene, 1e-3, 1)
    assert len(run.time_s) == 2
    assert abs(run.position[:, -1, 0][-1] - exact(scene, 1).position[:, -1, 0][-1]) <= 1e-3


@pytest.mark.parametrize("tolerance_m", [1e-18, 1e-300])
def test_a_tolerance_below_round_off_is_refused(tolerance_m: float) -> None:
    # The first step is no shorter for it, or 1e-300 m would take for ever.
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.01})
    with pytest.raises(SimulationFailed, match=f"not known to {tolerance_m:g} m: two methods part at t"):
        simulate_to_tolerance(make_engine("reference"), scene, tolerance_m, 100)


def test_a_joint_with_clearance_is_sampled_like_the_rest() -> None:
    scene = SCENES["ideal-driven"]().model_dump() | {"end_time_s": 0.0005}
    contact = {"law": "lankarani-nikravesh", "stiffness": 1e9, "restitution": 0.5}
    scene["clearance"] = {"B": {"radial_clearance_m": 5e-4, "bearing_radius_m": 0.01, **contact}}
    run = simulate_to_tolerance(make_engine("reference"), Scene.model_validate(scene), 1e-6, 5)
    assert run.contacts["B"].penetration_m.shape == run.time_s.shape == (6,)

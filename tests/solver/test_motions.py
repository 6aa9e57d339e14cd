"""Tables and motions as functions, and crank-sliders whose loads or drives have kinks or change quickly."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.interpolate import CubicSpline

from engine_models.engine import Engine, RunSettings
from engine_models.engines import make_engine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.format import Drive
from engine_models.scene.library import ideal_compressor, ideal_driven
from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankGas, CrankLoad
from reference_solver.mechanism.data import ConstantSpeed, Course, Fluctuation, Motion, Ramp
from reference_solver.mechanism.motions import PiecewiseCubic, moved, pieces_of
from tests.engines.runs import errors
from tests.helpers.ideal_crank_slider import exact

SAMPLES = 40


def scene(speed: float, drive: Drive, end_time_s: float, gas: CrankGas | None = None) -> Scene:
    """Return set R without clearance, begun at a speed, with another drive and a load by gas."""
    start = ideal_driven().short.start.model_copy(update={"crank_speed_rad_s": speed})
    new = {"start": start, "load": {"slider": CrankLoad(gas=gas)} if gas else {}, "end_time_s": end_time_s}
    return ideal_driven().model_copy(update={**new, "drive": drive})


def test_error_control_takes_a_slow_crank_under_gas_in_few_steps() -> None:
    gas = ideal_compressor().short.load["slider"].gas
    of = scene(0.01, ideal_driven().drive, 400 * np.pi, gas)  # two turns of a hand crank
    sharp = ReferenceEngine(method="dop853", step_tolerance=1e-9)
    steps = sharp.simulate(of, RunSettings(of.end_time_s, SAMPLES)).steps
    assert steps < 1000, f"{steps}: 300 measured; a million without the gas among the scales"


def test_a_table_is_its_spline_at_any_place_and_repeats() -> None:
    x = np.array([0.3, 0.5, 1.1, 1.6, 2.4])
    for kind, y, period in (
        ("not-a-knot", [1.0, -2.0, 0.5, 3.0, 2.0], 0.0),
        ("periodic", [1.0, -2.0, 0.5, 3.0, 1.0], 2.1),
    ):
        spline = CubicSpline(x, y, bc_type=kind)
        table = pieces_of(spline, period)
        for at in (0.3, 0.31, 0.5, 1.0999, 1.6, 2.3999, 2.4, -1.0, 4.0, 17.3):
            assert table.at(at) == pytest.approx([float(spline(at, k)) for k in range(3)], rel=1e-9, abs=1e-9)


def test_motions_are_integral_and_derivative_of_their_speeds() -> None:
    rows = (0.0, 0.0, 2.0, 0.5, -1.0, 0.7, 0.7 * (2.0 + 0.7 * (0.5 - 0.7)), 1.0, -1.0, 2.0)
    ramps = Ramp(3.0, -5.0, 0.4), Ramp(0.0, 5.0, 0.4, -0.1)
    nodes, weights = leggauss(12)
    others: tuple[Motion, ...] = (Fluctuation(3.0, 2.0, 7.0, 0.4), Course(PiecewiseCubic(rows)))
    for motion in (ConstantSpeed(3.0), *ramps, *others):
        for begin, end in ((0.0, 0.2), (0.25, 0.29), (0.5, 0.65)):
            half = (end - begin) / 2
            within = np.array([moved(motion, begin + half * (1 + node)) for node in nodes])
            gained = np.subtract(moved(motion, end), moved(motion, begin))[:2]
            assert gained == pytest.approx(half * (weights @ within[:, 1:]), rel=1e-12, abs=1e-13)
        assert moved(motion, 0.0)[0] == 0


@pytest.mark.parametrize(
    ("engine", "step_s"),
    [
        (make_engine("reference"), 1e-5),
        (make_engine("reference", method="dop853"), 1.0),
        (make_engine("scipy"), 1e-5),
    ],
    ids=["rk4", "dop853", "scipy"],
)
def test_a_ramp_within_a_step_is_cut_into_steps_enough(engine: Engine, step_s: float) -> None:
    of = scene(100.0, Drive(kind="ramp", final_speed_rad_s=-50.0, ramp_time_s=1e-6), 0.004)
    found, true = engine.simulate(of, RunSettings(step_s, SAMPLES)), exact(of, SAMPLES)
    assert np.abs(found.position[:, -1, 0] - true.position[:, -1, 0]).max() < 1e-9
    # RK4's quadrature of a polynomial of degree 9 in sixteen steps: 4e-6 measured.
    assert errors(found, true)["work driver"] < 2e-5

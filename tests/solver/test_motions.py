"""Speeds that change, motors and loads of crank-sliders, held against minimal coordinates and themselves."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.interpolate import CubicSpline

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.solution import mechanism_of
from engine_models.scene.format import CrankGas, Drive, FluctuatingDrive, FreeDrive, RampDrive, TableDrive
from engine_models.scene.library import ideal_compressor, ideal_driven
from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankLoad
from reference_solver.kernel import Topology, program_of
from reference_solver.mechanism.data import ConstantSpeed, Course, Fluctuation, Motion, Ramp
from reference_solver.mechanism.motions import PiecewiseCubic, moved, piece, pieces_of
from tests.engines.runs import errors
from tests.helpers.orders import slope
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES, END_S = 40, 0.016
SPEED = ideal_driven().short.start.crank_speed_rad_s
GAS = ideal_compressor().short.load.slider.gas  # type: ignore[union-attr]
#: Straight lines with kinks as large as the forces of a free crank.
LINES = CrankGas(
    crank_angle_rad=(0.4, 1.5, 3.0, 4.2, 0.4 + 2 * np.pi),
    force_N=(0.0, -800.0, 200.0, -300.0, 0.0),
    interpolation="linear",
)
#: A force that comes at once, and goes: within a microradian, which a crank passes in 10 ns.
JUMPS = CrankGas(
    crank_angle_rad=(-1.0, 0.3, 0.3 + 1e-6, 1.1, 1.1 + 1e-6, 2 * np.pi - 1.0),
    force_N=(0.0, 0.0, -60.0, -60.0, 0.0, 0.0),
    interpolation="linear",
)


def scene(speed: float, load: CrankLoad | None = None, **changes: object) -> Scene:
    """Return set R without clearance, begun at a speed, with another drive and a load."""
    start = ideal_driven().short.start.model_copy(update={"crank_speed_rad_s": speed})
    new = {"start": start, "load": {"slider": load}, "end_time_s": END_S, **changes}
    return ideal_driven().model_copy(update=new)


BACKWARDS = scene(-100.0, drive=FreeDrive(kind="free"))
CASES = {
    name: BACKWARDS.model_copy(update={"load": {"slider": CrankLoad(gas=gas)}})
    for name, gas in {"gas": GAS, "straight lines": LINES}.items()
}
CASES["lines that jump"] = scene(100.0, CrankLoad(gas=JUMPS), drive=FreeDrive(kind="free"))
#: Steps of the ladders in s: the finest are still above round-off, the longest in the order's range. They
#: end on the knots of a gas table, too: the coarser ones are shorter than they may be more often. Of straight
#: lines alone the order is 2 with steps that pass their kinks, with stages that do it scatters by 0.5.
LADDERS = {name: (4e-4 / np.array([4, 6, 8, 12, 16]), 3.95, 4.05) for name in CASES}
LADDERS["gas"] = (4e-4 / np.array([3, 4, 6, 8]), 3.7, 4.1)


def run(of: Scene, step: float, **settings: object) -> Trajectory:
    engine = replace(ReferenceEngine(), **settings)  # type: ignore[arg-type]
    return engine.simulate(of, RunSettings(step, SAMPLES))


@pytest.mark.parametrize("name", CASES)
def test_every_number_of_a_crank_that_turns_back_converges_at_order_four(name: str) -> None:
    """Steps end on the kinks of straight lines."""
    true, (steps, low, high) = exact(CASES[name], SAMPLES), LADDERS[name]
    assert np.ptp(true.position[:, 0, 2]) > 1.2, "kinks are passed"
    ladder = [errors(run(CASES[name], step), true) for step in steps]
    for number in ladder[0].keys() - {"moment guide"}:  # it is zero
        found = [rung[number] for rung in ladder]
        order = slope(steps.tolist(), found)
        assert low < order < high, f"{number}: order {order:.3f} of {found}"


def test_straight_lines_are_numbers_of_a_table_and_leave_the_kernel_s_text_alone() -> None:
    gas, lines, none = (
        program_of(Topology(mechanism_of(of)).marked()).text
        for of in (CASES["gas"], CASES["straight lines"], BACKWARDS)
    )
    assert lines == gas
    assert ("call double @piece(" in gas, "call double @piece(" in none) == (True, False)


@pytest.mark.parametrize("settings", [{}, {"method": "dop853"}], ids=["rk4", "dop853"])
def test_a_table_of_a_straight_line_is_a_constant_speed(settings: dict[str, str]) -> None:
    knots = np.linspace(0.0, 0.0176, 12)
    table = TableDrive(kind="table", time_s=(*knots,), angle_rad=(*(1.0 + SPEED * knots),))
    straight, constant = scene(SPEED, drive=table, end_time_s=0.002), scene(SPEED, end_time_s=0.002)
    one, other = (run(each, 5e-5, **settings) for each in (straight, constant))
    assert one.steps == other.steps, "a straight line has no knots to land on"
    assert max(errors(one, other).values()) < 1e-12


def test_error_control_takes_a_slow_crank_under_gas_in_few_steps() -> None:
    of = scene(0.01, CrankLoad(gas=GAS), end_time_s=400 * np.pi)  # two turns of a hand crank
    steps = [
        run(of, of.end_time_s, method="dop853", step_tolerance=tolerance).steps for tolerance in (1e-7, 1e-9)
    ]
    assert max(steps) < 1000, f"{steps}: 300 measured; a million without the gas among the scales"


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
        # Of two tables in one array, each is found from the end.
        behind = np.concatenate([table.rows, np.arange(15.0)])
        found = piece(behind, table.placed(15).place, table.placed(15).pieces, period, 1.3)
        assert found == piece(np.array(table.rows), -len(table.rows), 4.0, period, 1.3)


def test_motions_are_integral_and_derivative_of_their_speeds() -> None:
    rows = (0.0, 0.0, 2.0, 0.5, -1.0, 0.7, 0.7 * (2.0 + 0.7 * (0.5 - 0.7)), 1.0, -1.0, 2.0)
    motions: list[Motion] = [
        ConstantSpeed(3.0),
        Ramp(3.0, -5.0, 0.4),
        Ramp(0.0, 5.0, 0.4, -0.1),
        Fluctuation(3.0, 2.0, 7.0, 0.4),
        Course(PiecewiseCubic(rows)),
    ]
    nodes, weights = leggauss(12)
    for motion in motions:
        for begin, end in ((0.0, 0.2), (0.25, 0.29), (0.5, 0.65)):
            half = (end - begin) / 2
            within = np.array([moved(motion, begin + half * (1 + node)) for node in nodes])
            gained = np.subtract(moved(motion, end), moved(motion, begin))[:2]
            assert gained == pytest.approx(half * (weights @ within[:, 1:]), rel=1e-12, abs=1e-13)
        assert moved(motion, 0.0)[0] == 0


# Drives whose speed changes within a step

QUICK_RAMP = RampDrive(kind="ramp", final_speed_rad_s=-50.0, ramp_time_s=1e-6)
QUICK_FLUCTUATION = FluctuatingDrive(kind="fluctuating", amplitude_rad_s=5.0, frequency_Hz=1e5)


def driven_by(drive: Drive) -> Scene:
    return scene(100.0, drive=drive, end_time_s=0.004)


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
    of = driven_by(QUICK_RAMP)
    found, true = engine.simulate(of, RunSettings(step_s, SAMPLES)), exact(of, SAMPLES)
    assert np.abs(found.position[:, -1, 0] - true.position[:, -1, 0]).max() < 1e-9
    assert found.driver_work_J is not None
    assert true.driver_work_J is not None
    off = np.abs(found.driver_work_J - true.driver_work_J).max() / np.abs(true.driver_work_J).max()
    # RK4's quadrature of a polynomial of degree 9 in sixteen steps: 4e-6 measured.
    assert off < 2e-5, f"work off by {off:.1e}"


@pytest.mark.parametrize("drive", [QUICK_RAMP, QUICK_FLUCTUATION], ids=["ramp", "fluctuation"])
@pytest.mark.parametrize("engine", ["exudyn", "pymunk"])
def test_an_engine_of_equal_steps_says_which_field_is_too_quick(engine: str, drive: Drive) -> None:
    field = "ramp_time_s" if drive is QUICK_RAMP else "frequency_Hz"
    with pytest.raises(SimulationFailed, match=rf"drive\.{field}: expected at least 4 steps .* shorten"):
        make_engine(engine).simulate(driven_by(drive), RunSettings(1e-5, SAMPLES))
    make_engine(engine).simulate(driven_by(drive), RunSettings(2e-7, SAMPLES))

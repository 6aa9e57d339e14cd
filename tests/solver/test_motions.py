"""Speeds that change, motors and loads of crank-sliders, held against minimal coordinates and themselves."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.interpolate import CubicSpline

from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.assembly import started_from
from engine_models.mechanics.energy import energy_balance_residual_J, kinetic_energy_J
from engine_models.mechanics.equations import mechanism_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.drives import Drive, FluctuatingDrive, FreeDrive, RampDrive, TableDrive
from engine_models.scene.library import ideal_compressor, ideal_driven
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Scene
from reference_solver.compiled.kernel import Topology, source_of
from reference_solver.mechanism.building import pieces_of
from reference_solver.mechanism.motions import MOTIONS, Course, Fluctuation, Ramp, Steady
from reference_solver.mechanism.tables import PiecewiseCubic, piece
from studies.judges.metrics import errors
from tests.helpers.arrays import joint_forces
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES, END_S = 40, 0.016
SPEED = ideal_driven().start.crank_speed_rad_s
KNOTS = np.linspace(0.0, 0.0176, 12)
TURNED = SPEED * KNOTS + 0.3 * np.sin(300 * KNOTS)
LOAD = SliderLoad(force_N=30.0, viscous_N_s_m=5.0, spring_N_m=2000.0, free_position_m=0.1)
GAS = ideal_compressor().load.slider.gas  # type: ignore[union-attr]
#: Straight lines with kinks as large as the forces of a free crank.
LINES = Gas(
    crank_angle_rad=(0.4, 1.5, 3.0, 4.2, 0.4 + 2 * np.pi),
    force_N=(0.0, -800.0, 200.0, -300.0, 0.0),
    interpolation="linear",
)
#: A force that comes at once, and goes: within a microradian, which a crank passes in 10 ns.
JUMPS = Gas(
    crank_angle_rad=(-1.0, 0.3, 0.3 + 1e-6, 1.1, 1.1 + 1e-6, 2 * np.pi - 1.0),
    force_N=(0.0, 0.0, -60.0, -60.0, 0.0, 0.0),
    interpolation="linear",
)


def table(time_s: FloatArray, angle_rad: FloatArray) -> TableDrive:
    return TableDrive(kind="table", time_s=tuple(time_s.tolist()), angle_rad=tuple(angle_rad.tolist()))


def scene(speed: float, load: SliderLoad | None = None, **changes: object) -> Scene:
    """Return set R without clearance, begun at a speed, with another drive and a load."""
    start = ideal_driven().start.model_copy(update={"crank_speed_rad_s": speed})
    new = {"start": start, "load": Loads(slider=load), "end_time_s": END_S, **changes}
    return Scene.model_validate(ideal_driven().model_copy(update=new).model_dump())


TABLE = table(KNOTS, TURNED)
FIRST = float(TABLE.spline()(0.0, 1))
CASES = {
    # The ramp ends between two samples, and so do the table's pieces.
    "ramp": scene(0.0, drive=RampDrive(kind="ramp", final_speed_rad_s=SPEED, ramp_time_s=0.0107)),
    "table": scene(FIRST, drive=TABLE),
    "loads": scene(200.0, LOAD, drive=FreeDrive(kind="free")),
    "gas on a crank that turns back": scene(-100.0, SliderLoad(gas=GAS), drive=FreeDrive(kind="free")),
    "gas by a table": scene(FIRST, SliderLoad(gas=GAS), drive=TABLE),
    "straight lines of a crank that turns back": scene(
        -100.0, SliderLoad(gas=LINES), drive=FreeDrive(kind="free")
    ),
    "straight lines by a table": scene(FIRST, SliderLoad(gas=LINES), drive=TABLE),
    "straight lines that jump": scene(100.0, SliderLoad(gas=JUMPS), drive=FreeDrive(kind="free")),
}
#: Steps of the ladder in s: the finest is still above round-off, the longest in the range of the order.
STEPS = 4e-4 / np.array([3.0, 4.0, 6.0, 8.0])
#: Where the crank's motion is given, RK4 has no error in what follows from it but round-off.
ROUND_OFF = 1e-10
#: Steps end on a gas table's knots, too: the coarser ones are shorter than they may be more often.
ORDER, ORDER_OF_GAS = (3.9, 4.1), (3.7, 4.1)
#: Of straight lines alone: with steps that pass their kinks it is 2, with stages that do it scatters by 0.5.
ORDER_OF_LINES, STEPS_OF_LINES = (3.95, 4.05), 4e-4 / np.array([4, 6, 8, 12, 16])


def run(of: Scene, step: float, **settings: object) -> Trajectory:
    engine = replace(ReferenceEngine(), **settings)  # type: ignore[arg-type]
    return engine.simulate(of, RunSettings(step, SAMPLES))


def misses(of: Scene, found: Trajectory, true: Trajectory) -> dict[str, float]:
    """Return the largest error of every signal, of the works, and of the ledger."""
    out = {name: float(error.max()) for name, error in errors(of, found, true).items()}
    for name, work in found.load_work_J.items():
        out[f"{name} work"] = float(np.abs(work - true.load_work_J[name]).max())
    if true.driver_work_J is not None and found.driver_work_J is not None:
        out["driver work"] = float(np.abs(found.driver_work_J - true.driver_work_J).max())
    return out | {"ledger": float(np.abs(energy_balance_residual_J(of, found)).max())}


def sizes_of(of: Scene, true: Trajectory) -> dict[str, float]:
    """Return how large each of these is, works and ledger by the kinetic energy."""
    nothing = replace(
        true,
        position=0 * true.position,
        velocity=0 * true.velocity,
        joint_force_N={joint: 0 * force for joint, force in true.joint_force_N.items()},
        guide_force_N={"guide": 0 * true.guide_force_N["guide"]},
        driver_torque_N_m=None if true.driver_torque_N_m is None else 0 * true.driver_torque_N_m,
    )
    sizes, energy = misses(of, nothing, true), float(kinetic_energy_J(of, true).max())
    return {name: energy if "work" in name or name == "ledger" else size for name, size in sizes.items()}


#: Without stabilisation even a prescribed position is integrated, and drifts by the method's error.
VARIANTS = [(name, "projection") for name in CASES] + [(name, "none") for name in ("ramp", "table")]


@pytest.mark.parametrize(("name", "stabilisation"), VARIANTS)
def test_every_signal_and_work_converges_at_order_four_to_minimal_coordinates(
    name: str, stabilisation: str
) -> None:
    """Steps end on the kinks of straight lines."""
    of, true = CASES[name], exact(CASES[name], SAMPLES)
    sizes, steps, (low, high) = sizes_of(of, true), STEPS, ORDER
    if "lines" in name and "table" not in name:
        assert np.ptp(true.position[:, 0, 2]) > 1.2, "kinks are passed"
        steps, (low, high) = STEPS_OF_LINES, ORDER_OF_LINES
    elif of.load.slider is not None and of.load.slider.gas is not None:
        low, high = ORDER_OF_GAS
    ladder = [misses(of, run(of, step, stabilisation=stabilisation), true) for step in steps]
    judged = 0
    for signal, size in sizes.items():
        found = np.array([rung[signal] for rung in ladder])
        if found.max() < ROUND_OFF * size:
            continue
        order = float(np.polyfit(np.log(steps), np.log(found), 1)[0])
        assert low < order < high, f"{signal}: order {order:.3f} of {found}"
        judged += 1
    assert judged >= (len(sizes) if stabilisation == "none" else 2), "works and ledger at least"


def test_straight_lines_are_numbers_of_a_table_and_leave_the_kernel_s_text_alone() -> None:
    texts = {}
    for name in ("gas by a table", "straight lines by a table", "loads"):
        texts[name] = source_of(Topology(mechanism_of(CASES[name])).marked())
    assert texts["straight lines by a table"] == texts["gas by a table"]
    assert "piece(" in texts["gas by a table"]
    assert "piece(" not in texts["loads"]


@pytest.mark.parametrize("settings", [{}, {"method": "dop853"}], ids=["rk4", "dop853"])
def test_a_table_of_a_straight_line_is_a_constant_speed(settings: dict[str, str]) -> None:
    straight = scene(SPEED, drive=table(KNOTS, 1.0 + SPEED * KNOTS), end_time_s=0.002)
    constant = scene(SPEED, end_time_s=0.002)
    one, other = (run(each, 5e-5, **settings) for each in (straight, constant))
    assert one.steps == other.steps, "a straight line has no knots to land on"
    sizes = sizes_of(constant, other)
    for signal, apart in misses(constant, one, other).items():
        assert signal == "ledger" or apart < 1e-12 * sizes[signal], f"{signal}: {apart:.1e}"


@pytest.mark.parametrize("name", ["ramp", "table"])
def test_a_run_begun_later_and_again_goes_by_the_drives_clock(name: str) -> None:
    whole, rest, first = run(CASES[name], 2e-5), CASES[name], 0
    for at in (SAMPLES // 4, SAMPLES // 2):
        since, left = (float(whole.time_s[at] - whole.time_s[k]) for k in (first, -1))
        rest, first = started_from(rest, whole.position[at], whole.velocity[at], since, -left), at
    then = ReferenceEngine().simulate(rest, RunSettings(2e-5, SAMPLES - first))
    assert np.abs(then.position - whole.position[first:]).max() < 1e-11
    assert np.abs(joint_forces(then) - joint_forces(whole)[first:]).max() < 1e-7


def test_error_control_takes_a_slow_crank_under_gas_in_few_steps() -> None:
    of = scene(0.01, SliderLoad(gas=GAS), end_time_s=400 * np.pi)  # two turns of a hand crank
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
    motions = [
        Steady(3.0),
        Ramp(3.0, -5.0, 0.4),
        Ramp(0.0, 5.0, 0.4, -0.1),
        Fluctuation(3.0, 2.0, 7.0, 0.4),
        Course(PiecewiseCubic(rows)),
    ]
    nodes, weights = leggauss(12)
    for motion in motions:
        turn = MOTIONS[type(motion)]
        for begin, end in ((0.0, 0.2), (0.25, 0.29), (0.5, 0.65)):
            half = (end - begin) / 2
            within = np.array([turn(motion, begin + half * (1 + node)) for node in nodes])
            gained = np.subtract(turn(motion, end), turn(motion, begin))[:2]
            assert gained == pytest.approx(half * (weights @ within[:, 1:]), rel=1e-12, abs=1e-13)
        assert turn(motion, 0.0)[0] == 0


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

"""Members that run together in one compiled loop against the same scenes run alone."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest

from engine_models.engine import Contact, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.members import Members, run_members, supports
from engine_models.reference.watch import Watch
from engine_models.scene.data import SceneError
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.studies.truth.closed_forms.crank_slider import slider_position_m

DOP853, RK4 = ReferenceEngine(method="dop853", step_tolerance=1e-8), ReferenceEngine()
CLEARANCE, SPEED, ANGLE = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s", "start.crank_angle_rad"
#: Three members that differ in everything at once.
CHANGES = {
    CLEARANCE: np.array([5e-4, 1e-4, 3e-4]),
    SPEED: np.array([523.6, 300.0, -400.0]),
    ANGLE: np.array([0.0, 2.0, 10.0]),
}
WATCH = Watch(transient=0.25, revolutions=1.0)
#: How well the cubics of a step know the largest force and deviation: 4e-4 and 6e-5 of it, measured on seven
#: scenes; and of a fraction of time, two samples for each of some 20 contacts.
FORCE_PART, DEVIATION_PART, FLIGHT_PART = 2e-3, 3e-4, 2e-3
#: A mean over steps knows more than the worst of them.
RMS_PART = 1e-4


def task(scene: Scene, engine: ReferenceEngine, changes: Mapping[str, FloatArray] = CHANGES) -> Members:
    return Members(engine, scene, {name: values.tolist() for name, values in changes.items()}, WATCH, None)


def alone(of: Members, number: int, samples: int = 1) -> Trajectory:
    scene = of.member(number)
    return of.engine.simulate(scene, RunSettings(of.settings(scene).step_s, samples))


@pytest.mark.parametrize("engine", [DOP853, RK4], ids=["dop853", "rk4"])
@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-free-0.5mm", "clearance-compressor"])
def test_a_member_ends_bit_for_bit_where_its_own_run_does(name: str, engine: ReferenceEngine) -> None:
    changes = CHANGES if name != "clearance-compressor" else {CLEARANCE: CHANGES[CLEARANCE]}
    of = task(SCENES[name](), engine, changes)
    begins, _ = of.begun(range(3))
    ((numbers, done),) = of.run(begins)
    for k in numbers:
        run, n = alone(of, k), 9
        position = run.position[-1].ravel()
        position[2] += done.begins[k].q[2] - run.position[0, 0, 2]  # the single run's own whole turns
        assert done.members.clock["steps"][k] == run.steps
        np.testing.assert_array_equal(done.members.y[k, n : 2 * n], run.velocity[-1].ravel())
        np.testing.assert_array_equal(np.delete(done.members.y[k, :n], 2), np.delete(position, 2))


def test_two_threads_give_the_rows_of_one() -> None:
    scene, angles = SCENES["clearance-driven-0.5mm"](), {ANGLE: np.linspace(-3.0, 3.0, 70)}
    one, two = (run_members(DOP853, scene, angles, Watch(0.0, 0.25), threads) for threads in (1, 2))
    pd.testing.assert_frame_equal(one, two, check_exact=True)


@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-driven-AB"])
def test_what_is_gathered_is_what_a_dense_run_shows(name: str) -> None:
    of = task(SCENES[name](), DOP853)
    row, run, first = pd.Series(of.rows([0])[0]), alone(of, 0, 25_000), 5_000
    contacts: list[Contact] = list(run.contacts.values())
    lost, theta = run.dissipated_energy_J, run.position[:, 0, 2]
    assert lost is not None
    deviation = run.position[:, -1, 0] - slider_position_m(of.member(0), theta)
    force = max(contact.normal_force_N[first:].max() for contact in contacts)
    flight = np.mean(np.all([contact.penetration_m[first:] < 0 for contact in contacts], axis=0))
    assert row.largest_contact_force_N == pytest.approx(force, rel=FORCE_PART)
    assert row.slider_deviation_m == pytest.approx(np.abs(deviation[first:]).max(), rel=DEVIATION_PART)
    assert row.flight_part == pytest.approx(flight, abs=FLIGHT_PART)
    mean_square = np.trapezoid(deviation[first:] ** 2, run.time_s[first:]) / (0.8 * run.time_s[-1])
    assert row.rms_slider_deviation_m == pytest.approx(np.sqrt(mean_square), rel=RMS_PART)
    impulse = sum(contact.normal_impulse_N_s[-1] - contact.normal_impulse_N_s[first] for contact in contacts)
    assert row.impulse_per_revolution_N_s == pytest.approx(impulse, rel=1e-12)
    assert row.dissipated_energy_per_revolution_J == pytest.approx(lost[-1] - lost[first], rel=1e-12)
    assert row.strobe_m == pytest.approx([deviation[-1]], rel=1e-9)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_impacts_are_those_of_the_run_alone(number: int) -> None:
    of = task(SCENES["clearance-driven-0.5mm"](), DOP853)
    row, run = pd.Series(of.rows([number])[0]), alone(of, number)
    (contact,) = run.contacts.values()
    scene, impacts = of.member(number), contact.impacts
    late = impacts.time_s >= 0.2 * scene.end_time_s
    lasting = int(contact.penetration_m[-1] > 0)
    phase = (scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * impacts.time_s[late]) % (2 * np.pi)
    touches = late.sum() + lasting
    assert row.impacts_per_revolution == touches
    assert row.impact_phase_rad[: late.sum()] == pytest.approx(phase, abs=1e-9)
    assert row.impulse_N_s == pytest.approx(impacts.normal_impulse_N_s[late].mean(), rel=1e-12)
    # Of the touch that lasts at the end only the row tells the speed.
    speed = row.impact_speed_m_s * touches - impacts.approach_speed_m_s[late].sum()
    assert 0 < speed < 2 * impacts.approach_speed_m_s.max() if lasting else abs(speed) < 1e-12 * touches


def test_a_member_that_fails_is_a_row_with_the_words_of_its_own_run_and_the_others_go_on() -> None:
    scene = SCENES["clearance-driven-0.5mm"]()
    values = {"clearance.B.young_modulus_Pa": np.array([2e11, 1e308, 1e11])}
    frame = run_members(DOP853, scene, values, WATCH)
    with pytest.raises(SimulationFailed) as failure:
        alone(task(scene, DOP853, values), 1)
    assert frame.status.tolist() == ["ok", "failed", "ok"]
    assert frame.reason[1] == str(failure.value)


def test_a_run_that_collapses_on_the_way_fails_in_the_words_of_its_own_run() -> None:
    scene, values = (
        SCENES["clearance-driven-0.5mm"](),
        {"clearance.B.young_modulus_Pa": np.array([2e11, 1e60])},
    )
    frame = run_members(DOP853, scene, values, WATCH)
    with pytest.raises(SimulationFailed) as failure:
        alone(task(scene, DOP853, values), 1)
    assert (frame.status[1], frame.reason[1]) == ("failed", str(failure.value))


def test_a_member_with_values_that_no_scene_may_have_is_refused_in_the_scene_s_words() -> None:
    scene, values = SCENES["clearance-driven-0.5mm"](), {CLEARANCE: np.array([5e-4, 2e-2])}
    frame = run_members(DOP853, scene, values, WATCH)
    with pytest.raises(SceneError) as refused:
        scene.replace(CLEARANCE, 2e-2)
    assert frame.status.tolist() == ["ok", "failed"]
    assert frame.reason[1] == str(refused.value)


def test_a_member_without_a_speed_is_refused() -> None:
    scene = SCENES["clearance-driven-0.5mm"]()
    frame = run_members(DOP853, scene, {SPEED: np.array([0.0])}, WATCH)
    assert frame.reason[0].startswith("start.crank_speed_rad_s: expected a number other than 0")


def test_members_of_several_topologies_run_beside_each_other() -> None:
    of = task(
        SCENES["clearance-driven-damped"](),
        DOP853,
        {"clearance.B.friction.coefficient": np.array([0.0, 0.1])},
    )
    begins, _ = of.begun(range(2))
    for numbers, done in of.run(begins):
        (number,) = numbers
        np.testing.assert_array_equal(done.members.y[0, 9:18], alone(of, number).velocity[-1].ravel())


@pytest.mark.parametrize(
    ("name", "engine", "field"),
    [
        ("rigid-driven-0.5mm", DOP853, CLEARANCE),
        ("ideal-driven", DOP853, SPEED),
        ("clearance-pendulum", DOP853, SPEED),
        ("clearance-driven-0.5mm", ReferenceEngine(kernel="readable"), CLEARANCE),
        ("clearance-driven-0.5mm", ReferenceEngine(locate_events=False), CLEARANCE),
        ("clearance-driven-0.5mm", DOP853, "clearance.A.radial_clearance_m"),
        ("clearance-driven-0.5mm", DOP853, "clearance.B.law"),
    ],
)
def test_what_the_loop_cannot_run_is_not_supported(name: str, engine: ReferenceEngine, field: str) -> None:
    assert supports(ReferenceEngine(), SCENES["clearance-driven-0.5mm"](), [CLEARANCE])
    assert not supports(engine, SCENES[name](), [field])


#: By how many e-folds a turn set R's motion parts from its neighbours at 0.5 mm, by restarted pairs of single
#: runs (``studies.judges.lyapunov``), 5.0 +- 0.2; and how uncertain eight members of eight turns leave it.
EXPONENT_A_TURN, UNCERTAIN = 5.0, 1.2
#: A motion in continuous contact parts from none: over eight turns by -0.4 to 0.07 a turn.
SETTLED = 0.3


def exponents_a_turn(name: str) -> FloatArray:
    scene, angles = SCENES[name](), {ANGLE: np.linspace(-3.0, 3.0, 8)}
    frame = run_members(DOP853, scene, angles, Watch(2.0, 8.0, exponent=True))
    turn_s = 2 * np.pi / scene.start.crank_speed_rad_s
    return np.asarray(frame.exponent_1_s * turn_s)


def test_companions_part_from_members_as_restarted_pairs_of_runs_do() -> None:
    assert exponents_a_turn("clearance-driven-0.5mm").mean() == pytest.approx(EXPONENT_A_TURN, abs=UNCERTAIN)


def test_companions_stay_beside_members_in_continuous_contact() -> None:
    assert exponents_a_turn("clearance-driven-0.02mm").max() < SETTLED


def test_a_companion_changes_nothing_of_its_member() -> None:
    scene = SCENES["clearance-driven-0.5mm"]()
    with_one, without = (run_members(DOP853, scene, CHANGES, Watch(0.25, 1.0, of)) for of in (True, False))
    assert np.isfinite(with_one.exponent_1_s).all()
    pd.testing.assert_frame_equal(with_one.drop(columns="exponent_1_s"), without.drop(columns="exponent_1_s"))

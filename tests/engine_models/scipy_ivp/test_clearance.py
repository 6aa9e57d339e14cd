"""SciPy's methods on joints with clearance: events, the ledger, what a plain switching force costs."""

from functools import cache

import numpy as np
import pytest

from engine_models.engine import Impacts, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.mechanics.joints import SLIDER
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import CLEARANCE_SCENES, SCENES, clearance_pendulum
from engine_models.scene.scene import BodyState, Clearance, Clearances, Friction, Scene
from engine_models.scipy_ivp.calls import Calls, Choice
from engine_models.scipy_ivp.derivative import Derivative
from engine_models.scipy_ivp.engine import ScipyEngine
from engine_models.scipy_ivp.run import LocatedRun
from studies.judges.metrics import energy_balance_residual_J, errors, kinetic_energy_J

SAMPLES = 30
#: Scenes and how far they are followed: predictable that far, and 3 to 20 contacts long.
HORIZON_S = {
    "clearance-driven-0.5mm": 0.003,
    "clearance-driven-damped": 0.003,
    "clearance-free-0.5mm": 0.016,
    "clearance-free-OAB": 0.016,
    "clearance-pendulum": 0.07,
}
EVENT_METHODS = ("DOP853", "RK45", "LSODA")
#: What the methods' errors at rtol = 1e-12 may be: 1e-12 m at most and 6e-12 s are measured.
POSITION_M, IMPACT_S = 1e-9, 1e-10


def scene_of(name: str) -> Scene:
    return CLEARANCE_SCENES[name]().model_copy(update={"end_time_s": HORIZON_S[name]})


def engine(method: str = "DOP853", rtol: float = 1e-12, located: bool = True) -> ScipyEngine:
    settings = {"method": method, "rtol": rtol, "atol": rtol / 100, "locate_events": located}
    return ScipyEngine(**settings)  # type: ignore[arg-type]


@cache
def run(name: str, method: str = "DOP853", rtol: float = 1e-12, located: bool = True) -> Trajectory:
    return engine(method, rtol, located).simulate(scene_of(name), RunSettings(1e-4, SAMPLES))


@cache
def reference(name: str) -> Trajectory:
    """Return a run of the reference that is converged to 1e-12 m."""
    return ReferenceEngine(steps_per_contact=800).simulate(scene_of(name), RunSettings(5e-6, SAMPLES))


def columns(impacts: Impacts) -> np.ndarray:
    return np.column_stack(list(vars(impacts).values()))


@pytest.mark.parametrize("method", EVENT_METHODS)
@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-free-0.5mm"])
def test_the_first_contacts_are_those_of_the_reference(name: str, method: str) -> None:
    trajectory, truth = run(name, method), reference(name)
    off = errors(scene_of(name), trajectory, truth)
    assert off["slider_position_error_m"].max() < POSITION_M, f"{off['slider_position_error_m'].max():.1e} m"
    for signal in ("contact_B_normal_force_error_N", "joint_A_force_error_N", "guide_normal_force_error_N"):
        assert off[signal].max() < 0.01, f"{signal}: {off[signal].max():.1e} of some 1e3 N"
    assert off["contact_B_normal_impulse_error_N_s"].max() < 1e-7
    ours, theirs = columns(trajectory.contacts["B"].impacts), columns(truth.contacts["B"].impacts)
    assert len(ours) == len(theirs) > 1
    assert np.abs(ours - theirs)[:, :2].max() < IMPACT_S, "times and durations"
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


@pytest.mark.parametrize("name", HORIZON_S)
def test_the_energy_ledger_closes(name: str) -> None:
    scene, trajectory = scene_of(name), run(name)
    play = kinetic_energy_J(scene, trajectory).max()
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max() / play
    assert residual < 1e-10, f"residual {residual:.1e} of {play:.3g} J"  # 4e-12 is measured
    lost = trajectory.dissipated_energy_J
    assert lost is not None
    assert lost[-1] > 1e-4 * play, "the contacts did dissipate, which the ledger has to know"


@pytest.mark.parametrize("name", HORIZON_S)
def test_every_signal_of_the_contacts_agrees_with_the_reference(name: str) -> None:
    trajectory, truth = run(name), reference(name)
    for joint, contact in trajectory.contacts.items():
        true = vars(truth.contacts[joint])
        for signal, value in vars(contact).items():
            if isinstance(value, np.ndarray):
                size = np.abs(true[signal]).max()
                off = np.abs(value - true[signal]).max()
                # A force rises within 1e-5 s or less: 1e-11 s of difference in time are 1e-6 of it.
                assert off <= 1e-5 * size, f"{joint}, {signal}: {off:.1e} of {size:.1e}"
            else:
                assert type(value) is type(true[signal]), f"{joint}, {signal}: there or not"


def test_the_error_falls_with_the_tolerance() -> None:
    # Not down to 1e-10: there the reference's own 1e-11 m shows, and round-off decides which steps are taken.
    name, rtols = "clearance-free-0.5mm", (1e-6, 1e-7, 1e-8, 1e-9)
    errors_m = [
        np.abs(run(name, "DOP853", r).position[:, -1, 0] - reference(name).position[:, -1, 0]) for r in rtols
    ]
    power = np.polyfit(np.log(rtols), np.log([error.max() for error in errors_m]), 1)[0]
    assert 0.75 < power < 1.5, f"{[error.max() for error in errors_m]} fall as rtol^{power:.2f}"


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])
def test_a_force_that_only_switches_is_less_accurate_at_the_same_tolerance(method: str) -> None:
    name, truth = "clearance-driven-0.5mm", reference("clearance-driven-0.5mm")
    located, plain = (
        np.abs(run(name, method, 1e-10, way).position[:, -1, 0] - truth.position[:, -1, 0]).max()
        for way in (True, False)
    )
    assert plain > 30 * located, f"{plain:.1e} against {located:.1e} m"
    # Not for want of energy: the ledger of the force that did act closes.
    residual = np.abs(energy_balance_residual_J(scene_of(name), run(name, method, 1e-10, False))).max()
    assert residual < 1e-5, f"{residual:.1e} J"


def test_a_force_that_only_switches_reports_its_impacts() -> None:
    name = "clearance-free-0.5mm"
    ours, theirs = (columns(r.contacts["B"].impacts) for r in (run(name, located=False), reference(name)))
    np.testing.assert_allclose(ours, theirs, rtol=1e-2)


def thrown(height_m: float) -> Scene:
    """Return a pendulum that hangs straight and is thrown up, to a height of its pin above its bearing."""
    scene = clearance_pendulum()
    s, g = scene.crank.centre_of_mass_m, scene.weight_m_s2
    state = BodyState(
        x_m=0.0,
        y_m=-s,
        angle_rad=-np.pi / 2,
        velocity_x_m_s=0.0,
        velocity_y_m_s=float(np.sqrt(2 * g * height_m)),
        angular_velocity_rad_s=0.0,
    )
    start = scene.start.model_copy(update={"crank": state})
    return scene.model_copy(update={"start": start, "end_time_s": 0.015})


@pytest.mark.parametrize("method", EVENT_METHODS)
def test_a_touch_within_a_long_step_is_not_missed(method: str) -> None:
    # Flight is a parabola, which a step of any length follows: the pin is beyond the wall for 0.3 ms of 15.
    c = 5e-4
    over = thrown(c + 1e-7)
    impacts = engine(method).simulate(over, RunSettings(1.0, 1)).contacts["O"].impacts
    speed = np.sqrt(2 * over.weight_m_s2 * 1e-7)
    np.testing.assert_allclose(impacts.approach_speed_m_s, [speed], rtol=1e-6)
    rise = (np.sqrt(2 * over.weight_m_s2 * (c + 1e-7)) - speed) / over.weight_m_s2
    np.testing.assert_allclose(impacts.time_s, [rise], rtol=1e-8)
    below = engine(method).simulate(thrown(c - 1e-7), RunSettings(1.0, 1)).contacts["O"]
    assert len(below.impacts.time_s) == 0
    assert below.normal_impulse_N_s[-1] == 0


def custom(**changes: object) -> Scene:
    base: dict[str, object] = {
        "radial_clearance_m": 5e-4,
        "bearing_radius_m": 0.01,
        "law": "lankarani-nikravesh",
        "stiffness": 1e9,
        "restitution": 0.5,
    }
    room = Clearance.model_validate(base | changes)
    driven = SCENES["ideal-driven"]()
    return driven.model_copy(update={"end_time_s": 0.002, "clearance": Clearances(B=room)})


@pytest.mark.parametrize(
    "changes",
    [
        {"law": "kelvin-voigt", "restitution": None, "damping_N_s_m": 100.0, "stiffness": 1e7},
        {"may_pull": True},
        {"friction": Friction(law="saturated-linear", coefficient=0.1, regularisation_speed_m_s=0.1)},
    ],
    ids=lambda changes: next(iter(changes)) + "-" + str(next(iter(changes.values())))[:12],
)
def test_every_kind_of_law_closes_its_ledger(changes: dict[str, object]) -> None:
    scene = custom(**changes)
    trajectory = engine().simulate(scene, RunSettings(1e-4, SAMPLES))
    play = kinetic_energy_J(scene, trajectory).max()
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max() / play
    assert residual < 1e-9, f"residual {residual:.1e} of {play:.3g} J"
    assert trajectory.contacts["B"].normal_force_N.max() > 100
    assert trajectory.contacts["B"].penetration_m.max() > 0, "the pin did reach the wall"


def test_a_contact_that_would_pull_loses_its_spring_s_energy_however_long_the_steps() -> None:
    scene, depth = custom(minimum_impact_speed_m_s=0.1), 2e-5
    position, velocity = start_state(scene)
    position[SLIDER, 0] += 5e-4 + depth
    velocity[SLIDER, 0] -= 1.0  # ten times as fast as the law lets it out
    scene = started_from(scene, position, velocity, end_time_s=5e-5)
    loose = ScipyEngine(rtol=1e-3, atol=1e-3)
    contact = loose.simulate(scene, RunSettings(1.0, SAMPLES)).contacts["B"]
    assert contact.penetration_m[-1] < 0 < contact.penetration_m[5], "it has left, and took some samples to"
    stored = 1e9 * np.maximum(contact.penetration_m, 0.0) ** 2.5 / 2.5
    assert contact.clipped_loss_J == pytest.approx(1e9 * depth**2.5 / 2.5 - stored, rel=1e-6)


@pytest.mark.parametrize("method", EVENT_METHODS)
def test_a_wall_too_stiff_for_any_step_is_a_failure(method: str, capfd: pytest.CaptureFixture[str]) -> None:
    limited = ScipyEngine(method=method, max_evaluations=20_000)  # type: ignore[arg-type]
    with pytest.raises(SimulationFailed, match=r"t = 0\.000227"):
        limited.simulate(custom(stiffness=1e300), RunSettings(1e-4, SAMPLES))
    assert capfd.readouterr() == ("", "")


def test_a_run_can_be_repeated_to_the_last_bit() -> None:
    name = "clearance-driven-0.5mm"
    again = engine().simulate(scene_of(name), RunSettings(1e-4, SAMPLES))
    np.testing.assert_array_equal(again.position, run(name).position)
    np.testing.assert_array_equal(
        columns(again.contacts["B"].impacts), columns(run(name).contacts["B"].impacts)
    )


@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-free-0.5mm"])
@pytest.mark.parametrize("method", EVENT_METHODS)
def test_a_bare_run_takes_the_steps_of_the_watched_one(name: str, method: str) -> None:
    scene, choice = scene_of(name), Choice(method, 1e-8, 1e-10, 1.0, 1_000_000)
    ends = []
    for bare in (False, True):
        derivative, times = Derivative(scene), np.array([0.0, scene.end_time_s])
        calls = Calls(scene, derivative, choice, bare=bare)
        with np.errstate(all="ignore"):  # a step through the wall that is tried in vain
            ends.append(LocatedRun(derivative, calls, times).run())
    watched, bare_run = ends
    assert len(watched.ends) > 1
    # Impulses and losses of all contacts are in y. The watched run's sample at the end is on the method's
    # interpolant: round-off of it.
    np.testing.assert_allclose(bare_run.y[-1], watched.y[-1], rtol=1e-12, atol=1e-14)


def test_a_bare_run_that_would_not_end_fails_as_the_watched_one() -> None:
    limited = ScipyEngine(max_evaluations=20_000)
    with pytest.raises(SimulationFailed, match=r"t = 0\.000227"):
        limited.bare_run(custom(stiffness=1e300), RunSettings(1e-4, SAMPLES))

"""The independent solver: Exudyn's own model, closed forms in flight, the reference in contact."""

import math
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from engine_models.arms import DOPRI5
from engine_models.engine import RunSettings, Trajectory, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.mechanics.assembly import started_from
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.drives import Drive, FluctuatingDrive, FreeDrive, RampDrive, TableDrive
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES, SCENES, clearance, ideal_driven
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Clearance, Clearances, Friction, Scene
from studies.independent import equations, motion, stepping
from studies.independent.solver import IndependentSolver
from studies.judges.impact_matching import impact_errors
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, errors, signals
from studies.running.closure import closure

#: A force that changes over a turn as 1000 cos(theta), by its spline within 1e-5 of it.
TURN = np.linspace(0.0, 2 * np.pi, 61)
COSINE = Gas(crank_angle_rad=tuple(TURN.tolist()), force_N=(*(1000 * np.cos(TURN[:-1])).tolist(), 1000.0))
#: The flights below, and their samples.
FLIGHT_S, SAMPLES = 2e-4, 40
#: Places agree to this in m: 8e-12 m are measured at most, where two joints in turns magnify it.
PLACE_M, PLACES = 5e-11, ("slider_position", "clearance")
#: Contacts are stiff: they make 1e-7 of the force of 1e-12 m, and less of a torque, a work and a speed.
PART = 1e-6
#: An energy balance as a part of the largest energy: works and losses are integrated beside the motion.
BALANCE = 1e-12

COLLOCATION = IndependentSolver("collocation", 1e-11)
METHODS = (COLLOCATION, IndependentSolver("extrapolation", 1e-14))


def solved(scene: Scene, solver: IndependentSolver = COLLOCATION, samples: int = SAMPLES) -> Trajectory:
    return solver.simulate(scene, RunSettings(scene.end_time_s, samples))


def until(scene: Scene, end_s: float) -> Scene:
    return scene.model_copy(update={"end_time_s": end_s})


def driven(end_s: float = FLIGHT_S, **changes: object) -> Scene:
    return ideal_driven().model_copy(update={"end_time_s": end_s, **changes})


def assert_alike(scene: Scene, run: Trajectory, other: Trajectory) -> None:
    """Assert that two runs agree in every signal, in works and losses, and in their impacts."""
    sizes = {name: float(np.abs(value).max()) for name, value in signals(scene, other)}
    for (name, size), error in zip(sizes.items(), errors(scene, run, other).values(), strict=True):
        allowed = PLACE_M if name.startswith(PLACES) else PART * size
        assert error.max() <= allowed, f"{name} off by {error.max():.1e} of {size:.1e}"
    largest_N = max(size for name, size in sizes.items() if name.endswith("force_N"))
    for guide, moment in other.guide_moment_N_m.items():
        lever_m = scene.crank.length_m
        assert np.abs(run.guide_moment_N_m[guide] - moment).max() <= PART * largest_N * lever_m
    works = [(run.driver_work_J, other.driver_work_J)]
    works += [(run.load_work_J[part], work) for part, work in other.load_work_J.items()]
    for joint, contact in other.contacts.items():
        own = run.contacts[joint]
        lines = ("normal_loss_J", "friction_loss_J", "clipped_loss_J", "elastic_energy_J")
        works += [(getattr(own, line), getattr(contact, line)) for line in lines]
        missed = impact_errors(own.impacts, contact.impacts, scene.end_time_s)
        assert missed.get("impact_speed_relative_error", 0.0) < PART
        if getattr(scene.clearance, joint).law != "rigid":  # there the last bounces end differently
            assert missed.get("impact_impulse_relative_error", 0.0) < PART
    energy = max(float(np.abs(work).max()) for _, work in works if work is not None)
    for mine, theirs in works:
        assert (mine is None) == (theirs is None)
        if mine is not None and theirs is not None:
            assert np.abs(mine - theirs).max() <= PART * energy


@pytest.mark.parametrize(
    ("name", "end_s"), [("clearance-driven-0.5mm", 0.003), ("clearance-free-0.5mm", 0.03)]
)
def test_exudyn_s_own_model_moves_alike(name: str, end_s: float) -> None:
    """Its equations, contacts and integration share no line with these; 7e-15 and 1.3e-13 m are measured."""
    scene = until(SCENES[name](), end_s)
    exudyn = make_engine("exudyn", **DOPRI5.settings, step_tolerance=1e-12)
    own = exudyn.twin(scene)
    run, mine = exudyn.simulate(scene, RunSettings(1e-5, SAMPLES)), solved(own)
    assert len(mine.contacts["B"].impacts.time_s) >= 8
    for name, error in errors(own, run, mine).items():
        if name.endswith("_error_m"):
            assert error.max() < 1e-12, f"{name} off by {error.max():.1e}"


@pytest.mark.parametrize("solver", METHODS)
@pytest.mark.parametrize("name", [*CLEARANCE_SCENES, *RIGID_SCENES])
def test_every_scene_of_the_library_closes_its_ledger_and_its_joints(
    name: str, solver: IndependentSolver
) -> None:
    scene = SCENES[name]()
    scene = until(
        scene, min(scene.end_time_s, 0.07 if "pendulum" in name else 0.003 if "driven" in name else 0.012)
    )
    run = solved(scene, solver)
    energy = float(np.max([1e-3, *np.abs(run.work_J), np.abs(run.velocity[:, :, :2] ** 2).max()]))
    assert np.abs(energy_balance_residual_J(scene, run)).max() < BALANCE * energy
    assert constraint_violation_m(scene, run).max() < 1e-15


def flown(load: SliderLoad) -> tuple[Scene, Trajectory]:
    """Return the scene and what its slider does while the pin at B, with much clearance, flies."""
    scene = driven(clearance=Clearances(B=clearance(3e-3)), load=Loads(slider=load))
    run = solved(scene)
    assert not len(run.contacts["B"].impacts.time_s)
    assert not run.contacts["B"].normal_force_N.any()
    return scene, run


def test_a_slider_in_flight_does_what_its_load_makes_of_it() -> None:
    """By hand, of mass m from rest at x0: a push, a push against friction, a spring, a force by the crank."""
    scene, pushed = flown(SliderLoad(force_N=-500.0))
    m, x_0, speed, t = scene.bodies[2].mass_kg, 0.17, scene.start.crank_speed_rad_s, pushed.time_s
    np.testing.assert_allclose(pushed.position[:, -1, 0], x_0 - 500 / m * t**2 / 2, rtol=0, atol=1e-14)
    _, braked = flown(SliderLoad(force_N=-500.0, viscous_N_s_m=700.0))
    expected = x_0 - 500 / 700 * (t - m / 700 * (1 - np.exp(-700 / m * t)))
    np.testing.assert_allclose(braked.position[:, -1, 0], expected, rtol=0, atol=1e-14)
    _, sprung = flown(SliderLoad(spring_N_m=1e4, free_position_m=0.1))
    expected = 0.1 + 0.07 * np.cos(math.sqrt(1e4 / m) * t)
    np.testing.assert_allclose(sprung.position[:, -1, 0], expected, rtol=0, atol=1e-14)
    kinetic = m * sprung.velocity[:, -1, 0] ** 2 / 2
    np.testing.assert_allclose(sprung.load_work_J["spring"], kinetic, rtol=0, atol=1e-13)
    _, blown = flown(SliderLoad(gas=COSINE))
    expected = x_0 + 1000 / m / speed**2 * (1 - np.cos(speed * t))
    np.testing.assert_allclose(blown.position[:, -1, 0], expected, rtol=0, atol=1e-5 * 1e-3)


def table() -> TableDrive:
    time = np.linspace(0.0, 0.036, 31)
    angle = 524 * time + 0.05 * np.sin(540 * time)
    return TableDrive(kind="table", time_s=tuple(time.tolist()), angle_rad=tuple(angle.tolist()))


DRIVES: dict[str, tuple[Drive, str]] = {
    "ramp": (RampDrive(kind="ramp", final_speed_rad_s=300.0, ramp_time_s=0.007), "B"),
    "fluctuating": (FluctuatingDrive(kind="fluctuating", amplitude_rad_s=30.0, frequency_Hz=170.0), "O"),
    "table": (table(), "A"),
}


@pytest.mark.parametrize("law", ["hu-guo", "rigid"])
@pytest.mark.parametrize("name", DRIVES)
def test_under_drives_and_loads_it_is_the_reference_s_motion(name: str, law: str) -> None:
    drive, joint = DRIVES[name]
    load = SliderLoad(force_N=-30.0, viscous_N_s_m=4.0, spring_N_m=900.0, free_position_m=0.1, gas=COSINE)
    room = clearance(1e-4, "hu-guo", 0.5)
    if law == "rigid":
        room = Clearance(radial_clearance_m=1e-4, bearing_radius_m=0.01, law="rigid", restitution=0.5)
    scene = driven(0.002, drive=drive, load=Loads(slider=load), clearance=Clearances(**{joint: room}))
    scene = scene.model_copy(update={"start": scene.start.model_copy(update={"time_s": 0.006})})
    run = ReferenceEngine(method="dop853", step_tolerance=1e-13).simulate(scene, RunSettings(1.0, SAMPLES))
    own = solved(scene)
    assert own.contacts[joint].normal_impulse_N_s[-1] > 0.1
    assert_alike(scene, run, own)


@pytest.mark.parametrize("law", ["hu-guo", "rigid"])
@pytest.mark.parametrize("speed", [200.0, -200.0])
def test_steps_end_on_the_kinks_of_gas_by_straight_lines(speed: float, law: str) -> None:
    lines = Gas(
        crank_angle_rad=(-0.5, -0.2, 0.15, 0.3, 2 * np.pi - 0.5),
        force_N=(0.0, -800.0, 200.0, -300.0, 0.0),
        interpolation="linear",
    )
    room = clearance(1e-4, "hu-guo", 0.5)
    if law == "rigid":
        room = Clearance(radial_clearance_m=1e-4, bearing_radius_m=0.01, law="rigid", restitution=0.5)
    scene = driven(0.002, load=Loads(slider=SliderLoad(gas=lines)), clearance=Clearances(B=room))
    start = scene.start.model_copy(update={"crank_speed_rad_s": speed})
    scene = scene.model_copy(update={"start": start, "drive": FreeDrive(kind="free")})
    run = ReferenceEngine(method="dop853", step_tolerance=1e-13).simulate(scene, RunSettings(1.0, SAMPLES))
    own, again = solved(scene), solved(scene, METHODS[1])
    assert abs(own.position[-1, 0, 2]) > 0.3, "two kinks are passed"
    assert_alike(scene, run, own)
    # Not located, they cost three digits: 1e-12 m between the methods, for 5e-16 m measured.
    assert np.abs(own.position[:, -1, 0] - again.position[:, -1, 0]).max() < 5e-15


RUBS = {
    "saturated-linear": Friction(law="saturated-linear", coefficient=0.2, regularisation_speed_m_s=0.05),
    "ambrosio": Friction(
        law="ambrosio", coefficient=0.2, regularisation_speed_m_s=0.05, dead_band_speed_m_s=0.01
    ),
}


@pytest.mark.parametrize("friction", RUBS)
@pytest.mark.parametrize("may_pull", [False, True])
def test_where_a_law_pulls_force_and_friction_are_the_reference_s(may_pull: bool, friction: str) -> None:
    """Hu and Guo's at e = 0.1 pulls as the crank turns on; where it may not, that is the clipped loss."""
    room = clearance(1e-4, "hu-guo", 0.1, RUBS[friction]).model_copy(update={"may_pull": may_pull})
    scene = driven(0.008, clearance=Clearances(A=room))
    run = ReferenceEngine(method="dop853", step_tolerance=1e-13).simulate(scene, RunSettings(1.0, 400))
    own = solved(scene, samples=400)
    force, clipped = own.contacts["A"].normal_force_N, own.contacts["A"].clipped_loss_J
    if may_pull:
        assert clipped is None
    else:
        assert force.min() == 0.0
        assert clipped is not None
        assert clipped[-1] > 1e-3
    assert_alike(scene, run, own)


def test_a_scene_begun_on_its_way_goes_on_as_before() -> None:
    scene = until(CLEARANCE_SCENES["clearance-driven-AB"](), 0.001)
    whole = solved(scene)
    at = int(
        np.flatnonzero([all(c.penetration_m[k] < 0 for c in whole.contacts.values()) for k in range(31)])[-1]
    )
    now = float(whole.time_s[at])
    rest = solved(started_from(scene, whole.position[at], whole.velocity[at], now, scene.end_time_s - now))
    off = np.abs(rest.position[-1] - whole.position[-1]).max()
    assert off < 1e-13, f"off by {off:.1e}"  # round-off of the states, magnified by an impact or two


def test_what_it_does_not_serve_is_refused_by_name() -> None:
    with pytest.raises(UnsupportedScene, match="no joint has clearance"):
        solved(ideal_driven())
    scene = RIGID_SCENES["rigid-driven-0.5mm"]()
    run = solved(until(scene, 1e-4))
    position = run.position[0].copy()
    position[2, 0] += 5.1e-4
    with pytest.raises(UnsupportedScene, match="begins in its rigid wall"):
        solved(started_from(scene, position, run.velocity[0]))


def test_another_shortest_flight_changes_no_more_than_the_last_bounces() -> None:
    scene = until(RIGID_SCENES["rigid-driven-damped"](), 0.004)
    long, short = (solved(scene, replace(COLLOCATION, shortest_flight_s=flight)) for flight in (4e-9, 1e-9))
    off = np.abs(long.position[:, -1, 0] - short.position[:, -1, 0]).max()
    assert 0 < off < 1e-13, f"off by {off:.1e} m"
    assert len(long.contacts["B"].impacts.time_s) <= len(short.contacts["B"].impacts.time_s)


@pytest.mark.parametrize("module", [equations, stepping, motion], ids=lambda module: module.__name__)
def test_machine_code_is_kept_by_the_text_of_all_that_is_compiled_with_it(module: ModuleType) -> None:
    own = {name for name in closure(module.__name__).files if name.startswith("studies.independent.")}
    by_text = {module.__name__, *(part.__name__ for part in module.COMPILED_WITH)}
    assert own - by_text <= {"studies.independent.rigid_walls"}, "which is Python"

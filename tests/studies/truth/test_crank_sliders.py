"""The truth of crank-sliders: Newton's bodies, Exudyn's own model, closed forms in flight, the reference."""

import math
from dataclasses import replace

import numpy as np
import pytest

from engine_models.arms import DOPRI5
from engine_models.engine import RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.assembly import started_from
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.drives import Drive, FluctuatingDrive, FreeDrive, RampDrive, TableDrive, TorqueDrive
from engine_models.scene.library import (
    CLEARANCE_SCENES,
    RIGID_SCENES,
    SCENES,
    clearance,
    ideal_driven,
    ideal_free,
)
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Clearance, Clearances, Friction, Scene
from studies.judges.metrics import (
    constraint_violation_m,
    energy_balance_residual_J,
    errors,
    kinetic_energy_J,
    potential_energy_J,
)
from studies.truth.solver import TrueSolver
from tests.helpers.random_scenes import COMPLIANT, random_scene
from tests.studies.truth.alike import assert_alike
from tests.studies.truth.newton_euler import integrate

#: A force that changes over a turn as 1000 cos(theta), by its spline within 1e-5 of it.
TURN = np.linspace(0.0, 2 * np.pi, 61)
COSINE = Gas(crank_angle_rad=tuple(TURN.tolist()), force_N=(*(1000 * np.cos(TURN[:-1])).tolist(), 1000.0))
#: The flights below, and samples.
FLIGHT_S, SAMPLES = 2e-4, 40
#: An energy balance as a part of the largest energy: works and losses are integrated beside the motion.
BALANCE = 1e-12

COLLOCATION, EXTRAPOLATION = TrueSolver("collocation", 1e-13), TrueSolver("extrapolation", 1e-14)
METHODS = (COLLOCATION, EXTRAPOLATION)


def solved(scene: Scene, solver: TrueSolver = COLLOCATION, samples: int = SAMPLES) -> Trajectory:
    return solver.simulate(scene, RunSettings(scene.end_time_s, samples))


def until(scene: Scene, end_s: float) -> Scene:
    return scene.model_copy(update={"end_time_s": end_s})


def driven(end_s: float = FLIGHT_S, **changes: object) -> Scene:
    return ideal_driven().model_copy(update={"end_time_s": end_s, **changes})


def reference(scene: Scene, samples: int = SAMPLES) -> Trajectory:
    return ReferenceEngine(method="dop853", step_tolerance=1e-13).simulate(scene, RunSettings(1.0, samples))


def rigid() -> Clearance:
    return Clearance(radial_clearance_m=1e-4, bearing_radius_m=0.01, law="rigid", restitution=0.5)


LOAD = SliderLoad(force_N=-30.0, viscous_N_s_m=4.0, spring_N_m=900.0, free_position_m=0.1, gas=COSINE)


def table() -> TableDrive:
    time = np.linspace(0.0, 0.036, 31)
    angle = 524 * time + 0.05 * np.sin(540 * time)
    slopes = (551.0, 524 + 27 * math.cos(540 * 0.036))
    return TableDrive(
        kind="table", time_s=tuple(time.tolist()), angle_rad=tuple(angle.tolist()), end_slopes=slopes
    )


DRIVES: dict[str, tuple[Drive, str]] = {
    "ramp": (RampDrive(kind="ramp", final_speed_rad_s=300.0, ramp_time_s=0.007), "B"),
    "fluctuating": (FluctuatingDrive(kind="fluctuating", amplitude_rad_s=30.0, frequency_Hz=170.0), "O"),
    "table": (table(), "A"),
    "torque": (TorqueDrive(kind="torque", torque_N_m=40.0), "B"),
    "free": (FreeDrive(kind="free"), "B"),
}


@pytest.mark.parametrize("name", DRIVES)
def test_ideal_joints_move_and_push_as_newton_s_bodies(name: str) -> None:
    """Accelerations and reactions of one linear system, integrated by DOP853 at 1e-12."""
    scene = driven(0.012, drive=DRIVES[name][0], load=Loads(slider=LOAD))
    scene = scene.model_copy(update={"start": scene.start.model_copy(update={"time_s": 0.002})})
    run = solved(scene)
    bodies = integrate(scene, run.time_s, 1e-12, 5e-5)
    signals = {
        "position": (run.position, bodies.position),
        "velocity": (run.velocity, bodies.velocity),
        "joint forces": (np.stack([run.joint_force_N[pin] for pin in "OAB"], axis=1), bodies.joint_force_N),
        "guide force": (run.guide_force_N["guide"], bodies.guide_normal_force_N),
    }
    if run.driver_torque_N_m is not None and run.driver_work_J is not None:
        signals["torque"] = run.driver_torque_N_m, bodies.driver_torque_N_m
        signals["driver's work"] = run.driver_work_J, bodies.driver_work_J
    signals |= {part: (work, bodies.load_work_J[part]) for part, work in run.load_work_J.items()}
    assert len(run.load_work_J) == 4
    for signal, (mine, theirs) in signals.items():
        off = np.abs(mine - theirs).max() / np.abs(theirs).max()
        # A table's curvature is rounded otherwise in each: 2.6e-10 of the forces on one processor.
        assert off < 1e-9, f"{signal} off by {off:.1e} of its largest"


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


@pytest.mark.parametrize("solver", METHODS, ids=lambda solver: solver.method)
@pytest.mark.parametrize("name", [*CLEARANCE_SCENES, *RIGID_SCENES])
def test_every_scene_of_the_library_closes_its_ledger_and_its_joints(name: str, solver: TrueSolver) -> None:
    scene = SCENES[name]()
    end_s = 0.07 if "pendulum" in name else 0.003 if "driven" in name else 0.012
    scene = until(scene, min(scene.end_time_s, end_s))
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


def test_a_pin_in_flight_leaves_the_slider_its_speed() -> None:
    """From 60 degrees, with a clearance at B that is not crossed: the slider goes on as it began."""
    scene = driven(1e-4, clearance=Clearances(B=clearance(5e-3)))
    scene = scene.model_copy(update={"start": scene.start.model_copy(update={"crank_angle_rad": np.pi / 3})})
    crank, rod, _ = scene.crank_slider()
    r, length, omega = crank.length_m, rod.length_m, scene.start.crank_speed_rad_s
    sin, cos = math.sqrt(3) / 2, 0.5
    cos_phi = math.sqrt(1 - (r / length * sin) ** 2)
    speed = -r * omega * sin - r**2 * sin * cos * omega / (length * cos_phi)
    run = solved(scene)
    expected = r * cos + length * cos_phi + speed * run.time_s
    np.testing.assert_allclose(run.position[:, -1, 0], expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("law", ["hu-guo", "rigid"])
@pytest.mark.parametrize("name", ["ramp", "fluctuating", "table"])
def test_under_drives_and_loads_it_is_the_reference_s_motion(name: str, law: str) -> None:
    drive, joint = DRIVES[name]
    room = rigid() if law == "rigid" else clearance(1e-4, "hu-guo", 0.5)
    scene = driven(0.002, drive=drive, load=Loads(slider=LOAD), clearance=Clearances(**{joint: room}))
    scene = scene.model_copy(update={"start": scene.start.model_copy(update={"time_s": 0.006})})
    own = solved(scene)
    assert own.contacts[joint].normal_impulse_N_s[-1] > 0.1
    assert_alike(scene, reference(scene), own)


@pytest.mark.parametrize("law", ["hu-guo", "rigid"])
@pytest.mark.parametrize("speed", [200.0, -200.0])
def test_steps_end_on_the_kinks_of_gas_by_straight_lines(speed: float, law: str) -> None:
    lines = Gas(
        crank_angle_rad=(-0.5, -0.2, 0.15, 0.3, 2 * np.pi - 0.5),
        force_N=(0.0, -800.0, 200.0, -300.0, 0.0),
        interpolation="linear",
    )
    room = rigid() if law == "rigid" else clearance(1e-4, "hu-guo", 0.5)
    scene = driven(0.002, load=Loads(slider=SliderLoad(gas=lines)), clearance=Clearances(B=room))
    start = scene.start.model_copy(update={"crank_speed_rad_s": speed})
    scene = scene.model_copy(update={"start": start, "drive": FreeDrive(kind="free")})
    own, again = solved(scene), solved(scene, EXTRAPOLATION)
    assert abs(own.position[-1, 0, 2]) > 0.3, "two kinks are passed"
    assert_alike(scene, reference(scene), own)
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
    own = solved(scene, samples=400)
    force, clipped = own.contacts["A"].normal_force_N, own.contacts["A"].clipped_loss_J
    if may_pull:
        assert clipped is None
    else:
        assert force.min() == 0.0
        assert clipped is not None
        assert clipped[-1] > 1e-3
    assert_alike(scene, reference(scene, 400), own)


def test_a_scene_begun_on_its_way_goes_on_as_before() -> None:
    scene = until(CLEARANCE_SCENES["clearance-driven-AB"](), 0.001)
    whole = solved(scene)
    flies = [all(c.penetration_m[k] < 0 for c in whole.contacts.values()) for k in range(31)]
    at = int(np.flatnonzero(flies)[-1])
    now = float(whole.time_s[at])
    rest = solved(started_from(scene, whole.position[at], whole.velocity[at], now, scene.end_time_s - now))
    off = np.abs(rest.position[-1] - whole.position[-1]).max()
    assert off < 1e-13, f"off by {off:.1e}"  # round-off of the states, magnified by an impact or two


def test_another_shortest_flight_changes_no_more_than_the_last_bounces() -> None:
    scene = until(RIGID_SCENES["rigid-driven-damped"](), 0.004)
    long, short = (solved(scene, replace(COLLOCATION, shortest_flight_s=flight)) for flight in (4e-9, 1e-9))
    off = np.abs(long.position[:, -1, 0] - short.position[:, -1, 0]).max()
    assert 0 < off < 1e-13, f"off by {off:.1e} m"
    assert len(long.contacts["B"].impacts.time_s) <= len(short.contacts["B"].impacts.time_s)


def hertz(room_m: float, rub: Friction | None = None) -> Clearance:
    return Clearance(
        radial_clearance_m=room_m, bearing_radius_m=0.01, law="hertz", stiffness=1e10, friction=rub
    )


def test_energy_is_kept_by_springs_and_lost_to_friction() -> None:
    scene = until(ideal_free(), 0.05).model_copy(
        update={"clearance": Clearances(O=hertz(5e-4), B=hertz(1e-4))}
    )
    run = solved(scene, EXTRAPOLATION, 5)
    energy = kinetic_energy_J(scene, run)[0]
    assert sum(len(contact.impacts.time_s) for contact in run.contacts.values()) > 10
    assert run.dissipated_energy_J is not None
    assert not run.dissipated_energy_J.any()
    # Some thousand steps, each in error by 1e-14 of its speeds.
    gain = np.abs(energy_balance_residual_J(scene, run)).max() / energy
    assert gain < 1e-11, f"{gain:.1e} of it lost or made"
    scene = scene.model_copy(update={"clearance": Clearances(A=hertz(5e-4, RUBS["ambrosio"]))})
    run = solved(scene, EXTRAPOLATION, 100)
    energies = kinetic_energy_J(scene, run) + potential_energy_J(scene, run)
    assert energies[1] == pytest.approx(energies[0], rel=1e-14)
    assert max(np.diff(energies)) < 1e-14 * energy
    assert energies[-1] < energies[0] - 0.001 * energy


def test_both_steps_agree_on_every_law() -> None:
    """A kink that one of them steps over, or a touch, is worth 1e-11 m and more."""
    seen: set[str] = set()
    for seed in (1, 6, 8, 10, 12, 16, 25, 28, 29, 32, 33, 40, 51):
        scene = random_scene(seed, rigid=False)
        scene = until(scene, 0.6 * scene.end_time_s)
        implicit, explicit = (solved(scene, solver, 2) for solver in METHODS)
        off = np.abs(implicit.position[:, -1, 0] - explicit.position[:, -1, 0]).max()
        assert off < 1e-12, f"seed {seed}: {off:.1e} m"
        for joint in scene.clearances.values():
            seen |= {joint.law} | ({joint.friction.law} if joint.friction else set())
    assert seen == {*COMPLIANT, "saturated-linear", "ambrosio", "tanh"}

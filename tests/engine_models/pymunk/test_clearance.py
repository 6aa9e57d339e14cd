"""Joints with clearance in Pymunk: what every run must keep to, and what native and compliant contacts do."""

from dataclasses import fields
from typing import Any

import numpy as np
import pydantic
import pytest
from scipy.integrate import solve_ivp

from engine_models.engine import Contact, Impacts, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.loads import slider_forces
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.drives import ConstantSpeedDrive, FreeDrive, TorqueDrive
from engine_models.scene.library import (
    CLEARANCE_SCENES,
    RIGID_SCENES,
    clearance_driven_05,
    clearance_free_three,
    ideal_driven,
    ideal_free,
)
from engine_models.scene.scene import Clearance, Clearances, Friction, Scene
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J
from tests.helpers.arrays import joint_forces

SCENES = {**CLEARANCE_SCENES, **RIGID_SCENES}
#: Short enough for a second in all, long enough for several contacts in each scene.
STEPS, SAMPLES = 2000, 20
ARMS = {"tuned": PymunkEngine(), "library": PymunkEngine.out_of_the_box()}
#: A second difference of positions over dt^2 loses eps |x|/dt^2: 4e-5 m/s^2 of 2e4 at dt = 1e-6 s.
DIFFERENCING = 1e-5


def short(scene: Scene) -> Scene:
    """Return a scene's beginning: 2 ms at full speed, 20 ms else, 10 of a start-up and 40 of a pendulum."""
    kind = "pendulum" if not scene.is_crank_slider else scene.drive.kind
    end_time_s = {"constant-speed": 2e-3, "ramp": 1e-2, "pendulum": 4e-2}.get(kind, 2e-2)
    return scene.model_copy(update={"end_time_s": end_time_s})


def run(
    scene: Scene, engine: PymunkEngine | None = None, steps: int = STEPS, samples: int = SAMPLES
) -> Trajectory:
    settings = RunSettings(scene.end_time_s / steps, samples)
    return (engine or PymunkEngine()).simulate(scene, settings)


def with_friction(scene: Scene, coefficient: float) -> Scene:
    """Return the scene with the same saturated friction in all its joints with clearance."""
    friction = Friction(law="saturated-linear", coefficient=coefficient, regularisation_speed_m_s=0.01)
    joints = {
        name: getattr(scene.clearance, name).model_copy(update={"friction": friction})
        for name in scene.joints_with_clearance
    }
    return scene.model_copy(update={"clearance": Clearances(**joints)})


def with_law(scene: Scene, **law: Any) -> Scene:
    """Return the scene with one clearance at B of set R's size and another law."""
    room = {"radial_clearance_m": 5e-4, "bearing_radius_m": 1e-2, **law}
    return scene.model_copy(update={"clearance": Clearances(B=Clearance(**room))})


def same(one: object, two: object) -> bool:
    """Return whether two trajectories, or parts of them, are equal to the last bit."""
    if isinstance(one, (Trajectory, Contact, Impacts)):
        names = [f.name for f in fields(one) if f.name != "solve_time_s"]
        return all(same(getattr(one, name), getattr(two, name)) for name in names)
    if isinstance(one, dict):
        assert isinstance(two, dict)
        return all(same(one[key], two[key]) for key in one)
    if isinstance(one, np.ndarray):
        assert isinstance(two, np.ndarray)
        return np.array_equal(one, two, equal_nan=True)
    return one == two


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_gives_a_whole_trajectory_from_its_own_start(name: str, arm: str) -> None:
    scene = short(SCENES[name]())
    trajectory, bodies = run(scene, ARMS[arm]), len(scene.bodies)
    n = SAMPLES + 1
    assert trajectory.time_s == pytest.approx(np.linspace(0, scene.end_time_s, n))
    assert trajectory.steps == STEPS
    assert trajectory.position.shape == trajectory.velocity.shape == (n, bodies, 3)
    assert joint_forces(trajectory).shape == (n, bodies, 2)
    assert list(trajectory.guide_force_N) == ["guide"] * scene.is_crank_slider
    assert (trajectory.driver_work_J is None) == (scene.drive.kind == "free")
    assert tuple(trajectory.contacts) == scene.joints_with_clearance
    assert trajectory.position[0, 0, 2] == scene.start.crank_angle_rad
    assert trajectory.velocity[0, 0, 2] == pytest.approx(scene.start.crank_speed_rad_s)
    assert constraint_violation_m(scene, trajectory).max() < 1e-4
    for joint, contact in trajectory.contacts.items():
        room = getattr(scene.clearance, joint)
        for f in fields(Contact):
            value = getattr(contact, f.name)
            if isinstance(value, np.ndarray):
                assert len(value) == n, f.name
                assert np.isfinite(value).all(), f.name
        assert np.hypot(*contact.gap_m[0]) == pytest.approx(0, abs=1e-15)
        assert contact.penetration_m == pytest.approx(np.hypot(*contact.gap_m.T) - room.radial_clearance_m)
        assert (contact.normal_force_N[contact.penetration_m < 0] == 0).all()
        assert (np.diff(contact.normal_impulse_N_s) >= 0).all()
        assert (contact.friction_loss_J is None) == (room.friction is None)
        impacts = contact.impacts
        assert len({len(getattr(impacts, f.name)) for f in fields(Impacts)}) == 1
        assert (np.diff(impacts.time_s) > 0).all()
        assert impacts.normal_impulse_N_s.sum() <= contact.normal_impulse_N_s[-1] * (1 + 1e-12)
    reached = [len(contact.impacts.time_s) for contact in trajectory.contacts.values()]
    assert sum(reached) > 0 or "damped" in name or "pendulum" in name, reached


@pytest.mark.parametrize("name", SCENES)
def test_two_runs_are_identical_to_the_last_bit(name: str) -> None:
    scene = short(SCENES[name]())
    assert same(run(scene), run(scene))


@pytest.mark.parametrize("name", [name for name in SCENES if "pendulum" not in name])
def test_forces_and_accelerations_agree_body_by_body(name: str) -> None:
    scene = with_friction(short(SCENES[name]()), 0.1)
    # What a native contact takes back of its penetration moves bodies without a force: not here.
    trajectory = run(scene, PymunkEngine(joints="all", collision_bias=1.0), samples=STEPS)
    dt, x = trajectory.step_s, trajectory.position
    acceleration = np.zeros_like(x)
    acceleration[1:-1] = (x[2:] - 2 * x[1:-1] + x[:-2]) / dt**2
    velocity = np.gradient(x, dt, axis=0)  # the mean of before and after the kick
    load = np.zeros((len(x), 2))
    load[:, 0] = sum(slider_forces(scene, x, velocity).values())
    kicked = slice(2, -1)  # kicks 0 and 1 are reported as what they should have been
    force, guide = joint_forces(trajectory), trajectory.guide_force_N["guide"]
    crank, rod, slider = scene.crank_slider()
    size = np.abs(force[kicked]).max()
    weight = np.array([0.0, scene.weight_m_s2])
    along = rod.length_m * np.stack([np.cos(x[:, 1, 2]), np.sin(x[:, 1, 2])], axis=-1)
    share = rod.centre_of_mass_m / rod.length_m

    def cross(a: Any, b: Any) -> Any:
        return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]

    residues = {
        "slider": slider.mass_kg * (acceleration[:, 2, :2] + weight)
        - load
        - force[:, 2]
        - guide[:, None] * np.array([0.0, 1.0]),
        "rod": rod.mass_kg * (acceleration[:, 1, :2] + weight) - force[:, 1] + force[:, 2],
        "crank": crank.mass_kg * (acceleration[:, 0, :2] + weight) - force[:, 0] + force[:, 1],
    }
    turning = rod.inertia_kg_m2 * acceleration[:, 1, 2]
    turning += share * cross(along, force[:, 1]) + (1 - share) * cross(along, force[:, 2])
    for joint, side in (("A", -1), ("B", 1)):  # the rod is the pin at A and the bearing at B
        if joint in trajectory.contacts:
            room, contact = getattr(scene.clearance, joint), trajectory.contacts[joint]
            assert contact.friction_force_N is not None
            c = room.radial_clearance_m if joint == "A" else 0.0
            turning += side * (room.bearing_radius_m - c) * contact.friction_force_N
    residues["rod's spin"] = turning / rod.length_m
    for body, residue in residues.items():
        worst = np.abs(residue[kicked]).max() / size
        # The arms to the contact point are taken without the penetration, 1e-4 of a radius of 1e-2 m.
        assert worst < (1e-3 if body == "rod's spin" else DIFFERENCING), f"{body}: {worst:.3g}"


@pytest.mark.parametrize("name", SCENES)
def test_what_the_energy_balance_leaves_over_falls_with_the_step(name: str) -> None:
    scene = short(SCENES[name]())
    left = []
    for steps in (STEPS, 8 * STEPS):
        trajectory = run(scene, steps=steps)
        turned_over = (
            kinetic_energy_J(scene, trajectory).max()
            + trajectory.contacts[scene.joints_with_clearance[0]].dissipated_energy_J.max()
        )
        left.append(np.abs(energy_balance_residual_J(scene, trajectory)).max() / turned_over)
    assert left[1] < max(0.6 * left[0], 1e-9), left
    assert left[1] < 2e-3, left


@pytest.mark.parametrize("name", ["clearance-driven-AB", "rigid-driven-AB", "rigid-free-OAB"])
def test_the_step_that_a_sample_falls_on_does_not_change_it(name: str) -> None:
    scene = short(SCENES[name]())
    each, some = run(scene, samples=STEPS), run(scene)
    for part in ("position", "velocity"):
        assert np.array_equal(getattr(each, part)[:: STEPS // SAMPLES], getattr(some, part)), part
    assert np.array_equal(joint_forces(each)[:: STEPS // SAMPLES], joint_forces(some))
    for joint, contact in some.contacts.items():
        other = each.contacts[joint]
        assert same(contact.impacts, other.impacts)
        assert np.array_equal(contact.normal_loss_J, other.normal_loss_J[:: STEPS // SAMPLES])


@pytest.mark.parametrize(
    ("name", "e"),
    [
        *[(name, e) for name in ("rigid-driven-0.5mm", "rigid-free-0.5mm") for e in (0.0, 0.5, 0.9, 1.0)],
        ("rigid-free-OAB", 0.5),
    ],
)
def test_every_native_bounce_has_the_scenes_restitution(name: str, e: float) -> None:
    scene = short(SCENES[name]())
    joints = {
        joint: getattr(scene.clearance, joint).model_copy(update={"restitution": e})
        for joint in scene.joints_with_clearance
    }
    scene = scene.model_copy(update={"clearance": Clearances(**joints)})
    for joint, contact in run(scene, steps=10 * STEPS).contacts.items():
        impacts = contact.impacts
        bounced = (impacts.duration_s == 0) & (impacts.approach_speed_m_s > 0.1)
        assert bounced.any() or e == 0, joint
        # loss = J (v - e v)/2 where nothing else pushes; loads are worth 1e-3 of a bounce here.
        impulse, speed = impacts.normal_impulse_N_s[bounced], impacts.approach_speed_m_s[bounced]
        restitution = 1 - 2 * impacts.energy_lost_J[bounced] / (impulse * speed)
        assert restitution == pytest.approx(e, abs=0.03), f"{joint}: {restitution}"


def test_ten_sweeps_lose_the_bounces_of_the_free_scene() -> None:
    scene = short(RIGID_SCENES["rigid-free-0.5mm"]())
    impulses = {
        sweeps: run(scene, PymunkEngine(contact_iterations=sweeps), 20000)
        .contacts["B"]
        .impacts.normal_impulse_N_s[1]
        for sweeps in (10, 50, 100, 200, 400)
    }
    error = {sweeps: abs(impulse / impulses[400] - 1) for sweeps, impulse in impulses.items()}
    assert error[10] > 0.1, error
    assert error[50] < 2e-3, error
    assert error[100] < 1e-5, error
    assert error[200] < 1e-8, error


def test_at_constant_speed_a_crank_with_clearance_at_o_keeps_its_speed_and_its_place() -> None:
    room = RIGID_SCENES["rigid-driven-0.1mm"]().clearance.B
    scene = short(ideal_driven().model_copy(update={"clearance": Clearances(O=room)}))
    trajectory = run(scene, steps=20000)
    assert np.ptp(trajectory.velocity[:, 0, 2]) == 0.0
    assert trajectory.contacts["O"].penetration_m.max() < 1e-6
    assert len(trajectory.contacts["O"].impacts.time_s) > 3
    residual, work = energy_balance_residual_J(scene, trajectory), trajectory.driver_work_J
    assert work is not None
    assert np.abs(residual).max() < 1e-3 * np.abs(work).max(), (residual, work)


@pytest.mark.parametrize(
    "drive",
    [
        TorqueDrive(kind="torque", torque_N_m=0.3),
        ConstantSpeedDrive(kind="constant-speed"),
    ],
)
@pytest.mark.parametrize("law", ["lankarani-nikravesh", "rigid"])
@pytest.mark.parametrize("joints", ["O", "A", "B", "OA", "OB", "AB", "OAB"])
def test_clearance_goes_with_any_joints_and_drive(joints: str, law: str, drive: Any) -> None:
    scenes = CLEARANCE_SCENES if law != "rigid" else RIGID_SCENES
    room = scenes["clearance-driven-0.1mm" if law != "rigid" else "rigid-driven-0.1mm"]().clearance.B
    scene = ideal_free().model_copy(
        update={
            "drive": drive,
            "end_time_s": 0.01,
            "clearance": Clearances(**dict.fromkeys(joints, room)),
        }
    )
    trajectory = run(scene, steps=10000)
    assert tuple(trajectory.contacts) == tuple(joints)
    residual, work = energy_balance_residual_J(scene, trajectory), trajectory.driver_work_J
    assert work is not None
    assert np.abs(residual).max() < 5e-3 * np.abs(kinetic_energy_J(scene, trajectory)).max(), residual


@pytest.mark.parametrize("arm", ["as-scene", "rigid"])
@pytest.mark.parametrize("make", [clearance_driven_05, clearance_free_three])
def test_friction_stays_in_coulombs_cone_and_energy_is_lost(make: Any, arm: Any) -> None:
    trajectory = run(with_friction(short(make()), 0.1), PymunkEngine(contact=arm), 20000, 200)
    for contact in trajectory.contacts.values():
        assert contact.friction_force_N is not None
        assert contact.friction_loss_J is not None
        within = np.abs(contact.friction_force_N) <= 0.1 * contact.normal_force_N * (1 + 1e-9)
        assert within.all()
        if arm == "as-scene":
            assert np.diff(contact.friction_loss_J).min() >= 0
            assert contact.friction_loss_J[-1] > 0


def test_friction_in_a_native_impact_can_create_energy_and_the_ledger_tells() -> None:
    """Newton's restitution with Coulomb's friction does (Kane 1984); here where pins hit a light crank."""
    scene = with_friction(short(clearance_free_three()), 0.1)
    trajectory = run(scene, PymunkEngine(contact="rigid"), 20000, 200)
    lost = {joint: contact.impacts.energy_lost_J for joint, contact in trajectory.contacts.items()}
    assert min(losses.min() for losses in lost.values()) < -0.01, lost
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max()
    assert residual < 1e-8, residual
    alone = run(with_friction(short(clearance_driven_05()), 0.1), PymunkEngine(contact="rigid"), 20000)
    assert alone.contacts["B"].impacts.energy_lost_J.min() > 0


def test_the_twin_of_a_native_contact_is_the_scene_with_rigid_walls() -> None:
    scene = CLEARANCE_SCENES["clearance-driven-AB"]()
    assert PymunkEngine().twin(scene) is scene
    twin = PymunkEngine(contact="rigid").twin(scene)
    assert twin.clearance == RIGID_SCENES["rigid-driven-AB"]().clearance
    assert same(run(short(scene), PymunkEngine(contact="rigid")), run(short(twin)))
    damped = PymunkEngine(contact="rigid").twin(CLEARANCE_SCENES["clearance-driven-damped"]()).clearance.B
    assert damped is not None
    assert (damped.law, damped.restitution) == ("rigid", 0.5)
    assert damped.friction is not None
    hertz = with_law(ideal_driven(), law="hertz", stiffness=1e10)
    lossless = PymunkEngine(contact="rigid").twin(hertz).clearance.B
    assert lossless is not None
    assert lossless.restitution == 1.0
    ideal = ideal_driven()
    assert PymunkEngine(contact="rigid").twin(ideal) is ideal


def test_a_law_that_names_no_restitution_has_no_rigid_twin() -> None:
    scene = with_law(ideal_driven(), law="kelvin-voigt", stiffness=1e8, damping_N_s_m=100.0)
    with pytest.raises(UnsupportedScene, match="kelvin-voigt names none"):
        run(scene, PymunkEngine(contact="rigid"))
    assert len(run(short(scene)).contacts["B"].impacts.time_s) > 0


def test_only_what_a_scene_needs_is_built() -> None:
    for name, shapes, constraints in (
        ("clearance-driven-0.5mm", 0, 1),
        ("rigid-driven-0.5mm", 2, 2),
        ("clearance-free-0.5mm", 0, 1),
        ("clearance-free-OAB", 0, 0),
        ("rigid-free-OAB", 6, 1),
    ):
        model = PymunkEngine()._model(SCENES[name](), RunSettings(1e-5, 1))
        assert (len(model.space.shapes), len(model.space.constraints)) == (shapes, constraints), name


@pytest.mark.parametrize(("engine", "steps"), [(PymunkEngine(), 500), (PymunkEngine(contact="rigid"), 30)])
def test_a_pin_that_goes_through_its_wall_is_a_failure_with_its_time(
    engine: PymunkEngine, steps: int, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = clearance_free_three().model_copy(update={"end_time_s": 0.1})
    with pytest.raises(SimulationFailed, match=r"^pin through the wall .* at joint [OAB] at t = \S+ s$"):
        run(scene, engine, steps, 10)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "settings",
    [
        {"contact": "soft"},
        {"contact_iterations": 0},
        {"collision_bias": -0.1},
        {"collision_bias": 1.1},
        {"collision_bias": float("nan")},
        {"collision_slop_m": -1e-6},
        {"collision_slop_m": float("inf")},
        {"collision_persistence": 0},
        {"collision_persistence": 2**31},
    ],
)
def test_settings_that_would_abort_or_switch_contacts_off_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(pydantic.ValidationError):
        PymunkEngine(**settings)


@pytest.mark.parametrize("drive", [FreeDrive(kind="free"), ConstantSpeedDrive(kind="constant-speed")])
def test_an_ideal_pendulum_swings_as_its_equation_says(drive: Any) -> None:
    scene = CLEARANCE_SCENES["clearance-pendulum"]().model_copy(
        update={"clearance": Clearances(), "drive": drive, "end_time_s": 0.3}
    )
    crank, g = scene.crank, scene.weight_m_s2
    pull = crank.mass_kg * g * crank.centre_of_mass_m
    inertia = crank.inertia_kg_m2 + crank.mass_kg * crank.centre_of_mass_m**2
    free = drive.kind == "free"
    speed = 0.0 if free else 5.0
    scene = scene.model_copy(update={"start": scene.start.model_copy(update={"crank_speed_rad_s": speed})})

    def rates(_: float, y: Any) -> list[float]:
        return [y[1], -pull * np.cos(y[0]) / inertia if free else 0.0]

    grid = np.linspace(0, 0.3, SAMPLES + 1)
    truth = solve_ivp(
        rates, (0, 0.3), [scene.start.crank_angle_rad, speed], "DOP853", grid, rtol=1e-12, atol=1e-12
    ).y
    error = []
    for steps in (1000, 2000):
        trajectory = run(scene, steps=steps)
        assert not trajectory.guide_force_N
        error.append(np.abs(trajectory.position[:, 0, 2] - truth[0]).max())
        s, theta, omega = crank.centre_of_mass_m, truth[0], truth[1]
        alpha = -pull * np.cos(theta) / inertia if free else 0 * theta
        along, across = (np.array([np.cos(a), np.sin(a)]) for a in (theta, theta + np.pi / 2))
        force = crank.mass_kg * (s * alpha * across - s * omega**2 * along + np.array([[0.0], [g]]))
        assert trajectory.joint_force_N["O"] == pytest.approx(force.T, abs=1e-3 * np.abs(force).max())
        if not free:
            assert trajectory.driver_torque_N_m == pytest.approx(pull * np.cos(theta), abs=1e-9)
    assert error[1] < max(0.26 * error[0], 1e-12), error

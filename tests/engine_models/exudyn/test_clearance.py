"""Exudyn with joint clearance against the reference's converged solution of the scene that Exudyn solves."""

import math
import re
import subprocess
import sys
from functools import lru_cache
from typing import Any

import numpy as np
import pydantic
import pytest

from engine_models.engine import Contact, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.exudyn.contact_law import native_law
from engine_models.exudyn.engine import ExudynEngine
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.mechanics.equations import mechanism_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import (
    CLEARANCE_SCENES,
    SCENES,
    clearance,
    ideal_driven,
    ideal_free,
    ideal_torque,
)
from engine_models.scene.scene import Clearance, Clearances, ContactLaw, Friction, Scene
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, errors, kinetic_energy_J

FREE, DRIVEN = "clearance-free-0.5mm", "clearance-driven-0.5mm"
SAMPLES = 200
#: Long enough for several impacts in every scene of the library, short enough to be predictable.
SHORT_S = {FREE: 0.05, "clearance-free-OAB": 0.01, "clearance-pendulum": 0.06, "clearance-start-up": 0.005}
DRIVEN_SHORT_S = 0.002


def shorter(scene: Scene, end_time_s: float) -> Scene:
    return scene.model_copy(update={"end_time_s": end_time_s})


def short(name: str) -> Scene:
    return shorter(SCENES[name](), SHORT_S.get(name, DRIVEN_SHORT_S))


def run(scene: Scene, step_s: float = 1e-3, samples: int = SAMPLES, **settings: Any) -> Trajectory:
    return ExudynEngine(**settings).simulate(scene, RunSettings(step_s, samples))


@lru_cache
def twin_run(scene: Scene) -> Trajectory:
    """Return the reference's converged solution of Exudyn's twin of a scene."""
    twin = ExudynEngine().twin(scene)
    return ReferenceEngine(steps_per_contact=200).simulate(twin, RunSettings(5e-6, SAMPLES))


def largest(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    return {name: float(values.max()) for name, values in errors(scene, trajectory, twin_run(scene)).items()}


@pytest.mark.parametrize("name", [FREE, DRIVEN])
def test_DOPRI5_meets_its_twin_within_a_nanometre_and_far_less(name: str) -> None:
    """Set F over 0.05 s, 15 impacts; set R over two milliseconds of its horizon, 6 impacts."""
    scene = short(name)
    trajectory = run(scene, step_tolerance=1e-11)
    off = largest(scene, trajectory)
    # Measured 1e-11 and 3e-13 m, 1e-3 N of 1.5 and 46 kN; the twin's own halved step moves it by 3e-12 m.
    assert off["slider_position_error_m"] < 1e-10, f"{off['slider_position_error_m']:.1e} m"
    assert off["joint_B_force_error_N"] < 0.02, f"{off['joint_B_force_error_N']:.1e} N"
    assert off["joint_O_force_error_N"] < 0.02, f"{off['joint_O_force_error_N']:.1e} N"
    impacts, true = trajectory.contacts["B"].impacts, twin_run(scene).contacts["B"].impacts
    assert len(impacts.time_s) == len(true.time_s) > 5
    for what, tolerance in (
        ("time_s", 1e-8),
        ("duration_s", 1e-9),
        ("approach_speed_m_s", 1e-6),
        ("normal_impulse_N_s", 1e-6),
        ("energy_lost_J", 1e-7),
    ):
        apart = np.abs(getattr(impacts, what) - getattr(true, what)).max()
        assert apart < tolerance, f"{what}: {apart:.1e}"


def test_a_tighter_tolerance_brings_set_R_closer_to_its_twin() -> None:
    scene = short(DRIVEN)
    off = [
        largest(scene, run(scene, step_tolerance=tol))["slider_position_error_m"]
        for tol in (1e-5, 1e-7, 1e-9)
    ]
    assert off[0] > 20 * off[1] > 400 * off[2], f"{off} m"
    assert off[2] < 1e-10, f"{off[2]:.1e} m"


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_every_clearance_scene_gives_a_whole_trajectory_that_conserves_energy(name: str) -> None:
    scene = short(name)
    trajectory = run(scene)
    n, bodies = SAMPLES + 1, len(scene.bodies)
    assert np.array_equal(trajectory.time_s, np.linspace(0.0, scene.end_time_s, n))
    assert trajectory.position.shape == trajectory.velocity.shape == (n, bodies, 3)
    assert {name: force.shape for name, force in trajectory.joint_force_N.items()} == dict.fromkeys(
        scene.joints, (n, 2)
    )
    assert [*trajectory.guide_force_N] == ["guide"] * scene.is_crank_slider
    position, velocity = start_state(scene)
    assert np.abs(trajectory.position[0] - position).max() < 1e-15
    assert np.abs(trajectory.velocity[0] - velocity).max() < 1e-12
    assert set(trajectory.contacts) == set(scene.joints_with_clearance)
    for contact in trajectory.contacts.values():
        assert all(np.isfinite(value).all() for value in arrays(contact).values())
        assert all(len(value) == n for value in arrays(contact).values())
        assert len(contact.impacts.time_s) > 0
    assert trajectory.dissipated_energy_J is not None
    exchanged = np.ptp(kinetic_energy_J(scene, trajectory)) + trajectory.dissipated_energy_J[-1]
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max()
    # Measured up to 1e-8; 4e-7 where friction's kinks fall inside steps.
    assert residual < 2e-6 * exchanged, f"{residual:.1e} of {exchanged:.1e} J"
    assert constraint_violation_m(scene, trajectory).max() < 1e-15, "a tree's joints cannot open"


def arrays(contact: Contact) -> dict[str, np.ndarray[Any, Any]]:
    return {name: value for name, value in vars(contact).items() if isinstance(value, np.ndarray)}


#: Just past the first impact.
FIRST_IMPACT_S = {
    FREE: 3e-3,
    "clearance-free-OAB": 3e-3,
    "clearance-pendulum": 0.02,
    "clearance-start-up": 2.4e-3,
}


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_forces_are_those_that_the_motion_asks_for(name: str) -> None:
    """Newton's and Euler's laws for every body, with accelerations differenced from the velocities."""
    samples = 10_000
    scene = shorter(SCENES[name](), FIRST_IMPACT_S.get(name, 8e-4))
    trajectory = run(scene, samples=samples)
    h = scene.end_time_s / samples
    acceleration = (trajectory.velocity[2:] - trajectory.velocity[:-2]) / (2 * h)
    applied = np.zeros_like(trajectory.position)
    applied[:, :, 1] = [-body.mass_kg * scene.weight_m_s2 for body in scene.bodies]
    if scene.is_crank_slider:
        applied[:, -1, 1] += trajectory.guide_force_N["guide"]
    if trajectory.driver_torque_N_m is not None:
        applied[:, 0, 2] += trajectory.driver_torque_N_m
    if scene.load.slider is not None:
        gas = scene.load.slider.gas
        assert gas is not None
        applied[:, -1, 0] += gas.spline()(trajectory.position[:, 0, 2])
        applied[:, -1, 0] -= (scene.load.slider.viscous_N_s_m or 0.0) * trajectory.velocity[:, -1, 0]
    levers = [(-scene.crank.centre_of_mass_m, scene.crank.length_m - scene.crank.centre_of_mass_m)]
    if scene.rod is not None:
        d = scene.rod.centre_of_mass_m
        levers += [(-d, scene.rod.length_m - d), (0.0, 0.0)]
    joint_forces = [*trajectory.joint_force_N.values()]
    for body, (inner, outer) in enumerate(levers):
        forces = [(inner, joint_forces[body])]
        if body + 1 < len(scene.joints):
            forces.append((outer, -joint_forces[body + 1]))
        angle = trajectory.position[:, body, 2]
        for lever, force in forces:
            applied[:, body, :2] += force
            applied[:, body, 2] += lever * (np.cos(angle) * force[:, 1] - np.sin(angle) * force[:, 0])
    inertia = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in scene.bodies])
    off = np.abs(applied[1:-1] - inertia * acceleration)
    if scene.is_crank_slider:
        off[:, -1, 2] = 0.0  # the guide takes what torque the slider feels
    if any(contact.friction_force_N is not None for contact in trajectory.contacts.values()):
        off[:, :, 2] = 0.0  # friction acts at the surfaces, off these levers
    largest_force = np.abs(joint_forces).max()
    # Differences over 0.1 to 2 us are off by up to 4e-3 in an impact.
    assert off[:, :, :2].max() < 1e-2 * largest_force, f"{off.max():.1e} of {largest_force:.1e} N"
    assert off[:, :, 2].max() < 1e-2 * largest_force * scene.crank.length_m, f"{off.max():.1e} N m"
    assert largest_force > 10, "in flight alone nothing is at stake"


#: Clearance in sets of joints and under drives that the library lacks, none at its assembled start's rest.
FRICTION = Friction(law="saturated-linear", coefficient=0.1, regularisation_speed_m_s=0.05)


def with_gaps(scene: Scene, joints: str, **changes: Any) -> Scene:
    gap = clearance(2e-4, "flores", 0.5, FRICTION).model_copy(update=changes)
    start = scene.start.model_copy(update={"crank_angle_rad": 0.7})
    return scene.model_copy(update={"clearance": Clearances(**dict.fromkeys(joints, gap)), "start": start})


@pytest.mark.parametrize("joints", ["O", "A", "B", "OA", "OB", "AB", "OAB"])
@pytest.mark.parametrize("scene", [ideal_torque(), ideal_driven()], ids=lambda scene: scene.name)
def test_both_models_solve_the_same_scene_wherever_the_clearance_is(scene: Scene, joints: str) -> None:
    """Trees and free bodies against constraints: other coordinates, another driver, another solver."""
    end = 0.01 if scene.drive.kind == "torque" else 8e-4
    for friction in (None, FRICTION):
        gaps = shorter(with_gaps(scene, joints, friction=friction), end)
        if (joints, scene.drive.kind) == ("O", "constant-speed"):
            with pytest.raises(UnsupportedScene, match="no coordinate is the angle of crank"):
                run(gaps, solver="DOPRI5")
            gaps = gaps.model_copy(update={"drive": ideal_free().drive})
        tree = run(gaps, 1e-5)
        other = run(gaps, end / SAMPLES / 20, solver="TrapezoidalIndex2")
        largest_force = np.abs([*tree.joint_force_N.values()]).max()
        for name, values in errors(gaps, other, tree).items():
            apart = float(np.median(values))
            # Measured up to 2e-6 m and 3e-4 of the largest force: wrong masses or drives are off by far more.
            limit = {"m": 5e-6, "m_s": 1e-3, "N": 1e-3 * largest_force, "N_m": 1e-4 * largest_force}
            unit = next(u for u in ("N_m", "m_s", "N_s", "N", "m") if name.endswith(f"_{u}"))
            assert apart < limit.get(unit, 1e-3), f"{name}: {apart:.1e}, forces up to {largest_force:.0f} N"


def test_the_trapezoidal_rule_is_of_order_2_from_impact_to_impact_and_so_are_its_contact_forces() -> None:
    scene = short(DRIVEN)
    steps = (1e-6, 5e-7, 2.5e-7)
    off = [largest(scene, run(scene, h, solver="TrapezoidalIndex2")) for h in steps]
    for name in ("slider_position_error_m", "joint_B_force_error_N", "driver_torque_error_N_m"):
        values = [error[name] for error in off]
        order = np.polyfit(np.log(steps), np.log(values), 1)[0]
        assert 1.7 < order < 2.6, f"{name}: order {order:.2f}, {values}"  # events cost and give a little
    assert off[-1]["joint_B_force_error_N"] < 100, "of 46 kN; measured 50 N"


def test_RK44_is_of_order_4_between_located_events_and_hardly_of_any_without() -> None:
    scene = short(DRIVEN)
    located, loose = (
        [
            largest(scene, run(scene, h, solver="RK44", locate_events=locate))["slider_position_error_m"]
            for h in (4e-6, 2e-6, 1e-6)
        ]
        for locate in (True, False)
    )
    assert located[0] > 30 * located[2], f"{located} m"
    assert located[2] < 1e-2 * loose[2], f"{located[2]:.1e} against {loose[2]:.1e} m"


LAWS: dict[ContactLaw, tuple[float, ...]] = {
    "hunt-crossley": (0.9, 0.0, 1.0),
    "lankarani-nikravesh": (0.9, 0.0),
    "gonthier": (0.9, 0.5, 0.1),
    "zhiying-qishao": (0.9, 0.1),
    "flores": (0.9, 0.5, 0.1),
    "hu-guo": (0.9, 0.5, 0.1),
    "carvalho-martins": (0.9, 0.5, 0.1),
}


def pressed(gap: Clearance, rate_m_s: float, sliding_m_s: float) -> Scene:
    """Return the pendulum with its pin 10 um deep in the bearing, on the right, moving so."""
    scene = SCENES["clearance-pendulum"]().model_copy(update={"clearance": Clearances(O=gap)})
    position, velocity = start_state(scene)
    position[0, 0] += gap.radial_clearance_m + 1e-5
    velocity[0] = rate_m_s, sliding_m_s, 0.0
    return started_from(scene, position, velocity)


def exudyn_force(scene: Scene) -> np.ndarray[Any, Any]:
    """Return the force on the pin that Exudyn itself computes at the start."""
    import exudyn as exu

    from engine_models.exudyn.model import build_model
    from engine_models.exudyn.solver import silence

    with silence():
        mbs = build_model(scene, tree=True).mbs
        objects = range(mbs.systemData.NumberOfObjects())
        (contact,) = (k for k in objects if mbs.GetObject(k)["objectType"] == "ContactSphereSphere")
        return np.asarray(mbs.GetObjectOutput(contact, exu.OutputVariableType.Force))[:2]


@pytest.mark.parametrize(("law", "restitution"), [(law, e) for law, es in LAWS.items() for e in es])
def test_every_law_of_the_family_is_exudyns_own_to_round_off(law: ContactLaw, restitution: float) -> None:
    """Against the reference's law table, at touch with 0.3 m/s, where v0 is the same for both."""
    gap = clearance(5e-4, law, restitution)
    wall = mechanism_of(pressed(gap, 0.3, 0.0)).contacts[0].compliance
    expected = wall.stiffness * 1e-5**1.5 * (1 + wall.damping_factor)
    force = exudyn_force(pressed(gap, 0.3, 0.0))
    # The depth of 1e-5 m is a difference of coordinates of 0.06 m: 14 digits less 4.
    assert -force[0] == pytest.approx(expected, rel=1e-11)
    assert native_law(gap).restitution > 0


@pytest.mark.parametrize("law", ["linear", "hertz", "kelvin-voigt"])
def test_laws_without_restitution_are_exudyns_own(law: ContactLaw) -> None:
    damping = 300.0 if law == "kelvin-voigt" else None
    gap = Clearance(
        radial_clearance_m=5e-4, bearing_radius_m=0.01, law=law, stiffness=1e8, damping_N_s_m=damping
    )
    exponent = 1.5 if law == "hertz" else 1.0
    expected = 1e8 * 1e-5**exponent + (damping or 0.0) * 0.3
    assert -exudyn_force(pressed(gap, 0.3, 0.0))[0] == pytest.approx(expected, rel=1e-10)


def test_friction_follows_the_normal_forces_sign_so_a_pulling_contact_drives_the_sliding() -> None:
    friction = FRICTION.model_copy(update={"coefficient": 0.2})
    gap = clearance(5e-4, "flores", 0.5, friction).model_copy(update={"minimum_impact_speed_m_s": 0.5})
    for rate, sliding in ((0.3, 0.02), (-1.0, 0.02), (-1.0, -0.02)):
        x, y = exudyn_force(pressed(gap, rate, sliding))
        assert (x < 0) == (rate > 0), "pushed inwards, or pulled outwards"
        assert y == pytest.approx(0.2 * x * sliding / 0.05, rel=1e-10)


def test_the_twin_is_the_scene_as_exudyn_has_it() -> None:
    plain, damped = SCENES[DRIVEN](), SCENES["clearance-driven-damped"]()
    engine = ExudynEngine()
    before, after = plain.clearance.B, engine.twin(plain).clearance.B
    assert before is not None
    assert after == before.model_copy(update={"may_pull": True, "minimum_impact_speed_m_s": 1e-6})
    twin = engine.twin(damped).clearance.B
    assert twin is not None
    assert twin.friction == Friction(law="saturated-linear", coefficient=0.1, regularisation_speed_m_s=0.01)
    hertz = Clearance(radial_clearance_m=5e-4, bearing_radius_m=0.01, law="hertz", stiffness=1e10)
    exact = plain.model_copy(update={"clearance": Clearances(B=hertz)})
    assert engine.twin(exact) == exact
    assert engine.twin(ideal_free()) == ideal_free()


DEAD_BAND = Friction(
    law="ambrosio", coefficient=0.1, regularisation_speed_m_s=0.01, dead_band_speed_m_s=0.001
)


@pytest.mark.parametrize(
    ("scene", "solver", "reason"),
    [
        (SCENES["rigid-driven-0.5mm"](), "auto", "rigid"),
        (with_gaps(ideal_free(), "B", friction=DEAD_BAND), "auto", "dead band"),
        (ideal_free(), "DOPRI5", "closed loop"),
        (with_gaps(ideal_driven(), "O"), "RK44", "no coordinate is the angle of crank"),
    ],
)
def test_what_exudyn_cannot_express_is_refused_with_the_reason(
    scene: Scene, solver: str, reason: str
) -> None:
    engine = ExudynEngine(solver=solver)  # type: ignore[arg-type]
    for refuse in (engine.check, engine.twin):
        with pytest.raises(UnsupportedScene, match=reason):
            refuse(scene)


@pytest.mark.parametrize(
    ("settings", "step_s"),
    [
        ({"solver": "RK44"}, 2e-4),
        ({"solver": "RK67", "locate_events": False}, 2e-4),
        ({"solver": "TrapezoidalIndex2", "locate_events": False}, 2e-4),
        ({"timeout_s": 1e-3}, 1e-6),
    ],
    ids=["blow-up", "blow-up-at-fixed-steps", "no-switching", "timeout"],
)
def test_a_run_that_breaks_down_says_when_and_why_and_prints_nothing(
    settings: dict[str, Any], step_s: float, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SimulationFailed) as failure:
        run(shorter(SCENES[DRIVEN](), 0.005), step_s, 20, **settings)
    assert re.fullmatch(r"(?:Exudyn|non-finite) .* at t = \S+ s\b.*", str(failure.value)), failure.value
    assert capfd.readouterr() == ("", "")


def test_steps_without_end_run_into_the_time_limit_and_no_further() -> None:
    """A crank at a million rad/s: DOPRI5 would try one step again and again if it had a shortest one."""
    scene = short(FREE)
    start = scene.start.model_copy(update={"crank_speed_rad_s": 1e6})
    with pytest.raises(SimulationFailed, match=r"not finished after 0\.5 s"):
        run(scene.model_copy(update={"start": start}), timeout_s=0.5)


def test_a_start_with_an_open_ideal_joint_is_refused() -> None:
    scene = short(FREE)
    position, velocity = start_state(scene)
    position[0, 0] += 1e-6
    with pytest.raises(SimulationFailed, match=r"open by 1e-06 m at t = 0 s"):
        run(started_from(scene, position, velocity))


def test_a_run_goes_on_from_any_state_of_an_earlier_one() -> None:
    scene = short("clearance-free-OAB")
    whole = run(scene, samples=2)
    rest = shorter(started_from(scene, whole.position[1], whole.velocity[1]), scene.end_time_s / 2)
    assert all(contact.penetration_m[1] < 0 for contact in whole.contacts.values()), "all in flight"
    apart = np.abs(run(rest, samples=1).position[-1] - whole.position[-1]).max()
    assert apart < 1e-8, f"{apart:.1e}"


@pytest.mark.parametrize(
    ("name", "objects", "sensors"),
    [
        (DRIVEN, ["ContactSphereSphere", "KinematicTree", "Mass1D"], 7),
        ("clearance-driven-A", ["ContactSphereSphere", "KinematicTree"], 4),
        ("clearance-driven-AB", [*["ContactSphereSphere"] * 2, "KinematicTree", "Mass1D", "RigidBody2D"], 11),
        ("clearance-pendulum", ["ContactSphereSphere", "Ground", "RigidBody2D"], 4),
    ],
)
def test_a_tree_model_holds_what_its_scene_needs_and_nothing_else(
    name: str, objects: list[str], sensors: int
) -> None:
    from engine_models.exudyn.model import build_model

    system = build_model(SCENES[name](), tree=True).mbs
    kinds = sorted(system.GetObject(k)["objectType"] for k in range(system.systemData.NumberOfObjects()))
    assert (kinds, system.systemData.NumberOfSensors()) == (objects, sensors)


@pytest.mark.parametrize("solver", ["DOPRI5", "TrapezoidalIndex2"])
def test_two_runs_are_bit_identical(solver: str) -> None:
    first, second = (run(short("clearance-driven-damped"), 1e-5, solver=solver) for _ in range(2))
    assert first.steps == second.steps
    assert np.array_equal(first.position, second.position)
    for joint, force in first.joint_force_N.items():
        assert np.array_equal(force, second.joint_force_N[joint]), joint
    for name, value in arrays(first.contacts["B"]).items():
        assert np.array_equal(value, getattr(second.contacts["B"], name)), name


@pytest.mark.parametrize("solver", ["DOPRI5", "ODE23"])
def test_the_last_stage_of_an_embedded_pair_is_the_acceleration_at_the_steps_end(solver: str) -> None:
    from engine_models.exudyn.model import build_model
    from engine_models.exudyn.solver import simulation_settings

    scene, records = short(DRIVEN), []
    engine = ExudynEngine(solver=solver, step_tolerance=1e-6)  # type: ignore[arg-type]
    for computed_again in (True, False):
        model, settings = (
            build_model(scene, tree=True),
            simulation_settings(engine, scene, RunSettings(1e-3, 10)),
        )
        settings.timeIntegration.explicit.computeEndOfStepAccelerations = computed_again
        model.mbs.SolveDynamic(settings)
        records.append([model.mbs.GetSensorStoredData(part.sensors[2]) for part in model.parts])
    for again, last in zip(*records, strict=True):
        largest_m_s2 = np.abs(again).max()
        assert np.abs(last - again)[1:].max() < 1e-10 * largest_m_s2  # but at the start, which has no stage


def test_samples_do_not_change_the_steps_of_an_adaptive_solver() -> None:
    few, many = (run(short(DRIVEN), 1e-5, samples) for samples in (2, 200))
    assert few.steps == many.steps
    assert few.position[:, -1, 0][-1] == many.position[:, -1, 0][-1]
    assert few.contacts["B"].normal_loss_J[-1] == pytest.approx(
        many.contacts["B"].normal_loss_J[-1], rel=1e-9
    )


def test_the_fast_build_gives_the_same_answer_in_a_process_of_its_own_and_prints_nothing() -> None:
    code = """
from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.exudyn.engine import ExudynEngine
from engine_models.scene.library import clearance_driven_05
scene = clearance_driven_05().model_copy(update=dict(end_time_s=1e-3))
position = ExudynEngine(fast=True).simulate(scene, RunSettings(1e-3, 10)).position[:, -1, 0][-1]
assert 1 - 1e-10 < position / {!r} < 1 + 1e-10, position
try:
    ExudynEngine(fast=False).check(scene)
except UnsupportedScene as refusal:
    assert "without range checks" in str(refusal)
else:
    raise AssertionError("a process has one build")
"""
    plain = float(run(shorter(SCENES[DRIVEN](), 1e-3), samples=10).position[:, -1, 0][-1])
    command = [sys.executable, "-W", "error", "-c", code.format(plain)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_step_that_ends_on_the_wall_is_no_contact() -> None:
    """DOPRI5 ends a step at the second touch: a contact of 5e-18 s would be there before the real one."""
    scene = shorter(SCENES[FREE](), 0.071)
    impacts = run(scene, 5e-3, 120, solver="DOPRI5", step_tolerance=1e-8).contacts["B"].impacts
    assert (len(impacts.time_s), impacts.duration_s.min() > 1e-5) == (24, True)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("step_tolerance", 0.0),
        ("step_tolerance", 1e-3),
        ("step_tolerance", math.nan),
        ("timeout_s", -1.0),
        ("solver", "DVERK6"),
        ("fast", 2),
    ],
)
def test_nonsense_settings_are_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(pydantic.ValidationError, match=field):
        ExudynEngine(**{field: value})  # type: ignore[arg-type]

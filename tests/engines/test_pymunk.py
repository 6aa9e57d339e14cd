"""What only Pymunk has: native contacts, sweeps, and steps shorter in contact."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pydantic
import pymunk
import pytest

from engine_models.arms import OUT_OF_THE_BOX
from engine_models.engine import RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.energy import energy_balance_residual_J
from engine_models.pymunk.engine import PymunkEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.format import Clearance
from engine_models.scene.library import SCENES, ideal_driven, ideal_free
from engine_models.scene.scene import Scene
from tests.engines.mechanism_texts import QUICK_RETURN, SCOTCH_YOKE
from tests.engines.mechanism_texts import scene as mechanism
from tests.engines.runs import errors, impact_numbers
from tests.helpers.arrays import arrays, joint_forces
from tests.scenes import scene
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES = 20
LIBRARY = PymunkEngine(**OUT_OF_THE_BOX.settings)  # type: ignore[arg-type]
SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-12)
DAMPED = SCENES["clearance-driven-damped"]()
#: A contact is noticed up to a step late, by chance: an error is the mean square of several steps.
FACTORS = (1.0, 1.07, 1.13, 1.21, 1.29, 1.37)


def run(of: Scene, steps: float, engine: PymunkEngine | None = None, samples: int = SAMPLES) -> Trajectory:
    return (engine or PymunkEngine()).simulate(of, RunSettings(of.end_time_s / steps, samples))


def sharp(of: Scene, samples: int = SAMPLES) -> Trajectory:
    return SHARP.simulate(of, RunSettings(of.end_time_s, samples))


def until(of: Scene, end_time_s: float, **changes: Any) -> Scene:
    return of.replace({"end_time_s": end_time_s, **changes})


def off(one: Trajectory, other: Trajectory) -> float:
    """Return the largest difference of positions, in m and rad."""
    return float(np.abs(one.position - other.position).max())


def mean_square(of: Scene, true: Trajectory, steps: float, **settings: Any) -> tuple[float, float]:
    """Return the mean square error of the slider over runs of about so many steps, and how many they took."""
    runs = [run(of, steps * factor, PymunkEngine(**settings), len(true.time_s) - 1) for factor in FACTORS]
    squares = [np.square(one.position - true.position)[:, -1, 0].max() for one in runs]
    return float(np.sqrt(np.mean(squares))), float(np.mean([one.steps for one in runs]))


# Against plain Pymunk: a crank-slider with clearance at B, by callbacks of its own.

STEPS, END_S, SWEEPS = 2000, 2e-3, 20


def plain_space(of: Scene) -> tuple[pymunk.Space, pymunk.Body, pymunk.Body]:
    """Return a space with a crank at constant speed, a rod pinned to it and a slider, and the last two."""
    _, link, block = of.crank_slider()
    space, speed = pymunk.Space(), of.short.start.crank_speed_rad_s
    space.iterations, space.gravity = SWEEPS, (0.0, of.gravity[1])
    r, length, d = of.short.crank.length_m, link.length_m, link.centre_of_mass_m
    crank = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    rod, slider = pymunk.Body(link.mass_kg, link.inertia_kg_m2), pymunk.Body(block.mass_kg, math.inf)
    crank.angular_velocity, rod.angular_velocity = speed, -r / length * speed  # at the outer dead centre
    rod.position, slider.position = (r + d, 0.0), (r + length, 0.0)
    rod.velocity = (0.0, speed * r * (1 - d / length))
    pivot = pymunk.PivotJoint(crank, rod, (r, 0.0), (-d, 0.0))
    guide = pymunk.GrooveJoint(space.static_body, slider, (-1.0, 0.0), (1.0, 0.0), (0.0, 0.0))
    pivot.error_bias = guide.error_bias = 0.0
    space.add(crank, rod, slider, pivot, guide)
    return space, rod, slider


def gap_of(rod: pymunk.Body, slider: pymunk.Body, place_m: float) -> tuple[pymunk.Vec2d, pymunk.Vec2d]:
    """Return the vector from the rod's bearing to the slider's pin, and how fast it changes."""
    d = slider.position - rod.local_to_world((place_m, 0.0))
    return d, slider.velocity - rod.velocity_at_local_point((place_m, 0.0))


def pushed_by_its_law(
    space: pymunk.Space, rod: pymunk.Body, slider: pymunk.Body, wall: Any, place: float
) -> None:
    """Have the law of Hu and Guo with hyperbolic friction act, as a hook of a joint that never does."""
    R, c, e, mu = wall.bearing_radius_m, wall.radial_clearance_m, wall.restitution, wall.friction.coefficient
    compliance = (1 - wall.poisson_ratio**2) / wall.young_modulus_Pa
    K = 4 / (3 * 2 * compliance) * math.sqrt(R * (R - c) / c)
    began = [0.0]

    def push(_joint: Any, _space: Any) -> None:
        d, rate = gap_of(rod, slider, place)
        delta = d.length - c
        if delta <= 0:
            began[0] = 0.0
            return
        n = d / d.length
        began[0] = began[0] or n.dot(rate)
        law = K * delta**1.5 * max(0.0, 1 + 3 * (1 - e) / (2 * e) * n.dot(rate) / began[0])
        sliding = n.cross(rate) - rod.angular_velocity * (R + delta / 2)
        rub = mu * law * math.tanh(sliding / wall.friction.regularisation_speed_m_s)
        force = -law * n - rub * n.perpendicular()
        at = rod.local_to_world((place, 0.0)) + (R + delta / 2) * n
        slider.apply_force_at_world_point(force, at)
        rod.apply_force_at_world_point(-force, at)

    hook = pymunk.SlideJoint(rod, slider, (place, 0.0), (0.0, 0.0), 0.0, math.inf)
    hook.pre_solve, hook.max_force = push, 0.0
    space.add(hook)


def test_bodies_move_as_in_a_loop_of_python_with_callbacks() -> None:
    of = until(DAMPED, END_S)
    link = of.crank_slider()[1]
    space, rod, slider = plain_space(of)
    pushed_by_its_law(space, rod, slider, of.clearance["B"], link.length_m - link.centre_of_mass_m)
    path = [[[*body.position, body.angle] for body in (rod, slider)]]
    for _ in range(STEPS):
        space.step(END_S / STEPS)
        path.append([[*body.position, body.angle] for body in (rod, slider)])
    engine = PymunkEngine(iterations=SWEEPS, half_kick_start=False)
    own = run(of, STEPS, engine, STEPS)
    # Round-off of 2000 steps and some impacts, in m and rad; measured 5e-15.
    assert np.abs(own.position[:, 1:] - np.array(path)).max() < 1e-12
    assert len(own.contacts["B"].impacts.time_s) > 0


def test_asking_whether_a_scene_is_supported_compiles_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CRANKSLIDER_CACHE", str(tmp_path))
    PymunkEngine().check(DAMPED)
    assert not [*tmp_path.rglob("*.nbc")]


# Starts, drives and loads.


@pytest.mark.parametrize("name", ["free", "clocked", "tabled"])
def test_out_of_the_box_every_signal_converges_at_order_one_once_started(name: str) -> None:
    of = scene(name)
    true = sharp(of)
    coarse, fine = (errors(run(of, n * SAMPLES, LIBRARY), true, since=1) for n in (241, 961))
    off_order = {
        key: (coarse[key], error)
        for key, error in fine.items()
        if error > 1e-10 and abs(np.log(coarse[key] / error) / np.log(961 / 241) - 1.0) > 0.1
    }
    assert off_order == {}


def test_without_the_half_kick_a_full_correction_makes_the_first_force_half_too_large() -> None:
    of = until(ideal_driven(), 12e-5)
    engine = PymunkEngine(iterations=20, half_kick_start=False)
    ratio = joint_forces(run(of, 12, engine, 12))[:, 1, 0] / joint_forces(exact(of, 12))[:, 1, 0]
    assert ratio[1] == pytest.approx(1.5, abs=0.01), ratio
    assert ratio[2:] == pytest.approx(1.0, abs=0.01), ratio


def motor(torque_N_m: float) -> dict[str, Any]:
    return {"drive": {"kind": "motor", "stall_torque_N_m": torque_N_m, "no_load_speed_rad_s": 60.0}}


def test_a_damper_too_strong_for_the_step_is_a_failure_with_its_time() -> None:
    of = until(ideal_free(), 0.01, **motor(6000.0))
    with pytest.raises(SimulationFailed, match=r"^[^\n]* at t = \S+ s[^\n]*$"):
        run(of, 200)
    assert run(of, 40_000).velocity[-1, 0, 2] == pytest.approx(60.0, abs=0.1), "the speed without a load"


# Joints and sweeps.


def weighed(of: Scene, rod: float, slider: float) -> Scene:
    """Return the scene with rod and slider so many times as heavy."""
    _, link, block = of.crank_slider()
    heavier = {"rod.mass_kg": rod * link.mass_kg, "rod.inertia_kg_m2": rod * link.inertia_kg_m2}
    return until(of, 0.024, **heavier, **{"slider.mass_kg": slider * block.mass_kg})


@pytest.mark.parametrize("of", [ideal_free(), ideal_driven()], ids=lambda of: of.name)
@pytest.mark.parametrize(("rod", "slider"), [(1, 1), (1, 0.1), (1, 100), (100, 1)])
def test_a_scenes_own_sweeps_leave_nothing_to_gain_and_ten_of_these_masses(
    of: Scene, rod: float, slider: float
) -> None:
    of = weighed(of, rod, slider)
    true = exact(of, SAMPLES)
    own, many = (off(run(of, 4800, PymunkEngine(iterations=n)), true) for n in (None, 2000))
    assert own < 1.1 * many, (own, many)
    if rod == slider == 1:
        assert off(run(of, 4800, PymunkEngine(iterations=10)), true) < 1.1 * many


OFF_LINE = QUICK_RETURN.replace('on = "lever" }', 'on = "lever", through_m = [0.0, 0.03] }')
OFF_CENTRE = QUICK_RETURN.replace("block = { pins_m = { A = 0.0 }", "block = { pins_m = { A = [0.01, 0.01] }")
ON_LEVER = QUICK_RETURN.replace("crank = 12.0 }", "} \nspeed_m_s = { slot = 0.2 }") + (
    '[drive]\nkind = "constant-speed"\nguide = "slot"\n'
)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (SCOTCH_YOKE, "guide slot to keep crank from turning on yoke, got turns = true: .* of order 1"),
        (OFF_LINE, "guide slot to lead through the point about which lever turns, .* of order 1"),
        (OFF_CENTRE, "guide slot to lead through the point about which block turns, .* of order 1"),
        (ON_LEVER, "drive.guide to be one on the ground, got slot on lever"),
    ],
)
def test_what_pymunk_does_not_express_is_refused_in_one_line(text: str, reason: str) -> None:
    with pytest.raises(UnsupportedScene, match=f"^pymunk: expected {reason}.*$"):
        PymunkEngine().check(mechanism(text))


def test_what_is_refused_of_guides_is_of_order_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine_models.pymunk.model._leads_through", lambda *_: True)
    of = mechanism(OFF_LINE, end_time_s=0.1)
    engine = PymunkEngine(iterations=200)
    coarse, fine = (off(run(of, steps, engine), sharp(of)) for steps in (1000, 4000))
    assert np.log2(coarse / fine) / 2 == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("of", "engine", "steps"),
    [
        (ideal_free(), PymunkEngine(iterations=4), 6560),
        (SCENES["clearance-pendulum"]().replace("start.crank_speed_rad_s", 1e9), PymunkEngine(), 1000),
        # The joints come open before the rod is turned over.
        (ideal_driven().replace("rod.length_m", 0.051), PymunkEngine(iterations=5), 20000),
    ],
)
def test_joints_that_come_open_are_a_failure_with_its_time(
    of: Scene, engine: PymunkEngine, steps: int, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SimulationFailed, match=r"^(constraints lost|pin through the wall).* at t = \S+ s$"):
        run(of, steps, engine, 10)
    assert capfd.readouterr() == ("", "")


# Contacts by a law, and native ones.


def wall(law: str, **more: Any) -> Clearance:
    sizes = {"radial_clearance_m": 5e-4, "bearing_radius_m": 0.01}
    return Clearance.model_validate({**sizes, "law": law, **more})


def hertzian(stiffness: float) -> Scene:
    """Return the free scene with a smooth lossless law, four contacts in 12 ms."""
    gap = wall("hertz", stiffness=stiffness).model_dump(exclude_none=True)
    return until(SCENES["clearance-free-0.5mm"](), 0.012, **{"clearance.B": gap})


def test_the_order_is_two_in_flight_and_contact() -> None:
    of = hertzian(1e11)
    true = sharp(of, 6)
    (coarse, _), (fine, _) = (mean_square(of, true, n, shorter_in_contact=16.0) for n in (1600, 12800))
    assert np.log2(coarse / fine) / 3 == pytest.approx(2.0, abs=0.15), (coarse, fine)


def test_brief_contacts_take_an_eighth_of_the_steps_for_a_smaller_error() -> None:
    of = hertzian(1e13)
    true = sharp(of, 6)
    one, steps_of_one_length = mean_square(of, true, 50000)
    shorter, steps = mean_square(of, true, 4800, shorter_in_contact=16.0)
    assert shorter < one, (shorter, one)
    assert steps < steps_of_one_length / 8, (steps, steps_of_one_length)


@pytest.mark.parametrize("of", [hertzian(1e11), until(DAMPED, 2e-3)], ids=["free", "driven"])
def test_shorter_steps_tell_all_of_a_contact(of: Scene) -> None:
    own, true = run(of, of.end_time_s / 5e-7, PymunkEngine(shorter_in_contact=8.0), 6), sharp(of, 6)
    assert np.array_equal(own.time_s, true.time_s)
    assert {key: error for key, error in errors(own, true).items() if error > 1e-2} == {}
    for key, value in impact_numbers(own).items():
        assert value == pytest.approx(impact_numbers(true)[key], rel=0.02), key
    if of.drive.kind != "free":
        assert errors(own, true)["work driver"] < 2e-3


@pytest.mark.parametrize(
    ("name", "settings", "reason"),
    [
        ("clearance-start-up", {}, "got drive.kind = ramp"),
        ("rigid-driven-0.5mm", {}, "got clearance.B.law = rigid"),
        ("clearance-driven-AB", {"contact": "rigid"}, "got clearance.A.law = rigid, clearance.B.law = rigid"),
        ("clearance-free-0.5mm", {"half_kick_start": False}, "got half_kick_start = False"),
    ],
)
def test_what_needs_steps_of_one_length_is_refused(name: str, settings: dict[str, Any], reason: str) -> None:
    with pytest.raises(UnsupportedScene, match=reason):
        PymunkEngine(shorter_in_contact=8.0, **settings).check(SCENES[name]())


def rubbing(of: Scene) -> Scene:
    """Return the scene with the same saturated friction in all its joints with clearance."""
    friction = {"law": "saturated-linear", "coefficient": 0.1, "regularisation_speed_m_s": 0.01}
    return of.replace({f"clearance.{joint}.friction": friction for joint in of.joints_with_clearance})


@pytest.mark.parametrize(
    ("name", "e"),
    [
        *[(f"rigid-{kind}-0.5mm", e) for kind in ("driven", "free") for e in (0.0, 0.5, 1.0)],
        ("rigid-free-OAB", 0.5),
    ],
)
def test_every_native_bounce_has_the_scenes_restitution(name: str, e: float) -> None:
    of = SCENES[name]()
    of = until(of, 2e-3 if "driven" in name else 0.02)
    of = of.replace({f"clearance.{joint}.restitution": e for joint in of.joints_with_clearance})
    for joint, contact in run(of, 20_000).contacts.items():
        impacts = contact.impacts
        bounced = (impacts.duration_s == 0) & (impacts.approach_speed_m_s > 0.1)
        assert bounced.any() or e == 0, joint
        # loss = J (v - e v)/2 where nothing else pushes; loads are worth 1e-3 of a bounce here.
        impulse, speed = impacts.normal_impulse_N_s[bounced], impacts.approach_speed_m_s[bounced]
        restitution = 1 - 2 * impacts.energy_lost_J[bounced] / (impulse * speed)
        assert restitution == pytest.approx(e, abs=0.03), f"{joint}: {restitution}"


def test_ten_sweeps_lose_the_bounces_of_the_free_scene_and_never_converge() -> None:
    of = until(SCENES["rigid-free-0.5mm"](), 0.02)
    impulse = {
        n: run(of, 20_000, PymunkEngine(iterations=n)).contacts["B"].impacts.normal_impulse_N_s[1]
        for n in (10, 50, 100, 200, 400)
    }
    error = {n: abs(value / impulse[400] - 1) for n, value in impulse.items()}
    assert error[10] > 0.1, error
    assert (error[50] < 2e-3, error[100] < 1e-5, error[200] < 1e-8) == (True, True, True), error
    true = sharp(of)
    few = [off(run(of, n, LIBRARY), true) for n in (6000, 60_000)]
    assert few[1] > 0.5 * few[0] > 100 * off(run(of, 60_000), true), few


def test_penetrations_taken_back_within_a_step_make_a_following_pin_flicker() -> None:
    """At e = 0.5 bounces end within 0.7 ms, and the pin follows the wall."""
    of = until(SCENES["rigid-driven-0.5mm"](), 3e-3, **{"clearance.B.restitution": 0.5})
    contacts, residual = {}, {}
    for bias in (0.0, 1e-300):
        made = run(of, 6000, PymunkEngine(collision_bias=bias))
        contacts[bias] = len(made.contacts["B"].impacts.time_s)
        residual[bias] = np.abs(energy_balance_residual_J(of, made)).max()
    assert contacts[1e-300] < 20 < 1000 < contacts[0.0], contacts
    assert residual[0.0] > 3 * residual[1e-300], residual


def test_friction_stays_in_coulombs_cone_and_of_native_impacts_can_create_energy() -> None:
    """Newton's restitution with Coulomb's friction does (Kane 1984); here where pins hit a light crank."""
    three, driven = (
        rubbing(until(SCENES[name](), end_s))
        for name, end_s in (("clearance-free-OAB", 0.02), ("clearance-driven-0.5mm", 2e-3))
    )
    native = PymunkEngine(contact="rigid")
    for of, engine in ((three, PymunkEngine()), (three, native), (driven, native)):
        own = run(of, 20_000, engine, 200)
        for each in own.contacts.values():
            assert each.friction_force_N is not None
            assert each.friction_loss_J is not None
            assert (np.abs(each.friction_force_N) <= 0.1 * each.normal_force_N * (1 + 1e-9)).all()
            assert engine is native or np.diff(each.friction_loss_J).min() >= 0
        lost = min(each.impacts.energy_lost_J.min() for each in own.contacts.values())
        if engine is native:
            assert lost < -0.01 if of is three else lost > 0
            residual = np.abs(energy_balance_residual_J(of, own)).max()
            # The ledger takes one place for both walls, Pymunk each one's own: 2e-7 J of friction's loss.
            assert residual < (1e-6 if of is three else 1e-5), "the ledger tells"


def test_the_twin_of_a_native_contact_is_the_scene_with_rigid_walls() -> None:
    of, native = SCENES["clearance-driven-AB"](), PymunkEngine(contact="rigid")
    assert PymunkEngine().twin(of) is of
    twin = native.twin(of)
    assert twin.clearance == SCENES["rigid-driven-AB"]().clearance
    assert arrays(run(until(of, 2e-3), 2000, native)) == arrays(run(until(twin, 2e-3), 2000))
    damped = native.twin(DAMPED).clearance["B"]
    assert damped is not None
    assert (damped.law, damped.restitution) == ("rigid", 0.5)
    assert damped.friction is not None
    assert native.twin(hertzian(1e10)).clearances["B"].restitution == 1.0
    ideal = ideal_driven()
    assert native.twin(ideal) is ideal
    voigt: dict[str, Any] = {"law": "kelvin-voigt", "stiffness": 1e8, "damping_N_s_m": 100.0}
    nameless = ideal_driven().replace("clearance.B", wall(**voigt).model_dump(exclude_none=True))
    with pytest.raises(UnsupportedScene, match="kelvin-voigt names none"):
        run(nameless, 100, native)


@pytest.mark.parametrize(("engine", "steps"), [(PymunkEngine(), 500), (PymunkEngine(contact="rigid"), 30)])
def test_a_pin_that_goes_through_its_wall_is_a_failure_with_its_time(
    engine: PymunkEngine, steps: int, capfd: pytest.CaptureFixture[str]
) -> None:
    of = until(SCENES["clearance-free-OAB"](), 0.1)
    with pytest.raises(SimulationFailed, match=r"^pin through the wall .* at joint [OAB] at t = \S+ s$"):
        run(of, steps, engine, 10)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("setting", "values"),
    [
        ("iterations", (0, -1, 2**31)),
        ("error_bias", (-0.1, 1.0, math.nan)),
        ("bias", (0.1,)),
        ("contact", ("soft",)),
        ("collision_bias", (-0.1, 1.1, math.nan)),
        ("collision_slop_m", (-1e-6, math.inf)),
        ("collision_persistence", (0, 2**31)),
    ],
)
def test_settings_that_would_abort_or_switch_contacts_off_are_refused(setting: str, values: Any) -> None:
    for value in values:
        with pytest.raises(pydantic.ValidationError):
            PymunkEngine(**{setting: value})

"""What only Pymunk has: native contacts, sweeps, and steps shorter in contact."""

from typing import Any

import numpy as np
import pytest

from engine_models.arms import OUT_OF_THE_BOX
from engine_models.engine import RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.energy import energy_balance_residual_J
from engine_models.mechanics.quality import require_quality
from engine_models.pymunk.engine import PymunkEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.format import Clearance
from engine_models.scene.library import SCENES, ideal_driven, ideal_free
from engine_models.scene.scene import Scene
from tests.engines.mechanism_texts import QUICK_RETURN, SCOTCH_YOKE
from tests.engines.mechanism_texts import scene as mechanism
from tests.engines.runs import errors, impact_numbers
from tests.helpers.arrays import arrays
from tests.helpers.crank_sliders import crank_slider
from tests.helpers.ideal_crank_slider import exact
from tests.scenes import scene

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


def motor(torque_N_m: float) -> dict[str, Any]:
    return {"drive": {"kind": "motor", "stall_torque_N_m": torque_N_m, "no_load_speed_rad_s": 60.0}}


def test_a_damper_too_strong_for_the_step_is_a_failure_with_its_time() -> None:
    of = until(ideal_free(), 0.01, **motor(6000.0))
    with pytest.raises(SimulationFailed, match=r"^[^\n]* at t = \S+ s[^\n]*$"):
        require_quality(of, run(of, 200))
    assert run(of, 40_000).velocity[-1, 0, 2] == pytest.approx(60.0, abs=0.1), "the speed without a load"


# Joints and sweeps.


def weighed(of: Scene, rod: float, slider: float) -> Scene:
    """Return the scene with rod and slider so many times as heavy."""
    _, link, block = crank_slider(of)
    heavier = {"rod.mass_kg": rod * link.mass_kg, "rod.inertia_kg_m2": rod * link.inertia_kg_m2}
    return until(of, 0.024, **heavier, **{"slider.mass_kg": slider * block.mass_kg})


@pytest.mark.parametrize("of", [ideal_free(), ideal_driven()], ids=lambda of: of.name)
@pytest.mark.parametrize(("rod", "slider"), [(1, 1), (1, 0.1), (1, 100), (100, 1)])
def test_a_scenes_own_sweeps_leave_nothing_to_gain_and_ten_of_these_masses(
    of: Scene, rod: float, slider: float
) -> None:
    of = weighed(of, rod, slider)
    true = exact(of, SAMPLES)
    own, many = (off(run(of, 2400, PymunkEngine(iterations=n)), true) for n in (None, 1000))
    assert own < 1.1 * many, (own, many)
    if rod == slider == 1:
        assert off(run(of, 2400, PymunkEngine(iterations=10)), true) < 1.1 * many


def test_sweeps_become_more_as_the_rod_turns_over_near_a_dead_centre() -> None:
    """L = 1.001 r: a hundred, enough at the start, leave the rod spinning, 32 rad off."""
    rod = {"rod.length_m": 0.05005, "rod.centre_of_mass_m": 0.025025}
    of = until(ideal_driven(), 1.0 / 523.5987755982989, **rod, **{"start.crank_angle_rad": np.pi / 2 - 0.5})
    assert off(run(of, 1300, samples=50), sharp(of, 50)) < 2e-5, "measured 7e-6"


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
    with pytest.raises(SimulationFailed, match=r"^(energy off|ideal joints|pin through).* at t = \S+ s"):
        require_quality(of, run(of, steps, engine, 10))
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


@pytest.mark.parametrize("of", [hertzian(1e11), until(DAMPED, 2e-3)], ids=["free", "driven"])
def test_shorter_steps_tell_all_of_a_contact(of: Scene) -> None:
    own, true = run(of, of.end_time_s / 5e-7, PymunkEngine(shorter_in_contact=8.0), 6), sharp(of, 6)
    assert np.array_equal(own.time_s, true.time_s)
    assert {key: error for key, error in errors(own, true).items() if error > 1e-2} == {}
    for key, value in impact_numbers(own).items():
        assert value == pytest.approx(impact_numbers(true)[key], rel=0.02), key
    if of.drive.kind != "free":
        assert errors(own, true)["work driver"] < 2e-3


def test_without_contacts_no_step_is_shorter() -> None:
    of, settings = until(ideal_free(), 0.006), RunSettings(2e-5, SAMPLES)
    plain, shorter = (PymunkEngine(shorter_in_contact=times) for times in (1.0, 8.0))
    ends = [engine.bare_run(of, settings).position for engine in (plain, shorter)]
    for end in (ends[1], shorter.simulate(of, settings).position[-1]):
        np.testing.assert_array_equal(end, ends[0])


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
    return of.replace({f"clearance.{joint}.friction": friction for joint in of.clearances})


@pytest.mark.parametrize(
    ("name", "e"),
    [
        *[("rigid-driven-0.5mm", e) for e in (0.0, 0.5, 1.0)],
        ("rigid-free-0.5mm", 1.0),
        ("rigid-free-OAB", 0.5),
    ],
)
def test_every_native_bounce_has_the_scenes_restitution(name: str, e: float) -> None:
    of = SCENES[name]()
    of = until(of, 2e-3 if "driven" in name else 0.02)
    of = of.replace({f"clearance.{joint}.restitution": e for joint in of.clearances})
    for joint, contact in run(of, 20_000).contacts.items():
        impacts = contact.impacts
        bounced = (impacts.duration_s == 0) & (impacts.approach_speed_m_s > 0.1)
        assert bounced.any() or e == 0, joint
        # loss = J (v - e v)/2 where nothing else pushes; loads are worth 1e-3 of a bounce here.
        impulse, speed = impacts.normal_impulse_N_s[bounced], impacts.approach_speed_m_s[bounced]
        restitution = 1 - 2 * impacts.energy_lost_J[bounced] / (impulse * speed)
        assert restitution == pytest.approx(e, abs=0.03), f"{joint}: {restitution}"


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
    assert native.twin(ideal) == ideal
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

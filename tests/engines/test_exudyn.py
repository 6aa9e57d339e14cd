"""What only Exudyn has: its law of contact, trees and constraints, drives by offsets, and its solvers."""

import re
from collections.abc import Callable
from functools import cache
from typing import Any

import exudyn as exu
import numpy as np
import pytest

from engine_models.engine import (
    EngineFailed,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
)
from engine_models.exudyn.contact import native_law
from engine_models.exudyn.engine import ExudynEngine
from engine_models.exudyn.model import Model
from engine_models.exudyn.solver import silence
from engine_models.mechanics.energy import energy_balance_residual_J
from engine_models.mechanics.start import start_state
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.run import mechanism_of
from engine_models.scene.format import Clearance, Friction
from engine_models.scene.library import SCENES, clearance, ideal_driven, ideal_free
from engine_models.scene.scene import Scene
from studies.judges.metrics import errors as crank_slider_errors
from tests.engines.mechanism_texts import V_TWIN, four_bars
from tests.engines.mechanism_texts import scene as mechanism
from tests.engines.runs import errors, largest_of_kind
from tests.helpers.starts import started_from
from tests.scenes import scene

FREE, DRIVEN = SCENES["clearance-free-0.5mm"](), SCENES["clearance-driven-0.5mm"]()
SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-12)
SAMPLES = 20
#: No sliding is as fast as its last kink.
FRICTION = {"law": "saturated-linear", "coefficient": 0.1, "regularisation_speed_m_s": 20.0}


def run(of: Scene, step_s: float, samples: int = SAMPLES, **settings: Any) -> Trajectory:
    return ExudynEngine(**settings).simulate(of, RunSettings(step_s, samples))


def until(of: Scene, end_time_s: float, **start: float) -> Scene:
    """Return a scene with another end and start."""
    return of.model_copy(update={"end_time_s": end_time_s, "start": of.short.start.model_copy(update=start)})


@cache
def sharp(of: Scene, samples: int = SAMPLES) -> Trajectory:
    """Return the reference's solution of Exudyn's twin of a scene."""
    return SHARP.simulate(ExudynEngine().twin(of), RunSettings(of.end_time_s, samples))


# Exudyn's own law of contact.


def pressed(gap: Clearance, rate_m_s: float, sliding_m_s: float) -> Scene:
    """Return the pendulum with its pin 10 um deep in the bearing, on the right, moving so."""
    of = SCENES["clearance-pendulum"]().model_copy(update={"clearance": {"O": gap}})
    position, velocity = start_state(of)
    position[0, 0] += gap.radial_clearance_m + 1e-5
    velocity[0] = rate_m_s, sliding_m_s, 0.0
    return started_from(of, position, velocity)


def exudyn_force(of: Scene) -> FloatArray:
    """Return the force on the pin that Exudyn itself computes at the start."""
    with silence():
        model = Model(of, tree=True)
        mbs = model.mbs
        objects = range(mbs.systemData.NumberOfObjects())
        (contact,) = (k for k in objects if mbs.GetObject(k)["objectType"] == "ContactSphereSphere")
        return np.asarray(mbs.GetObjectOutput(contact, exu.OutputVariableType.Force))[:2]


LAWS: dict[str, tuple[float, ...]] = {
    "hunt-crossley": (0.9, 0.0, 1.0),
    "lankarani-nikravesh": (0.9, 0.0),
    "gonthier": (0.9, 0.5, 0.1),
    "zhiying-qishao": (0.9, 0.1),
    "flores": (0.9, 0.5, 0.1),
    "hu-guo": (0.9, 0.5, 0.1),
    "carvalho-martins": (0.9, 0.5, 0.1),
}


@pytest.mark.parametrize(("law", "restitution"), [(law, e) for law, es in LAWS.items() for e in es])
def test_every_law_of_the_family_is_exudyns_own_to_round_off(law: Any, restitution: float) -> None:
    """Against the reference's law table, at touch with 0.3 m/s, where v0 is the same for both."""
    gap = clearance(5e-4, law, restitution)
    wall = mechanism_of(pressed(gap, 0.3, 0.0)).contacts[0].law
    expected = wall.stiffness * 1e-5**1.5 * (1 + wall.damping_factor)
    # The depth of 1e-5 m is a difference of coordinates of 0.06 m: 14 digits less 4.
    assert -exudyn_force(pressed(gap, 0.3, 0.0))[0] == pytest.approx(expected, rel=1e-11)
    assert native_law(gap)[1] > 0


def test_friction_follows_the_normal_forces_sign_so_a_pulling_contact_drives_the_sliding() -> None:
    friction = Friction(law="saturated-linear", coefficient=0.2, regularisation_speed_m_s=0.05)
    gap = clearance(5e-4, "flores", 0.5, friction).model_copy(update={"minimum_impact_speed_m_s": 0.5})
    for rate, sliding in ((0.3, 0.02), (-1.0, 0.02), (-1.0, -0.02)):
        x, y = exudyn_force(pressed(gap, rate, sliding))
        assert (x < 0) == (rate > 0), "pushed inwards, or pulled outwards"
        assert y == pytest.approx(0.2 * x * sliding / 0.05, rel=1e-10)


def test_the_twin_is_the_scene_as_exudyn_has_it() -> None:
    engine, before = ExudynEngine(), DRIVEN.clearance["B"]
    assert before is not None
    after = engine.twin(DRIVEN).clearance["B"]
    assert after == before.model_copy(update={"may_pull": True, "minimum_impact_speed_m_s": 1e-6})
    twin = engine.twin(SCENES["clearance-driven-damped"]()).clearance["B"]
    assert twin is not None
    assert twin.friction == Friction(law="saturated-linear", coefficient=0.1, regularisation_speed_m_s=0.01)
    hertz = Clearance(radial_clearance_m=5e-4, bearing_radius_m=0.01, law="hertz", stiffness=1e10)
    same = DRIVEN.model_copy(update={"clearance": {"B": hertz}})
    assert engine.twin(same) == same
    assert engine.twin(ideal_free()) == ideal_free()


def test_a_step_that_ends_on_the_wall_is_no_contact() -> None:
    """DOPRI5 ends a step at the second touch: a contact of 5e-18 s would be there before the real one."""
    impacts = run(until(FREE, 0.071), 5e-3, 120, solver="DOPRI5", step_tolerance=1e-8).contacts["B"].impacts
    assert (len(impacts.time_s), impacts.duration_s.min() > 1e-5) == (24, True)


# Trees, for explicit solvers, and constraints, for the trapezoidal rule.

WALL = {
    "radial_clearance_m": 2e-4,
    "bearing_radius_m": 0.01,
    "law": "flores",
    "stiffness": 6e10,
    "restitution": 0.8,
}


def loose(of: Scene, pins: str, bearing: str | None = None, **changes: Any) -> Scene:
    """Return a scene with walls around some of its pins, for the first of which it may name the bearing."""
    walls: dict[str, Any] = {f"clearance.{pin}": WALL for pin in pins}
    if bearing is not None:
        walls[f"clearance.{pins[0]}"] = {**WALL, "bearing": bearing, "friction": FRICTION}
    return of.replace({"end_time_s": 0.012, **walls, **changes})


def along(guide: str, kind: str, **more: float) -> Scene:
    """Return the quick return, driven along one of its guides in place of its motor."""
    start = {"start.hold": (), "start.speed_rad_s": {}, "start.speed_m_s": {guide: 0.2}}
    if guide == "slot":
        start["start.position_m"] = {"slot": 0.2363}
    return scene("everything").replace({"drive": {"kind": kind, "guide": guide, **more}, **start})


def bars(pins: str, bearing: str | None, **changes: Any) -> Scene:
    """Return the four-bar with other loose pins."""
    return loose(scene("bearing").replace("clearance", {}), pins, bearing, **changes)


#: By what hangs on what: from one pin of the ground, from both, afloat, on a driven ram, on a pin in a slot.
TREES: dict[str, Callable[[], Scene]] = {
    "from one pin": lambda: bars("AC", "coupler"),
    "afloat": lambda: bars("OC", None, drive={"kind": "free"}),
    "bearing that turns": lambda: bars("B", "rocker"),
    "lever on its block": lambda: loose(scene("everything"), "CE", "lever", end_time_s=0.006),
    "driven ram with a rod": lambda: loose(along("bed", "constant-speed"), "CD"),
    "driven ram alone": lambda: loose(
        along("bed", "fluctuating", amplitude_m_s=0.05, frequency_Hz=10.0), "CE", end_time_s=0.006
    ),
    "driven frame": lambda: loose(scene("yoke"), "O"),
    "crank on the slider": lambda: loose(SCENES["ideal-compressor"](), "O"),
    "table": lambda: loose(scene("tabled"), "A", end_time_s=0.006),
    "slot afloat": lambda: loose(scene("bead"), "O"),
    "driven bar": lambda: scene("bead").replace("drive", {"kind": "constant-speed", "body": "bar"}),
    "two pistons": lambda: loose(mechanism(V_TWIN), "BD"),
}


@pytest.mark.parametrize("name", TREES)
def test_a_tree_is_sharp(name: str) -> None:
    """At a tolerance of 1e-12 it is the reference in all signals."""
    of = TREES[name]()
    found = run(of, of.end_time_s / SAMPLES, step_tolerance=1e-12, solver="DOPRI5")
    # Measured up to 9e-11 of motions, 2e-6 of forces, 1e-9 of works and 4e-11 J.
    bounds, sizes = {"position": 1e-9, "velocity": 1e-7, "work": 1e-7}, largest_of_kind(sharp(of))
    for kind, error in errors(found, sharp(of)).items():
        zero = error * sizes[kind] < 1e-14  # of a moment that is none
        assert zero or error < bounds.get(kind.split()[0], 2e-5), f"{kind}: {error:.1e}"
    assert np.abs(energy_balance_residual_J(of, found)).max() < 1e-9


def test_a_slot_that_turns_may_be_driven_along() -> None:
    of = along("slot", "ramp", final_speed_m_s=-0.1, ramp_time_s=0.05).replace("end_time_s", 0.05)
    coarse, fine = (errors(run(of, of.end_time_s / steps), sharp(of)) for steps in (500, 2000))
    slow = {kind: error for kind, error in fine.items() if error > max(1e-7, coarse[kind] / 14)}
    assert slow == {}, "of order 2"


#: Friction at no sliding, which Exudyn has not.
DEAD_BAND = {**FRICTION, "law": "ambrosio", "dead_band_speed_m_s": 0.001}


@pytest.mark.parametrize(
    ("make", "solver", "reason"),
    [
        (SCENES["rigid-driven-0.5mm"], "auto", "rigid"),
        (lambda: DRIVEN.replace("clearance.B.friction", DEAD_BAND), "auto", "dead band"),
        (ideal_free, "DOPRI5", "ideal joints alone form a closed loop"),
        (lambda: loose(ideal_driven(), "O"), "RK44", "no coordinate is the angle of crank, whose speed is"),
        (
            lambda: scene("bead").replace("drive", {"kind": "constant-speed", "body": "bead"}),
            "RK44",
            "no coordinate is the angle of bead",
        ),
        (lambda: loose(along("slot", "constant-speed"), "CE"), "RK44", "slot is driven"),
    ],
)
def test_what_exudyn_cannot_express_is_refused_with_the_reason(make: Any, solver: Any, reason: str) -> None:
    of, engine = make(), ExudynEngine(solver=solver)
    for refuse in (engine.check, engine.twin):
        with pytest.raises(UnsupportedScene, match=reason):
            refuse(of)
    if solver != "auto":
        ExudynEngine().check(of)


# Drives and solvers.


@pytest.mark.parametrize(("solver", "steps"), [("DOPRI5", 100), ("RK44", 1600)])
def test_explicit_steps_end_where_contacts_switch(solver: str, steps: int) -> None:
    """Where steps run over touches and releases, positions are off by 2.1e-5 and 2e-7 m."""
    of = until(SCENES["clearance-driven-0.02mm"](), 0.0012)
    found = run(of, of.end_time_s / steps, step_tolerance=1e-5, solver=solver)
    np.testing.assert_allclose(found.position, sharp(of).position, rtol=0, atol=1e-7)


def test_the_trapezoidal_rule_is_of_order_2_from_impact_to_impact_and_so_are_its_contact_forces() -> None:
    of, steps = until(DRIVEN, 0.002), (1e-6, 2.5e-7)
    off = [crank_slider_errors(of, run(of, h, solver="TrapezoidalIndex2"), sharp(of)) for h in steps]
    for name in ("slider_position_error_m", "joint_B_force_error_N", "driver_torque_error_N_m"):
        order = np.log(off[0][name].max() / off[1][name].max()) / np.log(4)
        assert 1.7 < order < 2.6, f"{name}: order {order:.2f}"  # events cost and give a little
    assert off[-1]["joint_B_force_error_N"].max() < 100, "of 46 kN; measured 50 N"


# Failures, and what Exudyn leaves in its process.


#: Three bars of 1 m on three pins of the ground, coupled by two more: singular as all lie on a line.
DOUBLE_FOUR_BAR = mechanism(four_bars(2, 3.0))
#: With one of these steps at least the trapezoidal rule gives up in one of the three passes.
SINGULAR_STEPS_S = (8e-4, 9e-4, 1e-3, 1.2e-3)


def failure_of(of: Scene, steps_s: tuple[float, ...], **settings: Any) -> SimulationFailed:
    """Return how the first run fails that does."""
    for step_s in steps_s:
        try:
            run(of, step_s, 10, **settings)
        except SimulationFailed as failure:
            return failure
    raise AssertionError("none has failed")


def test_where_the_trapezoidal_rule_gives_up_generalized_alpha_goes_on() -> None:
    of = DOUBLE_FOUR_BAR
    failure = failure_of(of, SINGULAR_STEPS_S)
    assert isinstance(failure, EngineFailed)
    assert re.search(r"failed at t = [12]\.\d+ s: .*solver = GeneralizedAlpha may come through", str(failure))
    passed = run(of, 1e-3, solver="GeneralizedAlpha")
    # The bars stay parallel: one pendulum, whose energy is conserved.
    np.testing.assert_allclose(passed.position[:, 3, 2], 0.0, atol=1e-6)
    assert np.abs(energy_balance_residual_J(of, passed)).max() < 3e-3, "measured 1.3e-3 J, of 40 J"


@pytest.mark.parametrize(
    ("of", "steps_s", "settings", "words"),
    [
        (DOUBLE_FOUR_BAR, SINGULAR_STEPS_S, {}, "Exudyn"),
        # DOPRI5 would try one step again and again if it had a shortest one.
        (until(FREE, 0.05, crank_speed_rad_s=1e6), (1e-3,), {"timeout_s": 0.5}, "not finished after 0.5 s"),
    ],
    ids=["singular", "steps-without-end"],
)
def test_a_run_that_breaks_down_says_when_and_why_and_leaves_exudyn_as_it_was(
    of: Scene,
    steps_s: tuple[float, ...],
    settings: dict[str, Any],
    words: str,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(exu.config, "printToConsole", True)
    monkeypatch.setattr(exu.config, "suppressWarnings", False)
    failure = failure_of(of, steps_s, **settings)
    match = re.fullmatch(r"(?:Exudyn|non-finite) .* at t = (\S+) s\b.*", str(failure))
    assert match, failure
    assert words in match[0]
    assert 0 <= float(match[1]) <= of.end_time_s
    assert capfd.readouterr() == ("", "")
    assert (exu.config.printToConsole, exu.config.suppressWarnings) == (True, False)

"""Error control on crank-sliders with clearance: independent truth, RK4's located run, samples and calls."""

from dataclasses import replace
from functools import cache
from typing import get_args

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.engines import make_engine
from engine_models.mechanics.equations import mechanism_of
from engine_models.mechanics.start_check import checked_start
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES
from engine_models.scene.scene import LAWS_WITHOUT_RESTITUTION, ContactLaw, Scene
from reference_solver.compiled.faces import CompiledFace
from reference_solver.mechanism.mechanism import Body
from reference_solver.solution import Solution
from reference_solver.solver import ErrorControl, StepChoice, solve
from studies.extremes import gallery
from studies.judges.horizon import moved
from tests.helpers.crank_sliders import (
    IMPACT_S,
    POSITION_M,
    assert_same_touches,
    in_minimal_coordinates,
    short,
)

#: Tight enough for what the independent integration is asked for.
TIGHT = 1e-12


@cache
def solved(name: str, end: float, tolerance: float, samples: int = 30) -> Solution:
    scene = (CLEARANCE_SCENES | RIGID_SCENES)[name]()
    q, v = (part.ravel() for part in checked_start(scene))
    control = ErrorControl(tolerance)
    return solve(mechanism_of(scene), q, v, end_time_s=end, samples=samples, step=control)


@pytest.mark.accuracy
@pytest.mark.parametrize(
    "name",
    ["clearance-driven-0.5mm", "clearance-driven-damped", "clearance-driven-AB", "clearance-free-0.5mm"],
)
def test_slider_and_impacts_agree_with_an_independent_integration(name: str) -> None:
    scene = short(name)
    truth = in_minimal_coordinates(scene)
    found = solved(name, scene.end_time_s, TIGHT)
    off = np.abs(found.q[:, -3] - truth.position[:, -1, 0]).max()
    assert off < POSITION_M, f"slider off by {off:.1e} m"
    assert_same_touches(scene, found, truth)


@pytest.mark.parametrize("name", ["clearance-driven-AB", "clearance-driven-damped"])
def test_pins_touch_inwards_and_leave_outwards_by_turns(name: str) -> None:
    for tolerance in (1e-4, 1e-6, 1e-8):
        events = solved(name, 0.01, tolerance).events
        for k in range(2):
            own = events[(events["contact"] == k) & (np.abs(events["what"]) == 1)]
            assert (own["what"] == np.resize([1, -1], len(own))).all()
            assert (own["rate"] * own["what"] > 0).all()


@pytest.mark.parametrize(
    ("name", "end"), [("clearance-driven-AB", 0.006), ("rigid-driven-0.5mm", 0.006), ("rigid-free-OAB", 0.02)]
)
def test_neither_samples_nor_calls_change_steps(
    name: str, end: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    few, many = solved(name, end, 1e-8, 5), solved(name, end, 1e-8, 5 * 64)
    monkeypatch.setattr(CompiledFace, "chunk", 1)  # a step or so in a call
    called = solved.__wrapped__(name, end, 1e-8, 5)
    for other, every in ((many, 64), (called, 1)):
        assert other.steps == few.steps > 20
        assert np.array_equal(other.q[::every], few.q)
        assert np.array_equal(other.events, few.events)
        assert [i.time_s for i in other.impacts] == [i.time_s for i in few.impacts]


@pytest.mark.parametrize("name", ["rigid-driven-0.5mm", "rigid-free-0.5mm"])
def test_impacts_on_rigid_walls_are_those_of_the_located_run_by_rk4(name: str) -> None:
    scene, end = RIGID_SCENES[name](), 0.003 if "driven" in name else 0.02
    q, v = (part.ravel() for part in checked_start(scene))
    step = 1e-6 if "driven" in name else 4e-6
    truth = solve(mechanism_of(scene), q, v, end_time_s=end, samples=10, step=StepChoice(step))
    found = solved(name, end, TIGHT, 10)
    assert [i.kind for i in found.impacts] == [i.kind for i in truth.impacts]
    assert len(found.impacts) > 3
    for one, other in zip(found.impacts, truth.impacts, strict=True):
        assert abs(one.time_s - other.time_s) < IMPACT_S
        assert one.approach_speed_m_s == pytest.approx(other.approach_speed_m_s, rel=1e-6)
    assert np.abs(found.q - truth.q).max() < POSITION_M


def test_a_light_rod_with_friction_is_followed_to_the_tolerance() -> None:
    # A thousandth of its mass: friction's rate on it is the fastest there is.
    scene = CLEARANCE_SCENES["clearance-driven-damped"]()
    crank, rod, slider = (mechanism := mechanism_of(scene)).bodies
    light = replace(mechanism, bodies=(crank, Body(1e-3 * rod.mass_kg, 1e-3 * rod.inertia_kg_m2), slider))
    q, v = (part.ravel() for part in checked_start(scene))
    truth, *rest = (
        solve(light, q, v, end_time_s=0.002, samples=20, step=ErrorControl(tolerance))
        for tolerance in (1e-12, 1e-10, 1e-8, 1e-6)
    )
    for tolerance, found in zip((1e-10, 1e-8, 1e-6), rest, strict=True):
        error = np.abs(found.q[:, -3] - truth.q[:, -3]).max()
        assert error < 1e3 * tolerance * scene.crank.length_m, f"{error:.1e} m at {tolerance:.0e}"


def test_events_that_lie_close_together_are_taken_one_after_the_other() -> None:
    # Loose steps land on one joint's touch with the other's pin already past its wall.
    found = solved("clearance-driven-AB", 0.024, 1e-5)
    for k in range(2):
        what = found.events["what"][found.events["contact"] == k]
        turns = what[np.abs(what) == 1]
        assert (turns[::2] == 1).all()
        assert (turns[1::2] == -1).all()


def test_a_fold_that_no_step_passes_is_named_with_its_time() -> None:
    scene = gallery()["L = r through the fold"].scene
    engine = make_engine("reference", method="dop853", step_tolerance=1e-12)
    # No step there meets the tolerance, or one has ended right there, by round-off.
    fold = r"no step from t = 0\.\d+ s meets the tolerance|rank 8 of 9 at t = 0\.\d+ s"
    with pytest.raises(SimulationFailed, match=fold):
        engine.simulate(scene, RunSettings(scene.end_time_s, 10))


#: By how much the crank angle is moved in rad: the first starts a flight that comes back within one step.
MOVED_RAD = (2.0181418341130538e-05, *np.geomspace(1e-6, 1e-4, 9))


def test_no_pin_flies_inside_its_wall_however_a_run_begins() -> None:
    scene = CLEARANCE_SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 0.096})
    for by in MOVED_RAD:
        begun = moved(scene, float(by))
        q, v = (part.ravel() for part in checked_start(begun))
        mechanism = mechanism_of(begun)
        found = solve(mechanism, q, v, end_time_s=scene.end_time_s, samples=1600, step=ErrorControl(1e-7))
        depth = np.hypot(*found.gap_m[:, 0].T) - mechanism.contacts[0].radial_clearance_m
        inside = depth[~found.closed[:, 0]].max()
        assert inside < 2e-9, f"{inside:.1e} m past the wall, begun {by:.1e} rad beside"


def agreed_m(scene: Scene, end: float) -> float:
    """Return how far DOP853 is from RK4 at fine steps, in position and angle."""
    q, v = (part.ravel() for part in checked_start(scene))
    choices = ErrorControl(1e-12), StepChoice(1e-6, 1000)
    both = [
        solve(mechanism_of(scene), q, v, end_time_s=end, samples=20, step=choice, stabilisation="projection")
        for choice in choices
    ]
    return float(np.abs(both[0].q - both[1].q).max())


@pytest.mark.accuracy
@pytest.mark.parametrize("law", [law for law in get_args(ContactLaw) if law != "rigid"])
def test_every_law_gives_what_it_gives_by_rk4(law: ContactLaw) -> None:
    scene = CLEARANCE_SCENES["clearance-driven-0.5mm"]()
    assert scene.clearance.B is not None
    given = scene.clearance.B.model_dump(exclude_none=True) | {"law": law}
    if law in LAWS_WITHOUT_RESTITUTION:
        del given["restitution"]
    if law == "kelvin-voigt":
        given["damping_N_s_m"] = 500.0
    own = Scene.model_validate(scene.model_dump() | {"clearance": {"B": given}})
    # Measured: 2e-11 for hertz, whose contacts lose nothing, 3e-12 at most for all others.
    apart = agreed_m(own, 0.002)
    assert apart < 5e-10, f"{apart:.1e}"


@pytest.mark.accuracy
@pytest.mark.parametrize(("restitution", "rubs"), [(0.0, True), (0.3, False), (1.0, True), (1.0, False)])
def test_rigid_walls_give_what_they_give_by_rk4(restitution: float, rubs: bool) -> None:
    scene = RIGID_SCENES["rigid-free-0.5mm"]()
    assert scene.clearance.B is not None
    given = scene.clearance.B.model_dump(exclude_none=True) | {"restitution": restitution}
    if rubs:
        given["friction"] = {"law": "tanh", "coefficient": 0.2, "regularisation_speed_m_s": 0.02}
    own = Scene.model_validate(scene.model_dump() | {"clearance": {"B": given}})
    # 1e-9 at most: bounces that close are cut off earlier or later, and an elastic pin amplifies.
    apart = agreed_m(own, 0.06)
    assert apart < 1e-8, f"{apart:.1e}"

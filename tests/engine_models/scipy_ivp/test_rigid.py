"""SciPy between rigid walls: rebounds at located touches, impact by impact the reference's, up to rest."""

from dataclasses import astuple

import numpy as np
import pytest

from engine_models.engine import AdapterCannot, FloatArray, Impacts, RunSettings, Trajectory, UnsupportedScene
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import RIGID_SCENES
from engine_models.scene.scene import Friction, Scene
from engine_models.scipy_ivp.engine import ScipyEngine

SAMPLES = 24
#: Scenes with an end short of the first accumulation of bounces, and the impacts until then.
BEFORE_REST = {"rigid-free-0.5mm": (0.0731, 57), "rigid-driven-0.5mm": (0.0066, 56)}
#: When bounces accumulate there: the reference's pins follow their walls from then on, to round-off.
REST_S = {"rigid-free-0.5mm": 0.0731725, "rigid-driven-0.5mm": 0.00663301}


def rigid(name: str, **changes: object) -> Scene:
    """Return the scene of a name with law = "rigid" in place of its compliant one, and with changes there."""
    scene = RIGID_SCENES[name]()
    assert scene.clearance.B is not None
    wall = scene.clearance.B.model_copy(update=changes)
    return scene.model_copy(update={"clearance": scene.clearance.model_copy(update={"B": wall})})


def by_reference(scene: Scene) -> Trajectory:
    sharp = ReferenceEngine(method="dop853", step_tolerance=1e-13, lowest_flight=2.0)
    return sharp.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))


def by_scipy(scene: Scene) -> Trajectory:
    engine = ScipyEngine(rtol=1e-12, atol=1e-12)
    return engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))


def known(impacts: Impacts) -> FloatArray:
    """Return times, durations, speeds, impulses and losses of impacts, (5, m)."""
    return np.array(astuple(impacts)[:5])


@pytest.mark.parametrize("name", BEFORE_REST)
def test_every_impact_before_the_first_rest_is_the_references(name: str) -> None:
    end, count = BEFORE_REST[name]
    scene = rigid(name).model_copy(update={"end_time_s": end})
    run, reference = by_scipy(scene), by_reference(scene)
    own, other = (known(each.contacts["B"].impacts) for each in (run, reference))
    assert own.shape == other.shape == (5, count)
    # Errors of 1e-12 grow by a hundred to a thousand in so many impacts: 3e-9 s and, of the shortest flights'
    # impulses, 1e-6 of them are measured.
    np.testing.assert_allclose(own[0], other[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(own[2:], other[2:], rtol=1e-5)
    assert np.abs(run.position[:, -1, 0] - reference.position[:, -1, 0]).max() < 5e-11
    contact, of_reference = run.contacts["B"], reference.contacts["B"]
    np.testing.assert_allclose(contact.normal_impulse_N_s, of_reference.normal_impulse_N_s, rtol=1e-6)
    np.testing.assert_allclose(contact.normal_loss_J, of_reference.normal_loss_J, rtol=1e-6)


@pytest.mark.parametrize("name", REST_S)
def test_a_pin_that_comes_to_rest_ends_the_run_in_words_that_blame_no_engine(name: str) -> None:
    with pytest.raises(
        AdapterCannot, match=r"bounces accumulate at t = (.*) s: pin B .*law = 'rigid'"
    ) as end:
        by_scipy(rigid(name))
    told = float(str(end.value).split("t = ")[1].split(" s")[0])
    assert told == pytest.approx(REST_S[name], rel=1e-5)


def test_a_pin_that_is_slower_than_its_wall_lets_rebound_is_the_end() -> None:
    """The first impacts have 0.51, 0.34, 0.33 and 0.19 m/s."""
    scene = rigid("rigid-free-0.5mm", minimum_impact_speed_m_s=0.2)
    fourth = known(by_reference(scene.model_copy(update={"end_time_s": 0.01})).contacts["B"].impacts)[0, 3]
    with pytest.raises(AdapterCannot, match=f"at t = {fourth:.6g} s"):
        by_scipy(scene)


def test_a_wall_without_rebound_is_refused() -> None:
    with pytest.raises(UnsupportedScene, match=r"no pin that follows .*clearance\.B\.restitution = 0"):
        ScipyEngine().check(rigid("rigid-free-0.5mm", restitution=0.0))


def test_pins_of_two_joints_rebound_and_leave_the_reference_s_energy() -> None:
    scene = RIGID_SCENES["rigid-driven-AB"]().model_copy(update={"end_time_s": 0.002})
    run, reference = by_scipy(scene), by_reference(scene)
    for joint in "AB":
        own, other = (known(each.contacts[joint].impacts) for each in (run, reference))
        assert own.shape[1] > 2
        np.testing.assert_allclose(own, other, rtol=1e-6, atol=1e-10)
    assert run.driver_work_J is not None
    assert reference.driver_work_J is not None
    np.testing.assert_allclose(run.driver_work_J, reference.driver_work_J, rtol=1e-8, atol=1e-8)


def test_friction_acts_in_the_impacts() -> None:
    friction = Friction(law="tanh", coefficient=0.2, regularisation_speed_m_s=1e-3)
    scene = rigid("rigid-free-0.5mm", friction=friction).model_copy(update={"end_time_s": 0.03})
    run, reference = by_scipy(scene), by_reference(scene)
    own, other = (known(each.contacts["B"].impacts) for each in (run, reference))
    smooth = known(by_scipy(rigid(scene.name).model_copy(update={"end_time_s": 0.03})).contacts["B"].impacts)
    assert own.shape[1] > 4
    np.testing.assert_allclose(own, other, rtol=1e-7, atol=1e-11)
    assert abs(own[4, 0] / smooth[4, 0] - 1) > 1e-3, "friction takes part of what is lost"


def test_touches_have_to_be_located() -> None:
    with pytest.raises(UnsupportedScene, match=r"locate_events = true \(law = 'rigid' at B\)"):
        ScipyEngine(locate_events=False).check(rigid("rigid-free-0.5mm"))

"""What heyoka has no series for is refused, with the reason; so is everything where it is not installed."""

import pytest

from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.heyoka import engine as heyoka_engine
from engine_models.heyoka.engine import HeyokaEngine
from engine_models.scene.library import SCENES, clearance
from engine_models.scene.scene import Clearances, Friction, Scene


def with_B(**changes: object) -> Scene:
    """Return set R with another clearance at B."""
    room = clearance(5e-4).model_copy(update=changes)
    return SCENES["ideal-driven"]().model_copy(update={"clearance": Clearances(B=room)})


RUBBED = Friction(law="saturated-linear", coefficient=0.1, regularisation_speed_m_s=0.1)


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (SCENES["ideal-driven"](), "the motion is prescribed: there is no ODE to integrate"),
        (SCENES["rigid-driven-damped"](), r"at B: friction in impacts on rigid walls \(law = 'rigid'\)"),
        (with_B(exponent=1.3), r"at B: twice the exponent is not whole \(exponent = 1\.3\)"),
        (with_B(friction=RUBBED), r"at B: friction has kinks \(friction\.law = 'saturated-linear'\)"),
    ],
    ids=["prescribed", "rigid", "exponent", "friction"],
)
def test_a_scene_without_a_series_is_refused(
    scene: Scene, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heyoka_engine, "find_spec", lambda _: object())  # as where it is installed
    with pytest.raises(UnsupportedScene, match=reason):
        HeyokaEngine().check(scene)


def test_without_heyoka_every_scene_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(heyoka_engine, "find_spec", lambda _: None)
    with pytest.raises(UnsupportedScene, match="heyoka is not installed: pip install heyoka"):
        HeyokaEngine().simulate(SCENES["ideal-free"](), RunSettings(1.0, 10))

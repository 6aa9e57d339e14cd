"""The suite as pytest runs it on one engine: a test for each claim and scene (see ``plugin``)."""

from functools import cache

import pytest

from engine_models.engine import UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from studies.conformance.claims import CLAIMS, Trial
from studies.conformance.orders import states_its_order
from studies.conformance.verdicts import tried


@pytest.fixture(scope="session")
def engine_name(pytestconfig: pytest.Config) -> str:
    """The engine that was asked for."""
    return str(pytestconfig.getoption("--engine"))


@cache
def _trial(engine_name: str, scene: str) -> Trial:
    return Trial(make_engine(engine_name), SCENES[scene]())


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("claim", CLAIMS)
def test_claim(engine_name: str, scene: str, claim: str) -> None:
    """Hold the engine to a claim on a scene that it runs."""
    trial = _trial(engine_name, scene)
    try:
        trial.engine.check(trial.whole)
    except UnsupportedScene as reason:
        pytest.skip(str(reason))
    holds, measured = tried(CLAIMS[claim], trial)
    assert holds, measured


def test_order(engine_name: str) -> None:
    """Hold the engine to the order that it states."""
    holds, measured = tried(states_its_order, make_engine(engine_name))
    assert holds, measured

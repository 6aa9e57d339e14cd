"""The suite as pytest runs it on one engine: a test for each claim and scene (see ``plugin``)."""

from functools import cache

import pytest

from engine_models.engines import make_engine
from studies.conformance.claims import CLAIMS, Trial
from studies.conformance.mechanisms import NAMES, scene_of
from studies.conformance.verdicts import OF_ENGINE, tried


@pytest.fixture(scope="session")
def engine_name(pytestconfig: pytest.Config) -> str:
    """The engine that was asked for."""
    return str(pytestconfig.getoption("--engine"))


@cache
def _trial(engine_name: str, scene: str) -> Trial:
    return Trial(make_engine(engine_name), scene_of(scene))


@pytest.mark.parametrize("scene", NAMES)
@pytest.mark.parametrize("claim", CLAIMS)
def test_claim(engine_name: str, scene: str, claim: str) -> None:
    """Hold the engine to a claim on a scene that it runs."""
    trial = _trial(engine_name, scene)
    if trial.refusal:
        pytest.skip(trial.refusal)
    holds, measured = tried(CLAIMS[claim], trial)
    assert holds, measured


@pytest.mark.parametrize("claim", OF_ENGINE)
def test_of_engine(engine_name: str, claim: str) -> None:
    """Hold the engine to the order and the accuracy that it states."""
    holds, measured = tried(OF_ENGINE[claim], make_engine(engine_name))
    assert holds, measured

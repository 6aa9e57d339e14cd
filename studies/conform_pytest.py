"""A plugin of pytest: ``pytest --crankslider-engine my_module:MyEngine`` holds an engine to every claim."""

from functools import cache

import pytest

from engine_models.engines import make_engine
from engine_models.scene.library import ALL_SCENES
from studies.conform import CLAIMS, OF_ENGINE, trial_of, tried

OPTION = "--crankslider-engine"
_trial = cache(lambda engine, scene: trial_of(make_engine(engine), scene))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption(OPTION, metavar="MODULE:CLASS", help="an engine to hold to crankslider's claims")


def pytest_configure(config: pytest.Config) -> None:
    """Have the tests of this file collected beside what else is asked for."""
    if config.getoption(OPTION):
        config.args.append(__file__)


@pytest.mark.parametrize("scene", ALL_SCENES)
@pytest.mark.parametrize("claim", CLAIMS)
def test_claim(pytestconfig: pytest.Config, scene: str, claim: str) -> None:
    """Hold the engine to a claim on a scene that it runs."""
    trial = _trial(pytestconfig.getoption(OPTION), scene)
    if trial.refusal:
        pytest.skip(trial.refusal)
    holds, measured = tried(CLAIMS[claim], trial)
    assert holds, measured


@pytest.mark.parametrize("claim", OF_ENGINE)
def test_of_engine(pytestconfig: pytest.Config, claim: str) -> None:
    """Hold the engine to the order and the accuracy that it states."""
    holds, measured = tried(OF_ENGINE[claim], make_engine(pytestconfig.getoption(OPTION)))
    assert holds, measured

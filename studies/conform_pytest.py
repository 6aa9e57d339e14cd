"""A plugin of pytest: ``pytest --crankslider-engine my_module:MyEngine`` holds an engine to every claim."""

import pytest

from engine_models.engines import make_engine
from engine_models.scene.library import ALL_SCENES
from studies.conform import verdicts

OPTION = "--crankslider-engine"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption(OPTION, metavar="MODULE:CLASS", help="an engine to hold to crankslider's claims")


def pytest_configure(config: pytest.Config) -> None:
    """Have the test of this file collected beside what else is asked for."""
    if config.getoption(OPTION):
        config.args.append(__file__)


@pytest.mark.parametrize("scene", ["", *ALL_SCENES])
def test_claims(pytestconfig: pytest.Config, scene: str) -> None:
    """Hold the engine to every claim on a scene that it runs, or to what it states of itself."""
    found = verdicts(make_engine(pytestconfig.getoption(OPTION)), [scene])
    failed = [f"{each.claim}: {each.measured}" for each in found if not each.holds]
    assert not failed, "; ".join(failed)

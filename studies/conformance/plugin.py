"""A plugin of pytest: by ``pytest --engine my_module:MyEngine`` any project runs the suite on its engine."""

from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption("--engine", metavar="MODULE:CLASS", help="an engine to hold to crankslider's claims")


def pytest_configure(config: pytest.Config) -> None:
    """Have the suite collected beside what else is asked for."""
    if config.getoption("--engine"):
        config.args.append(str(Path(__file__).with_name("suite.py")))

"""The command of a recommended run asks for that run."""

from shlex import quote, split
from typing import Any, NoReturn

import pandas as pd
import pytest

from crankslider import library
from engine_models.engines import make_engine
from reports.look import command
from studies.accuracy import cases
from studies.failures import Failed
from tests.helpers.command import crankslider


def test_the_command_of_every_setting_typed_asks_for_that_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = [case for case in cases(full=False) if "view" not in case.columns]
    asked = set()

    def hear(scene: Any, name: str, *, step: str, settings: Any, **_: Any) -> NoReturn:
        asked.add((scene.name, scene.end_time_s, name, library.read_engine(name, settings), float(step)))
        raise Failed("heard")

    monkeypatch.setattr(library, "simulate", hear)
    for case in ran:
        given = f"{quote(case.scene.name)} --end {case.scene.end_time_s:.6g}"
        typed = command(pd.Series(case.head()), given)
        assert crankslider(*split(typed)[1:]).stderr == "error: heard\n", typed
    assert asked == {
        (
            case.scene.name,
            case.scene.end_time_s,
            case.engine,
            make_engine(case.engine, **case.settings),
            float(f"{case.head()['step_s']:.6g}"),
        )
        for case in ran
    }

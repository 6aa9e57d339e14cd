"""The ladders are those of the recorded search of settings, and no setting that it tried beats them."""

import re
from pathlib import Path

import pandas as pd
import pytest

from engine_models.scene.scene import Scene
from reports.tables import number
from studies.command.search import BEATEN, beaten
from studies.work_precision import settings_search
from studies.work_precision.study import SAMPLES, case_of, ladder

RECORD = pd.read_csv(Path(settings_search.__file__).with_name("search_record.csv"), keep_default_na=False)
NUMBER = re.compile(r"\d\.\de-\d\d")


def test_no_recorded_setting_surely_beats_a_ladder_by_more_than_a_quarter() -> None:
    numbers = RECORD.assign(high=pd.to_numeric(RECORD["high"]))
    assert beaten(numbers).empty, beaten(numbers)[["scene", "ladder", "search", "high"]].to_string()
    assert (numbers["high"] < 1).any(), f"a record without a faster setting tells nothing, {BEATEN}"


def test_every_engine_with_a_ladder_of_its_own_is_in_the_record() -> None:
    assert set(RECORD["engine"]) == {"reference", "exudyn", "pymunk", "scipy", "heyoka"}
    assert set(RECORD["scene"]) == set(settings_search.CHOSEN_ON)


@pytest.mark.parametrize("scene", settings_search.scenes(full=False), ids=lambda scene: scene.name)
def test_the_ladders_have_the_settings_of_the_record(scene: Scene) -> None:
    rungs: dict[str, set[str]] = {}
    for rung in ladder(scene, full=False):
        case = case_of("", scene, rung, SAMPLES)
        tolerances = [case.settings[name] for name in rung.arm.tolerances]
        step_s = case.run.step_used_s(scene.end_time_s)
        rungs.setdefault(rung.arm.label, set()).update(number(float(x)) for x in [step_s, *tolerances])
    for way in RECORD["ladder"][(RECORD["scene"] == scene.name) & (RECORD["ladder"] != "")]:
        label, _, setting = way.rpartition(", ")
        assert label in rungs, f"{label} is no arm of the ladder"
        assert set(NUMBER.findall(setting)) <= rungs[label], f"{way}: {sorted(rungs[label])}"

"""An engine that only its own file and its line in the registry know takes part in every study."""

from typing import Any

import pandas as pd
import pytest

from engine_models import arms, engines
from engine_models.arms import NAMED, Arm
from engine_models.engines import engine_class, make_engine
from reports.look import legend_place, line_styles
from studies.case import Case, load_study, run_case
from studies.registry import STUDIES

pytestmark = pytest.mark.system

NAME = "newcomer"


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register the trapezoidal rule of Exudyn once more, under a name that no study knows."""
    monkeypatch.setitem(engines._CLASSES, NAME, ("engine_models.exudyn.engine", "ExudynEngine"))
    monkeypatch.setattr(engines, "ENGINES", (*engines.ENGINES, NAME))


def its_cases(study: str, full: bool) -> list[Case]:
    return [case for case in load_study(study).cases(full) if case.engine == NAME]


@pytest.mark.parametrize("study", STUDIES)
def test_a_new_engine_takes_part_in_every_study(study: str) -> None:
    first, *_ = its_cases(study, full=False)
    row: dict[str, Any] = run_case(first)[0]
    assert row["engine"] == NAME
    assert row["status"] in ("ok", "unsupported"), row["reason"]


def test_a_new_engine_takes_part_on_the_scenes_of_all_others() -> None:
    for study in STUDIES:
        cases = load_study(study).cases(True)
        named = {case.scene.name for case in cases if case.engine in NAMED and case.engine != "reference"}
        own = {case.scene.name for case in cases if case.engine == NAME}
        assert own
        assert named <= own, study


def test_the_studies_name_only_engines_that_exist() -> None:
    assert set(NAMED) < set(engines.ENGINES)


def test_a_new_engine_comes_last_in_legends_and_looks_like_no_other() -> None:
    rows = pd.DataFrame({"engine": [NAME, *NAMED], "label": [NAME, *NAMED]})
    assert max(rows["engine"], key=lambda engine: legend_place(engine, "default")) == NAME
    looks = {(style["color"], style["marker"]) for style in line_styles(rows).values()}
    assert len(looks) == len(rows)


@pytest.mark.parametrize("engine", NAMED)
def test_an_engine_is_made_of_its_settings_and_nothing_else(engine: str) -> None:
    assert make_engine(engine) == engine_class(engine)()
    catalogue = [arm for arm in vars(arms).values() if isinstance(arm, Arm)]
    for arm in (arm for arm in catalogue if arm.engine == engine):
        assert make_engine(engine, **arm.settings) == engine_class(engine)(**arm.settings)

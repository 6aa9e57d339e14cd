"""Scenes of the user's in the studies: the right cases of the right scene, told from others of its name."""

from pathlib import Path

import pytest

from engine_models.scene.file import from_toml
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from reports.chapters.energy import drift, prepared
from reports.parts import Contradiction
from reports.results import frame
from studies import agreement
from studies.running.finished_cases import opened
from studies.running.given_scenes import CONTENT, cases_of, contents
from studies.running.outcome import load_study, run_case
from studies.running.registry import STUDIES
from tests.engine_models.reference.mechanism_texts import ANDREWS, FOUR_BAR, FOUR_BAR_CLEARANCE
from tests.helpers.row_files import read_rows

#: A library scene that each study takes, but for the gallery, which has its own.
TAKEN = {
    "agreement": "ideal-free",
    "clearance": "rigid-free-0.5mm",
    "work-precision": "clearance-start-up",
    "energy": "ideal-compressor",
    "stability": "clearance-driven-0.1mm",
}
CODE = "0123456789abcdef"


def mine(name: str) -> Scene:
    return SCENES[name]().model_copy(update={"name": "mine", "gravity_m_s2": 1.62})


def test_every_study_takes_scenes_but_the_gallery_and_the_pictures() -> None:
    assert TAKEN.keys() == STUDIES.keys() - {"extremes", "motions", "predictability"}


@pytest.mark.parametrize("study", TAKEN)
def test_a_study_runs_the_scene_that_it_is_given_and_no_other(study: str) -> None:
    cases = cases_of(study, load_study(study), False, [mine(TAKEN[study])])
    assert {case.engine for case in cases} >= {"reference", "pymunk"}
    for case in cases:
        assert case.scene.name.startswith("mine")
        assert case.scene.gravity_m_s2 == mine(TAKEN[study]).gravity_m_s2
        Scene.model_validate(case.scene.model_dump())
    assert len({case.key("") for case in cases}) == len(cases)


OTHERS = {
    "agreement": FOUR_BAR,
    "energy": ANDREWS,
    "clearance": FOUR_BAR_CLEARANCE,
}


@pytest.mark.parametrize("study", OTHERS)
def test_a_study_takes_other_mechanisms(study: str) -> None:
    """The errors and horizons of one run of the reference are those of what the scene observes."""
    scene = from_toml(OTHERS[study]).replace("end_time_s", 0.004)
    cases = cases_of(study, load_study(study), False, [scene])
    assert {case.engine for case in cases} >= {"reference"}
    case = next(case for case in cases if case.engine == "reference")
    row, curves = run_case(case)
    assert row["status"] == "ok", row["reason"]
    if study in ("agreement", "clearance"):
        error = row["observed_B_x_error_m"]
        assert isinstance(error, float)
        assert error < 1e-4
        assert row["observed_B_x_uncertainty_m"] < 1e-12  # type: ignore[operator]
        assert len(curves["observed_B_x_error_m"]) == case.run.samples + 1


def test_given_scenes_are_run_at_the_settings_of_the_studys_own() -> None:
    own = [case for case in agreement.cases(False) if case.scene.name == "ideal-free"]
    given = cases_of("agreement", load_study("agreement"), False, [SCENES["ideal-free"]()])
    heads = [{name: value for name, value in case.head().items() if name != CONTENT} for case in given]
    assert heads == [case.head() for case in own]


def test_scenes_of_one_name_and_other_content_have_other_rows() -> None:
    scenes = [mine("ideal-free"), mine("ideal-driven"), SCENES["ideal-free"]()]
    found = [contents(cases_of("agreement", load_study("agreement"), False, [scene])) for scene in scenes]
    assert found[0].keys() == found[1].keys() == {"mine"}
    assert found[0] != found[1]
    assert set(contents(agreement.cases(False)).values()) == {None}


def keep(folder: Path, key: str, content: str | None) -> None:
    with opened(folder, {"e": CODE}, {"mine": content}) as rows:
        more = {} if content is None else {CONTENT: content}
        rows.keep(key, {"engine": "e", "scene": "mine", "status": "ok", **more}, {})


def cases_in(folder: Path) -> list[str]:
    return [str(row["case"]) for row in read_rows(folder / "rows.jsonl")]


def test_rows_of_another_scene_of_that_name_are_set_aside_and_taken_up_again(tmp_path: Path) -> None:
    keep(tmp_path, "first", "aaaaaaaa")
    keep(tmp_path, "second", "bbbbbbbb")
    assert cases_in(tmp_path) == ["second"]
    keep(tmp_path, "own", None)
    assert cases_in(tmp_path) == ["own"]
    with opened(tmp_path, {"e": CODE}, {"mine": "aaaaaaaa"}) as rows:
        assert rows.statuses().keys() == {"first"}
    with opened(tmp_path, {"e": CODE}, {"another": None}) as rows:  # of one name there is never more than one
        assert rows.statuses().keys() == {"first"}


def test_what_theory_says_of_the_studys_own_scenes_is_not_claimed_of_others() -> None:
    row = {
        "case": "1",
        "fingerprint": CODE,
        "scene": "mine",
        "engine": "reference",
        "arm": "none",
        "label": "reference (none)",
        "step_s": 1e-3,
        "end_time_s": 1.0,
        "status": "ok",
        "reason": "",
        "constraint_violation_exponent": 0.3,
        "constraint_speed_exponent": 0.3,
    }
    assert not list(drift(prepared(frame([{**row, CONTENT: "aaaaaaaa"}]))))
    with pytest.raises(Contradiction):
        list(drift(prepared(frame([row]))))

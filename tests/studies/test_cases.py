"""All studies' cases: a label has one meaning in every study, the full set contains the quick one."""

from dataclasses import fields

import pytest

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engines import make_engine
from engine_models.pymunk.engine import PymunkEngine
from studies.case import STUDIES, Case, load_study

#: What a study may add to an arm beside its tolerances: it resolves contacts.
RESOLVING = {"iterations", "steps_per_contact"}
CATALOGUE = [arm for arm in vars(arms).values() if isinstance(arm, Arm)]


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [case for study in STUDIES for case in load_study(study).cases(True)]


def test_a_label_has_one_meaning_in_all_studies_and_what_is_added_to_it_resolves(cases: list[Case]) -> None:
    meanings = {arm.label: arm for arm in CATALOGUE}
    assert len(meanings) == len(CATALOGUE)
    for case in cases:
        assert meanings.setdefault(case.arm.label, case.arm) == case.arm, case.study
        more = set(case.added) - {*case.arm.tolerances, *RESOLVING}
        assert not more, f"{case.study}: {case.arm.label} with {more}"
    swept = meanings.keys() - {arm.label for arm in CATALOGUE}
    assert all("iterations" in label for label in swept), swept


def test_no_scene_of_a_study_shows_one_engine_under_two_labels(cases: list[Case]) -> None:
    labels: dict[tuple[str, str, str], str] = {}
    for case in cases:
        if "iterations" not in case.arm.name:  # one of Pymunk's sweep is the tuned one
            engine = repr(make_engine(case.engine, **case.arm.settings))
            key = case.study, case.scene.name, engine
            assert labels.setdefault(key, case.arm.label) == case.arm.label


@pytest.mark.parametrize("study", STUDIES)
def test_no_case_is_there_twice_and_the_full_set_contains_the_quick_one(study: str) -> None:
    quick, full = ([case.key for case in load_study(study).cases(which)] for which in (False, True))
    assert len(set(quick)) == len(quick)
    assert len(set(full)) == len(full)
    assert set(quick) < set(full)


def test_out_of_the_box_sets_all_that_a_user_who_sets_nothing_has(cases: list[Case]) -> None:
    box = arms.OUT_OF_THE_BOX
    same = {"contact", "shorter_in_contact"}  # are Pymunk's own
    assert {field.name for field in fields(PymunkEngine)} - same == {*box.settings}
    labels = {case.study for case in cases if case.arm == box}
    assert labels == {"accuracy", "cost", "energy", "extremes"}

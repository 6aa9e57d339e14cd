"""A run that is none: its row says whose word that is, the engine's, its adapter's, a check's, a scene's."""

import pytest

from engine_models.engine import Speaker
from studies.extremes import study as extremes
from studies.running.execution import CRASHED, OUT_OF_MEMORY, TIMED_OUT, CaseEnded
from studies.running.outcome import ended, run_case

#: The gallery's first run of each engine, arm and scene.
CASES = {(case.engine, case.arm.name, case.scene.name): case for case in extremes.cases(full=False)[::-1]}


@pytest.mark.parametrize(
    ("engine", "arm", "scene", "speaker", "reason"),
    [
        ("reference", "plain RK4", "L = r through the fold", "engine", "have rank 8 of 9 at"),
        ("exudyn", "default", "rigid e = 0", "adapter", "exudyn has no rigid contact"),
        ("scipy", "default", "rigid e = 0.5", "adapter", "bounces accumulate at t = "),
        ("pymunk", "tuned", "slider mass × 1e-6", "guard", "constraints lost"),
        ("scipy", "default", "rod inertia 0", "scene", "no such scene"),
        ("pymunk", "tuned", "joint A open by 1 mm", "scene", "start: ideal joints or guide are open"),
    ],
)
def test_a_row_without_a_run_says_whose_word_that_is(
    engine: str, arm: str, scene: str, speaker: Speaker, reason: str
) -> None:
    row, _ = run_case(CASES[engine, arm, scene])
    assert row["spoken_by"] == speaker
    assert reason in str(row["reason"])


@pytest.mark.parametrize(
    ("failure", "speaker"),
    [
        (CaseEnded(CRASHED, "killed by SIGSEGV"), "engine"),
        (CaseEnded(TIMED_OUT, "not finished within the limit of 3 s"), "guard"),
        (CaseEnded(OUT_OF_MEMORY, "no memory left"), "guard"),
        (OverflowError("too large"), "guard"),
    ],
)
def test_a_crash_is_the_engines_and_every_limit_is_ours(failure: Exception, speaker: Speaker) -> None:
    assert ended("some status", failure)["spoken_by"] == speaker

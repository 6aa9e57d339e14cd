"""A run that is none: its row has the exception's class, which says who failed."""

import pytest

from studies import extremes
from studies.running.execution import CRASHED, CaseEnded
from studies.running.outcome import ended, run_case

CASES = {(case.engine, case.arm.name, case.scene.name): case for case in extremes.cases(full=True)}


@pytest.mark.parametrize(
    ("engine", "arm", "scene", "exception", "reason"),
    [
        ("reference", "plain RK4", "L = r through the fold", "EngineFailed", "have rank 8 of 9 at"),
        ("exudyn", "default", "rigid e = 0", "UnsupportedScene", "exudyn has no rigid contact"),
        ("scipy", "default", "rigid e = 0.5", "AdapterCannot", "bounces accumulate at t = "),
        ("pymunk", "tuned", "slider mass × 1e-6", "SimulationFailed", "constraints lost"),
        ("pymunk", "tuned", "step at the limit", "SimulationFailed", "pin through the wall"),
        ("scipy", "default", "rod inertia 0", "ImpossibleScene", "no such scene"),
        (
            "pymunk",
            "tuned",
            "joint A open by 1 mm",
            "ImpossibleStart",
            "start: ideal joints or guide",
        ),
    ],
)
def test_a_row_without_a_run_says_who_failed(
    engine: str, arm: str, scene: str, exception: str, reason: str
) -> None:
    row, _ = run_case(CASES[engine, arm, scene])
    assert row["exception"] == exception
    assert reason in str(row["reason"])


def test_a_process_that_ended_is_no_exception_of_an_engine() -> None:
    row = ended(CRASHED, CaseEnded(CRASHED, "killed by SIGSEGV"))
    assert row == {"status": CRASHED, "reason": "killed by SIGSEGV", "exception": "CaseEnded"}

"""The compiled loop of rigid walls: what it leaves to Python."""

import sys
from types import FrameType

import pytest

from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import RIGID_SCENES
from reference_solver.rigid.bouncing import LOG_ROWS
from reference_solver.solution import Solution
from reference_solver.solver import ErrorControl, Solver, StepChoice


def run_with_calls(name: str, end_s: float, choice: StepChoice | ErrorControl) -> tuple[Solution, int]:
    """Return a run and how often Python has called its loop."""
    scene = RIGID_SCENES[name]()
    mechanism, (q, v) = mechanism_of(scene), (part.ravel() for part in start_state(scene))
    solver, calls = Solver(mechanism, q, choice), list[str]()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_name == "_loop":
            calls.append(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        found = solver.run(q, v, end_s, 1)
    finally:
        sys.setprofile(None)
    return found, len(calls)


@pytest.mark.parametrize("choice", [StepChoice(5e-5), ErrorControl(1e-6)], ids=["RK4", "DOP853"])
@pytest.mark.parametrize(
    ("name", "end_s", "impacts"), [("rigid-free-OAB", 0.03, 50), ("rigid-driven-0.5mm", 0.0105, 40)]
)
def test_python_is_asked_only_where_other_pins_follow_from_then_on(
    name: str, end_s: float, impacts: int, choice: StepChoice | ErrorControl
) -> None:
    found, calls = run_with_calls(name, end_s, choice)
    assert impacts < len(found.impacts) < LOG_ROWS, "no more than the log has room for"
    started_at_rest = bool(found.mode_changes) and found.mode_changes[0].time_s == 0
    assert calls == 1 + len(found.mode_changes) - started_at_rest


def test_impacts_are_not_lost_where_their_log_is_full() -> None:
    choice = StepChoice(5e-5)
    found, calls = run_with_calls("rigid-driven-AB", 0.02, choice)
    assert len(found.impacts) > 2 * LOG_ROWS
    assert calls > 1 + len(found.mode_changes)
    lost = sum(impact.energy_lost_J for impact in found.impacts if impact.kind != "closing")
    assert lost == pytest.approx(found.sums["impact0"][-1] + found.sums["impact1"][-1], rel=1e-12)

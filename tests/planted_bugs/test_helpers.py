"""What tests judge by is judged: it takes what is right, and nothing else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from engine_models.scene.scene import Scene
from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.helpers.refusals import require_refusal
from tests.random_scenes import judging
from tests.random_scenes.truths import SAMPLES, truths


@pytest.mark.parametrize(
    ("stdout", "stderr", "code"),
    [
        ("", "error: x: expected y\n", 1),
        ("", "error: x: expected y\n", 0),
        ("1,2\n", "error: x: expected y\n", 2),
        ("", "x: expected y\n", 2),
        ("", "error: x: expected y\nmore\n", 2),
        ("", "error: x\n", 2),
    ],
)
def test_what_is_no_refusal_is_not_taken_for_one(stdout: str, stderr: str, code: int) -> None:
    require_refusal("", "error: x: expected y\n", 2, "expected y")
    with pytest.raises(AssertionError):
        require_refusal(stdout, stderr, code, "expected y")


def test_an_order_is_told_from_one_a_tenth_off() -> None:
    steps = (1.0, 0.5, 0.25)
    for order in (1.0, 3.9, 4.0):
        assert slope(steps, [h**order for h in steps]) == pytest.approx(order)
    assert ORDER_TOLERANCE <= 0.05


@pytest.mark.parametrize(
    ("off", "warnings", "outcome"),
    [(0.5, [], judging.HELD), (1.5, [], judging.BROKEN), (1.5, ["doubt"], judging.WARNED)],
)
def test_a_promise_is_held_by_the_error_alone(
    off: float, warnings: list[str], outcome: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that is off by so many times what is allowed, on a truth that is certain."""
    truth = truths("compliant")[0]
    certain = {tolerance: replace(one, uncertainty_m=0.0) for tolerance, one in truth.judgements.items()}
    positions = {truth.judged_scene(t).end_time_s: one.slider_position_m for t, one in certain.items()}

    def run(_: str, scene: Scene, __: object) -> tuple[object, float, list[str]]:
        position = np.zeros((SAMPLES + 1, 3, 3))
        position[:, -1, 0] = positions[scene.end_time_s] + off * 1e-6
        return SimpleNamespace(position=position, steps=1), 1e-6, warnings

    monkeypatch.setattr(judging, "_run", run)
    found = list(judging.verdicts(replace(truth, judgements=certain), "reference"))
    assert found
    assert {one.outcome for one in found} == {outcome}

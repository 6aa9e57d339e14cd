"""A run of the reference that shorter steps change warns of it, and one held to a tolerance does not."""

import pytest

from engine_models.convergence.doubts import doubts
from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES

#: Through set R's first impacts at steps of three degrees, past which a hundredth of the clearance is lost.
SCENE = SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 0.036})
COARSE = RunSettings(1e-4, 360)


def test_a_slider_that_shorter_steps_move_is_in_doubt_from_a_time_on() -> None:
    engine = ReferenceEngine(steps_per_contact=20.0)
    run = engine.simulate(SCENE, COARSE)
    (line,) = doubts(engine, SCENE, run, to_tolerance=False)
    assert line.startswith("slider position in doubt by 1 % of the smallest clearance or more from t = 0.0")
    assert doubts(engine, SCENE, run, to_tolerance=True) == []


def test_a_slider_that_they_leave_where_it_is_is_not() -> None:
    short = SCENE.model_copy(update={"end_time_s": 0.002})
    engine, settings = ReferenceEngine(), RunSettings(1e-5, 20)
    assert doubts(engine, short, engine.simulate(short, settings), to_tolerance=False) == []


@pytest.mark.parametrize(
    ("engine", "lines"),
    [
        (ReferenceEngine(step_tolerance=1e-6), ["step_tolerance changes nothing with method = rk4"]),
        (ReferenceEngine(method="dop853", step_tolerance=1e-6), []),
        (
            ReferenceEngine(method="dop853", steps_per_contact=50.0),
            ["steps_per_contact changes nothing with method = dop853"],
        ),
        (
            ReferenceEngine(baumgarte_alpha_s=50.0),
            ["baumgarte_alpha_s changes nothing with stabilisation = projection"],
        ),
        (ReferenceEngine(stabilisation="baumgarte", baumgarte_alpha_s=50.0), []),
    ],
    ids=["tolerance", "used tolerance", "steps per contact", "feedback", "used feedback"],
)
def test_a_setting_that_changes_nothing_is_told(engine: ReferenceEngine, lines: list[str]) -> None:
    short = SCENE.model_copy(update={"end_time_s": 0.001})
    run = engine.simulate(short, RunSettings(1e-5, 10))
    assert doubts(engine, short, run, to_tolerance=False) == lines

"""The study of accuracy: what their rows say of runs whose errors are known."""

import pytest

from engine_models.arms import Arm
from engine_models.engine import RunSettings
from engine_models.mechanics.start import start_state
from engine_models.scene.library import CLEARANCE_SCENES
from engine_models.scene.scene import Scene
from studies import accuracy, cost, settings
from studies.case import Case, run_case
from studies.judges.converged_truth import REFERENCE, truth_by
from tests.helpers.starts import started_from

#: The first two impacts of set R and some flight.
END_S, SAMPLES = 0.0007, 28


@pytest.fixture(scope="module")
def scene() -> Scene:
    return CLEARANCE_SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": END_S})


def case(scene: Scene, engine: str, step_s: float, **given: float | str | bool) -> Case:
    return Case("accuracy", scene, Arm(engine, "arm", given), RunSettings(step_s, SAMPLES))


def test_what_has_no_independent_solution_is_told_to_be_the_references(scene: Scene) -> None:
    """Its pin stands in the rigid wall as the run begins."""
    assert scene.clearance["B"] is not None
    unset = {"law": "rigid", "young_modulus_Pa": None, "poisson_ratio": None}
    walled = {"B": scene.clearance["B"].model_copy(update=unset)}
    position, velocity = start_state(scene)
    position[2, 0] += scene.clearance["B"].radial_clearance_m * (1 + 1e-15)
    begun = started_from(scene.model_copy(update={"clearance": walled}), position, velocity)
    assert truth_by(begun, SAMPLES) == REFERENCE


def test_an_engine_with_a_law_of_its_own_is_judged_by_that_law(scene: Scene) -> None:
    row, _ = run_case(case(scene, "pymunk", 1e-6, contact="rigid"))
    form, error = row["slider_position_model_difference_m"], row["slider_position_error_m"]
    assert isinstance(form, float)
    assert isinstance(error, float)
    assert error < form / 4, f"numerical {error:.1e} m, model form {form:.1e} m"


def test_a_timed_run_takes_the_steps_and_settings_of_a_recorded_one() -> None:
    recorded, timed = (
        {(c.scene.name, c.engine, c.arm, c.run.step_used_s(c.scene.end_time_s), str(c.added)) for c in cases}
        for cases in (
            [case for case in accuracy.cases(False) if "view" not in case.columns],
            cost.cases(False),
        )
    )
    assert timed == recorded


def test_settings_are_of_every_engine_and_on_rigid_scenes_only_of_those_that_know_rigid_walls() -> None:
    engines = {"reference", "exudyn", "pymunk", "scipy"}
    for scene in (CLEARANCE_SCENES["clearance-pendulum"](), settings.scenes(False)[0]):
        quick, every = ({str(each) for each in settings.ladder(scene, full)} for full in (False, True))
        assert quick < every
        assert {setting.arm.engine for setting in settings.ladder(scene, full=False)} == engines
    rigid = settings.scenes(True)[-1]
    assert {setting.arm.engine for setting in settings.ladder(rigid, full=True)} == engines - {"exudyn"}

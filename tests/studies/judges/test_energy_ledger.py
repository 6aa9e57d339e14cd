"""The energy ledger on planted bugs: what is forgotten or added shows with its sign and size."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.library import SCENES, ideal_torque
from engine_models.scene.scene import Scene
from studies.judges.energy_ledger import dissipated, stored
from studies.judges.metrics import energy_balance_residual_J, numerical_gain_J
from tests.helpers.ideal_crank_slider import exact


@pytest.fixture(scope="module")
def rubbing() -> tuple[Scene, Trajectory]:
    """A turn with friction in a joint with clearance: every line of the ledger but stabilisation."""
    scene = SCENES["clearance-driven-damped"]().model_copy(update={"end_time_s": 0.012})
    return scene, PymunkEngine().simulate(scene, RunSettings(1e-5, 120))


def test_a_loss_that_is_not_counted_looks_like_loss_of_that_size(rubbing: tuple[Scene, Trajectory]) -> None:
    scene, run = rubbing
    contact = run.contacts["B"]
    for line in ("normal_loss_J", "friction_loss_J"):
        lost, forgotten = getattr(contact, line), dict[str, Any]({line: np.zeros(len(run.time_s))})
        assert lost[-1] > 1e-3
        without = replace(run, contacts={"B": replace(contact, **forgotten)})
        assert numerical_gain_J(scene, without) - numerical_gain_J(scene, run) == pytest.approx(-lost)


def test_a_driver_that_is_not_counted_looks_like_gain_and_what_stabilisation_removes_is_no_loss() -> None:
    scene = ideal_torque()
    truth = exact(scene, 50)
    assert truth.driver_work_J is not None
    assert numerical_gain_J(scene, replace(truth, driver_work_J=None)) == pytest.approx(truth.driver_work_J)
    removed = 1e-3 * truth.time_s
    run = replace(truth, stabilisation_loss_J=removed)
    assert energy_balance_residual_J(scene, run) - numerical_gain_J(scene, run) == pytest.approx(removed)


def test_the_lines_add_up_to_the_residual_of_the_metrics(rubbing: tuple[Scene, Trajectory]) -> None:
    scene, run = rubbing
    assert run.driver_work_J is not None
    total = sum(stored(scene, run).values()) - run.driver_work_J + sum(dissipated(run).values())
    assert total == pytest.approx(energy_balance_residual_J(scene, run), abs=1e-12)

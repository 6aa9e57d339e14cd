"""What is planted in a run is seen in the right columns, though equal samples miss every impact."""

from dataclasses import replace

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.scene.library import SCENES
from studies.accuracy import impacts_of
from studies.case import Row
from studies.judges.comparison import compared, judged
from tests.helpers.altered import Altered
from tests.helpers.arrays import joint_forces

#: Four impacts, and the samples of the accuracy study.
SCENE = SCENES["clearance-free-0.5mm"]().model_copy(update={"end_time_s": 0.012})
ASKED = RunSettings(SCENE.end_time_s, 24)
EXACT = Altered(lambda run: run, sharp=True)
STRONGER = 1.02


def stronger(run: Trajectory) -> Trajectory:
    """Forces in contacts, and there alone, are 2 % too large."""
    contact = run.contacts["B"]
    factor = np.where(contact.penetration_m > 0, STRONGER, 1.0)
    impacts = replace(
        contact.impacts, largest_normal_force_N=STRONGER * contact.impacts.largest_normal_force_N
    )
    wrong = replace(contact, normal_force_N=factor * contact.normal_force_N, impacts=impacts)
    forces = {**run.joint_force_N, "B": factor[:, None] * run.joint_force_N["B"]}
    return replace(run, joint_force_N=forces, contacts={"B": wrong})


def row_of(engine: Altered) -> Row:
    found = judged(engine, SCENE, ASKED)
    row, _ = compared(found)
    return row | impacts_of(found)


def number(row: Row, column: str) -> float:
    return float(str(row[column]))


def test_a_force_that_is_wrong_in_contacts_alone_is_seen_in_forces_alone() -> None:
    """The largest normal force is known by samples of 100 ns."""
    strongest_N = EXACT.simulate(SCENE, RunSettings(1.0, 100_000)).contacts["B"].normal_force_N.max()
    right, row, off_N = row_of(EXACT), row_of(Altered(stronger, sharp=True)), (STRONGER - 1) * strongest_N
    for column in (
        "joint_B_force_error_N",
        "contact_B_normal_force_error_N",
        "impact_force_in_phase_error_N",
    ):
        assert number(row, column) == pytest.approx(off_N, rel=2e-3), column
    for column in ("impact_force_error_N", "largest_contact_force_error_N"):
        assert number(right, column) < 1e-5 * strongest_N, column
        assert number(row, column) == pytest.approx(off_N, rel=1e-4), column
    assert number(row, "impact_force_relative_error") == pytest.approx(STRONGER - 1, rel=1e-3)
    same = ("slider_position_error_m", "joint_A_force_error_N", "impact_time_error_s")
    assert {name: row[name] for name in same} == {name: right[name] for name in same}
    true = EXACT.simulate(SCENE, ASKED)
    off = joint_forces(stronger(true)) - joint_forces(true)
    assert np.abs(off).max() < 1.0, "equal samples do not see it"

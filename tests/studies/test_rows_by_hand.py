"""What studies write into rows, run again and resume, against what was worked out by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engine_models import arms
from engine_models.engine import Impacts, RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import ideal_driven
from studies import accuracy, energy
from studies.case import Case


def test_of_all_joints_impacts_are_counted_together_and_the_worst_error_counts() -> None:
    def joint(strongest_N: float, *times: float) -> SimpleNamespace:
        at = np.array(times)
        told = Impacts(at, 0.1 * at**0, at**0, at**0, at**0, strongest_N * at**0, at, at**0, at)
        return SimpleNamespace(impacts=told, normal_force_N=np.array([0.0, 2.0]))

    def moving(**joints: SimpleNamespace) -> Any:
        return SimpleNamespace(contacts=joints, time_s=np.array([0.0, 3.9]))

    truth = moving(A=joint(8.0, 1.0, 2.0), B=joint(5.0, 1.5, 3.5))
    run = moving(A=joint(8.5, 1.001, 2.0), B=joint(6.0, 1.53))
    doubt = moving(A=joint(8.01, 1.0, 2.0), B=joint(5.0, 1.5, 3.501))
    solved = (truth, (doubt,), "independent")
    found: Any = SimpleNamespace(run=run, solved=solved, compared_until_s=4.0)
    row = accuracy.impacts_of(found)
    assert (row["impacts_matched"], row["impacts_unmatched"], row["impacts_missed"]) == (3, 0, 1)
    assert row["impact_time_error_s"] == pytest.approx(0.03)
    assert row["impact_time_uncertainty_s"] == pytest.approx(0.006), "six times the distance"
    assert row["impact_force_error_N"] == pytest.approx(1.0)
    assert row["impact_force_relative_error"] == pytest.approx(1.0), "one is missed"
    assert row["impact_force_uncertainty_N"] == pytest.approx(0.06)
    assert row["impact_force_relative_uncertainty"] == pytest.approx(0.06 / 8)
    assert row["largest_contact_force_error_N"] == pytest.approx(0.5)


def test_an_energy_row_has_what_the_run_gained_with_its_signs() -> None:
    """Projection after steps of seven degrees, which takes some energy, on two revolutions."""
    run, scene = RunSettings(2.5e-4, 24), ideal_driven()
    case = Case("energy", scene, arms.PROJECTION, run, columns={"rung": 0})
    row, _ = energy.measure(case)
    motion = make_engine("reference", stabilisation="projection").simulate(scene, run)
    masses = np.array([[0.30, 0.30, 1e-4], [0.21, 0.21, 2.5e-4], [0.14, 0.14, 1e-4]])
    energies = np.sum(masses * motion.velocity**2, axis=(1, 2)) / 2
    energies += 9.81 * motion.position[..., 1] @ masses[:, 0]
    assert motion.driver_work_J is not None
    assert motion.stabilisation_loss_J is not None
    gained = energies[-1] - energies[0] - float(motion.driver_work_J[-1])
    assert row["turns"] == pytest.approx(2.0)
    assert row["mean_hidden_power_W"] == pytest.approx(gained / 0.024, rel=1e-6, abs=1e-10)
    removed = float(motion.stabilisation_loss_J[-1])
    assert removed > 1e-5
    assert row["stabilisation_power_W"] == pytest.approx(-removed / 0.024)

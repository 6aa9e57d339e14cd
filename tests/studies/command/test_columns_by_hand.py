"""Columns that ``simulate`` writes, against the numbers of two states put down here."""

from dataclasses import replace

import numpy as np
import pytest

from engine_models.engine import Contact, FloatArray, Impacts, Trajectory
from engine_models.scene.library import SCENES
from studies.judges.columns import impact_columns, sample_columns

#: Masses and inertias of set R: crank, rod, slider; and gravity; the lengths of crank and rod.
MASS_KG, INERTIA_KG_M2, GRAVITY_M_S2 = (0.30, 0.21, 0.14), (1e-4, 2.5e-4, 1e-4), 9.81
NONE = np.zeros(2)
CRANK_M, ROD_M = 0.05, 0.12
#: From the centre of bearing B to its pin at two times.
GAP_M = np.array([[3e-4, 4e-4], [-1e-4, 2e-4]])


def impacts(*times: float) -> Impacts:
    at = np.array(times)
    return Impacts(at, at / 10, *(at * k for k in range(2, 9)))


def contact() -> Contact:
    return Contact(
        gap_m=GAP_M,
        penetration_m=np.array([0.0, -2.8e-4]),
        normal_force_N=np.array([70.0, 0.0]),
        friction_force_N=np.array([7.0, 0.0]),
        elastic_energy_J=np.array([0.5, 0.0]),
        normal_impulse_N_s=NONE,
        normal_loss_J=np.array([0.0, 0.01]),
        friction_loss_J=np.array([0.0, 0.02]),
        clipped_loss_J=np.array([0.0, 0.04]),
        impacts=impacts(),
    )


def position(gap_m: FloatArray) -> FloatArray:
    """Return two states (2, 3, 3) with joints O and A closed, and such a gap at B; angles are 3, 6, ..."""
    crank, rod, slider = np.array([[3.0, 12.0], [6.0, 15.0], [9.0, 18.0]])
    pin_A = CRANK_M * np.stack([np.cos(crank), np.sin(crank)], axis=1)
    to_B = ROD_M * np.stack([np.cos(rod), np.sin(rod)], axis=1)
    centres = pin_A / 2, pin_A + to_B / 2, pin_A + to_B + gap_m
    return np.dstack([np.stack(centres, axis=1), np.stack([crank, rod, slider], axis=1)])


def run(gap_m: FloatArray = GAP_M) -> Trajectory:
    """Two states with a different number in every place."""
    return Trajectory(
        time_s=np.array([0.0, 1.0]),
        position=position(gap_m),
        velocity=np.arange(21.0, 39.0).reshape(2, 3, 3),
        joint_force_N=dict(zip("OAB", np.arange(41.0, 53.0).reshape(2, 3, 2).swapaxes(0, 1), strict=True)),
        guide_force_N={"guide": np.array([61.0, 62.0])},
        guide_moment_N_m={"guide": np.array([65.0, 66.0])},
        driver_torque_N_m=np.array([63.0, 64.0]),
        driver_work_J=np.array([0.0, 5.0]),
        step_s=0.5,
        steps=2,
        solve_time_s=1.0,
        contacts={"B": contact()},
    )


def energies_J(sample: int) -> tuple[float, float]:
    """Return kinetic and potential energy of a state by plain sums."""
    kinetic = potential = 0.0
    for body in range(3):
        x, y, turn = (21.0 + 9 * sample + 3 * body + k for k in range(3))
        kinetic += MASS_KG[body] * (x * x + y * y) / 2 + INERTIA_KG_M2[body] * turn * turn / 2
        potential += MASS_KG[body] * GRAVITY_M_S2 * position(GAP_M)[sample, body, 1]
    return kinetic, potential + (0.5, 0.0)[sample]


def test_every_column_has_its_name_its_place_and_its_number() -> None:
    columns = sample_columns(SCENES["clearance-driven-damped"](), run())
    (kinetic_0, potential_0), (kinetic_1, potential_1) = energies_J(0), energies_J(1)
    x_0, x_1 = position(GAP_M)[:, 2, 0].tolist()
    expected = {
        "time_s": (0.0, 1.0),
        "crank_angle_rad": (3.0, 12.0),
        "crank_speed_rad_s": (23.0, 32.0),
        "slider_position_m": (x_0, x_1),
        "slider_velocity_m_s": (27.0, 36.0),
        "joint_O_force_x_N": (41.0, 47.0),
        "joint_O_force_y_N": (42.0, 48.0),
        "joint_A_force_x_N": (43.0, 49.0),
        "joint_A_force_y_N": (44.0, 50.0),
        "joint_B_force_x_N": (45.0, 51.0),
        "joint_B_force_y_N": (46.0, 52.0),
        "guide_normal_force_N": (61.0, 62.0),
        "driver_torque_N_m": (63.0, 64.0),
        "kinetic_energy_J": (kinetic_0, kinetic_1),
        "potential_energy_J": (potential_0, potential_1),
        # What was gained, less the driver's work, and what contacts have lost by three ways.
        "energy_balance_residual_J": (
            0.0,
            kinetic_1 + potential_1 - kinetic_0 - potential_0 - 5.0 + 0.01 + 0.02 + 0.04,
        ),
        "clearance_B_x_m": (3e-4, -1e-4),
        "clearance_B_y_m": (4e-4, 2e-4),
        "contact_B_penetration_m": (0.0, -2.8e-4),
        "contact_B_normal_force_N": (70.0, 0.0),
        "contact_B_friction_force_N": (7.0, 0.0),
        "dissipated_energy_J": (0.0, 0.07),
        "slider_acceleration_m_s2": (45.0 / 0.14, 51.0 / 0.14),  # by joint B alone
        "rod_angle_rad": (6.0, 15.0),
        "rod_speed_rad_s": (26.0, 35.0),
        # Joint O is at the origin, the guide pushes at the slider's pin.
        "ground_force_x_N": (-41.0, -47.0),
        "ground_force_y_N": (-42.0 - 61.0, -48.0 - 62.0),
        "ground_moment_N_m": (-x_0 * 61.0 - 65.0 - 63.0, -x_1 * 62.0 - 66.0 - 64.0),
    }
    assert list(columns) == list(expected)
    for name, values in expected.items():
        np.testing.assert_allclose(columns[name], values, rtol=1e-13, atol=1e-13, err_msg=name)


def test_a_load_moves_the_slider_along_its_guide_and_pushes_back_on_the_ground() -> None:
    """A force of -3 N and a damper of 2 N s/m, in a guide that rises by 3 in 5, 0.02 m off joint O."""
    scene = SCENES["ideal-driven"]().replace(
        {
            "slider.guide_angle_rad": np.arctan2(3.0, 4.0),
            "slider.guide_offset_m": 0.02,
            "load.slider": {"force_N": -3.0, "viscous_N_s_m": 2.0},
        }
    )
    columns = sample_columns(scene, replace(run(np.zeros((2, 2))), contacts={}))
    x, y, _ = position(np.zeros((2, 2)))[1, 2]
    load = -3.0 - 2.0 * (0.8 * 36.0 + 0.6 * 37.0)
    # The guide's force on the slider, 62 N, is along (-0.6, 0.8), the load's along (0.8, 0.6).
    fx, fy = 0.6 * 62.0 - 0.8 * load, -0.8 * 62.0 - 0.6 * load
    expected = {
        "slider_acceleration_m_s2": (0.8 * 51.0 + 0.6 * 52.0 + load) / 0.14 - 0.6 * 9.81,
        "ground_force_x_N": fx - 47.0,
        "ground_force_y_N": fy - 48.0,
        "ground_moment_N_m": x * fy - y * fx - 66.0 - 64.0,
    }
    assert {name: columns[name][1] for name in expected} == pytest.approx(expected)


def test_impacts_of_all_joints_are_in_the_order_of_time() -> None:
    joints = {"A": impacts(1.0, 4.0), "B": impacts(2.0, 3.0)}
    columns = impact_columns({name: replace(contact(), impacts=each) for name, each in joints.items()})
    assert columns.pop("joint").tolist() == ["A", "B", "B", "A"]
    names = ["time_s", "duration_s", "approach_speed_m_s", "normal_impulse_N_s", "energy_lost_J"]
    names += ["largest_normal_force_N", "largest_normal_force_time_s"]
    names += ["largest_penetration_m", "largest_penetration_time_s"]
    factors = [1.0, 0.1, *range(2, 9)]
    assert {name: column.tolist() for name, column in columns.items()} == {
        name: pytest.approx([k * at for at in (1.0, 2.0, 3.0, 4.0)])
        for name, k in zip(names, factors, strict=True)
    }
    wall = replace(impacts(2.0), largest_normal_force_N=np.array([np.nan]))
    assert "largest_normal_force_N" not in impact_columns({"A": replace(contact(), impacts=wall)})

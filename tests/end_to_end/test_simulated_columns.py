"""Every column that ``crankslider simulate`` writes, held to Newton's laws worked out here on plain numbers.

A driven crank turns at constant speed, so all accelerations have a closed form; links' masses, lengths and
centres of mass are all different and lie off the middle, so that no two columns are alike.
"""

import csv
import math
from pathlib import Path

import pytest

from tests.helpers.command import crankslider

SCENE = """
name = "by-hand"
end_time_s = 0.05
gravity_m_s2 = 9.81
[crank]
length_m = 0.04
mass_kg = 0.5
inertia_kg_m2 = 2e-4
centre_of_mass_m = 0.01
[rod]
length_m = 0.13
mass_kg = 0.3
inertia_kg_m2 = 6e-4
centre_of_mass_m = 0.05
[slider]
mass_kg = 0.2
inertia_kg_m2 = 1e-4
[start]
crank_angle_rad = 0.3
crank_speed_rad_s = 60.0
[drive]
kind = "constant-speed"
"""
RESIDUAL = "energy_balance_residual_J"
STEP_S, SAMPLES = 1e-5, 10
#: Parts of a column's largest size. The reference by RK4 and SciPy are at 1e-9 and less; Exudyn's default is
#: of second order with 5e-6 measured, and Pymunk's leap-frog has forces averaged over a step, 1e-3.
WITHIN = {"reference": 1e-8, "scipy": 1e-8, "exudyn": 1e-3, "pymunk": 1e-2}
#: What closes for an exact run, as a part of the kinetic energy.
BALANCE = 0.01


def by_hand(t: float) -> dict[str, float]:
    """Return the columns at a time: kinematics of the linkage, then Newton and Euler, slider first."""
    r, m1, s = 0.04, 0.5, 0.01
    rod, m2, i2, d = 0.13, 0.3, 6e-4, 0.05
    m3, i1, g, w = 0.2, 2e-4, 9.81, 60.0
    theta = 0.3 + w * t
    phi = -math.asin(r / rod * math.sin(theta))
    p1 = -r * w * math.cos(theta) / (rod * math.cos(phi))
    p2 = (r * w**2 * math.sin(theta) + rod * p1**2 * math.sin(phi)) / (rod * math.cos(phi))
    x3 = r * math.cos(theta) + rod * math.cos(phi)
    v3 = -r * w * math.sin(theta) - rod * p1 * math.sin(phi)
    a3 = -r * w**2 * math.cos(theta) - rod * (p2 * math.sin(phi) + p1**2 * math.cos(phi))
    v2x = -r * w * math.sin(theta) - d * p1 * math.sin(phi)
    v2y = r * w * math.cos(theta) + d * p1 * math.cos(phi)
    a2x = -r * w**2 * math.cos(theta) - d * (p2 * math.sin(phi) + p1**2 * math.cos(phi))
    a2y = -r * w**2 * math.sin(theta) + d * (p2 * math.cos(phi) - p1**2 * math.sin(phi))
    bx = m3 * a3
    ax = m2 * a2x + bx
    # Moments on the rod about its centre of mass, with Ay = By + lift.
    lift = m2 * (a2y + g)
    across = d * math.sin(phi) * ax + (rod - d) * math.sin(phi) * bx
    by = (across - d * math.cos(phi) * lift - i2 * p2) / (rod * math.cos(phi))
    ay = by + lift
    ox = ax - m1 * s * w**2 * math.cos(theta)
    oy = ay + m1 * g - m1 * s * w**2 * math.sin(theta)
    guide = m3 * g - by
    torque = r * (math.cos(theta) * ay - math.sin(theta) * ax) + m1 * g * s * math.cos(theta)
    return {
        "time_s": t,
        "crank_angle_rad": theta,
        "crank_speed_rad_s": w,
        "slider_position_m": x3,
        "slider_velocity_m_s": v3,
        "joint_O_force_x_N": ox,
        "joint_O_force_y_N": oy,
        "joint_A_force_x_N": ax,
        "joint_A_force_y_N": ay,
        "joint_B_force_x_N": bx,
        "joint_B_force_y_N": by,
        "guide_normal_force_N": guide,
        "driver_torque_N_m": torque,
        "kinetic_energy_J": ((i1 + m1 * s**2) * w**2 + m2 * (v2x**2 + v2y**2) + i2 * p1**2 + m3 * v3**2) / 2,
        "potential_energy_J": g * (m1 * s * math.sin(theta) + m2 * (r * math.sin(theta) + d * math.sin(phi))),
        "slider_acceleration_m_s2": a3,
        "rod_angle_rad": phi,
        "rod_speed_rad_s": p1,
        "ground_force_x_N": -ox,
        "ground_force_y_N": -oy - guide,
        "ground_moment_N_m": -x3 * guide - torque,
    }


def written(folder: Path, scene: str, *options: object) -> list[dict[str, str]]:
    """Return the lines of the CSV that ``simulate`` writes."""
    (folder / "scene.toml").write_text(scene, encoding="utf-8")
    out = folder / "run.csv"
    done = crankslider("simulate", folder / "scene.toml", "--samples", SAMPLES, "--out", out, *options)
    assert done.code == 0, done.stderr
    with out.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("engine", WITHIN)
def test_every_column_is_what_newton_says(engine: str, tmp_path: Path) -> None:
    lines = written(tmp_path, SCENE, "--engine", engine, "--step", STEP_S)
    assert len(lines) == SAMPLES + 1
    expected = [by_hand(0.05 * k / SAMPLES) for k in range(SAMPLES + 1)]
    own = list(expected[0])
    own.insert(own.index("potential_energy_J") + 1, RESIDUAL)
    assert list(lines[0]) == own
    for column in expected[0]:
        scale = max(abs(line[column]) for line in expected)
        off = max(
            abs(float(line[column]) - right[column]) for line, right in zip(lines, expected, strict=True)
        )
        assert off <= WITHIN[engine] * scale, f"{column}: off by {off / scale:.1e} of its largest size"
    largest = max(line["kinetic_energy_J"] for line in expected)
    assert max(abs(float(line[RESIDUAL])) for line in lines) <= BALANCE * largest

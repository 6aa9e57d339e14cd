"""Tables as a user has them: straight lines or splines, their ends, the forces that they apply, warnings."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import crankslider as cs
from engine_models.scene.file import from_toml
from tests.input.scenes import base

PRESS = from_toml(base("press"))
R, L = PRESS.short.crank.length_m, 0.356
#: The ram of the press is pushed back by 1000 N between 150 and 210 degrees.
DEGREES = np.arange(0, 361, 10)
ANGLE, FORCE = np.radians(DEGREES), np.where((DEGREES >= 150) & (DEGREES <= 210), -1000.0, 0.0)
GAS = {"crank_angle_rad": ANGLE, "force_N": FORCE, "interpolation": "linear"}
PRESSED = PRESS.replace("load", {"slider": {"gas": GAS}})


def test_every_part_of_the_load_is_a_column_of_its_force() -> None:
    load = {"force_N": -20.0, "viscous_N_s_m": 3.0, "spring_N_m": 2000.0, "free_position_m": 0.12}
    changes = {"load": {"slider": load | {"gas": GAS}}, "drive": {"kind": "free"}}
    frame = cs.simulate(PRESS.replace(changes), end=0.01, samples=20).frame
    expected = {
        "force": np.full(21, -20.0),
        "viscous": -3.0 * frame["slider_velocity_m_s"],
        "spring": -2000.0 * (frame["slider_position_m"] - 0.12),
        "gas": np.interp(frame["crank_angle_rad"], ANGLE, FORCE, period=2 * math.pi),
    }
    columns = [column for column in frame if column.startswith("slider_") and column.endswith("_force_N")]
    assert columns == [f"slider_{part}_force_N" for part in expected]
    for part, force in expected.items():
        np.testing.assert_allclose(frame[f"slider_{part}_force_N"], force, rtol=0, atol=1e-9)


def test_a_spline_beyond_its_table_is_told_by_name_amount_and_angle() -> None:
    with pytest.warns(UserWarning, match="load.slider.gas: the spline goes from -1107") as told:
        cs.simulate(PRESSED.replace("load.slider.gas.interpolation", "spline"), samples=10)
    angle = np.linspace(0.0, 2 * math.pi, 100_001)
    spline, line = CubicSpline(ANGLE, FORCE, bc_type="periodic")(angle), str(told[0].message)
    assert line.startswith(
        f"load.slider.gas: the spline goes from {spline.min():.6g} to {spline.max():.6g} N"
    )
    assert f"{spline.max() / 10:.3g} % of that range beyond at " in line
    where = angle[[spline.argmin(), spline.argmax()]]
    assert float(line.split(" beyond at ")[1].split()[0]) == pytest.approx(where, abs=1.3)
    assert line.endswith('interpolation = "linear" keeps to them')
    assert cs.simulate(PRESSED, end=0.01, samples=10).warnings == (), "which is not warned of"

"""Numbers as text with a unit: what it means, in files, options and the library."""

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import crankslider as cs
from engine_models.scene.format import Clearance
from engine_models.scene.library import SCENES
from engine_models.scene.units import in_own_units, unit_of
from tests.helpers.command import crankslider

#: The library's scene of most fields, and the same quantities as text.
FREE = SCENES["ideal-free"]()
#: Fields with what is typed, and the number by definition of the unit: exact, as all are within one rounding.
TYPED: dict[str, list[tuple[Any, Any]]] = {
    "length_m": [
        ("50 mm", 0.05),
        ("50mm", 0.05),
        ("1.1 mm", 0.0011),
        ("5e1 mm", 0.05),
        ("0.2 um", 2e-7),
        ("0.2 µm", 2e-7),
    ],
    "free_position_m": [("-1 in", -0.0254), ("1 ft", 0.3048), ("+.5 m", 0.5), ("12 cm", 0.12)],
    "mass_kg": [("300 g", 0.3), ("0.3 kg", 0.3), ("1 lb", 0.45359237), ("0.002 t", 2.0)],
    "inertia_kg_m2": [("3 kg cm^2", 3e-4), ("3 kg·cm²", 3e-4), ("3 kg*cm**2", 3e-4), ("3 N m s^2", 3.0)],
    "end_time_s": [("24 ms", 0.024), ("2 min", 120.0), ("1 h", 3600.0)],
    "gravity_m_s2": [("1 g_0", 9.80665), ("981 cm/s^2", 9.81), ("9.81 N/kg", 9.81)],
    "regularisation_speed_m_s": [("1 mm/s", 1e-3), ("36 km/h", 10.0)],
    "crank_angle_rad": [("180 deg", math.pi), ("90°", math.pi / 2), ("-0.5 turn", -math.pi)],
    "crank_speed_rad_s": [("1500 rpm", 50 * math.pi), ("25 rev/s", 50 * math.pi), ("9 deg/ms", 50 * math.pi)],
    "frequency_Hz": [("2 kHz", 2000.0), ("30 1/min", 0.5), ("120 min^-1", 2.0)],
    "force_N": [("-1 kN", -1000.0), ("1 lbf", 4.4482216152605), ("1 bar cm^2", 10.0)],
    "torque_N_m": [("5 Nm", 5.0), ("5 N mm", 0.005), ("2 J", 2.0), ("1 kNm", 1000.0)],
    "spring_N_m": [("2 N/mm", 2000.0), ("2 kN/m", 2000.0)],
    "viscous_N_s_m": [("3 N s/m", 3.0), ("3 kg/s", 3.0), ("3 N/(mm/s)", 3000.0)],
    "young_modulus_Pa": [("207 GPa", 2.07e11), ("1 N/mm^2", 1e6), ("1 psi", 6894.757293168362)],
    "end_slopes": [(["60 rpm", 1.5], [2 * math.pi, 1.5])],
}


@pytest.mark.parametrize("field", TYPED)
def test_text_with_a_unit_is_the_number_in_the_units_of_its_field(field: str) -> None:
    for text, number in TYPED[field]:
        assert in_own_units({field: text})[field] == number, text


@given(st.text(alphabet="0123456789.+-e mkgsNradHz*/^()°µ", max_size=14))
def test_no_text_breaks_the_reading(text: str) -> None:
    value = in_own_units({"length_m": text})["length_m"]
    assert value == text or math.isfinite(value)


def numeric_fields() -> list[str]:
    parts = [cs.Scene.model_json_schema(), *cs.Scene.model_json_schema()["$defs"].values()]
    fields = [(name, str(field)) for part in parts for name, field in part["properties"].items()]
    return sorted({name for name, text in fields if "'number'" in text})


def test_every_numeric_field_has_a_unit_but_those_that_are_ratios() -> None:
    without = [name for name in numeric_fields() if unit_of(name) is None]
    assert without == ["coefficient", "exponent", "poisson_ratio", "restitution"]


@pytest.mark.parametrize(
    ("exponent", "typed", "expected"),
    [(None, "2 N/mm^1.5", 2 * 1e3**1.5), (2.0, "2 N/mm^2", 2e6), (1.0, "2 kN/mm", 2e6)],
)
def test_a_stiffness_has_the_unit_of_its_exponent(
    exponent: float | None, typed: str, expected: float
) -> None:
    wall = {"radial_clearance_m": "0.5 mm", "bearing_radius_m": "10 mm", "law": "hertz"}
    clearance = Clearance.checked({**wall, "stiffness": typed, "exponent": exponent})
    assert clearance.stiffness == pytest.approx(expected, rel=1e-15)


def test_files_options_and_the_library_take_units(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(FREE.to_toml().replace("length_m = 0.05", 'length_m = "50 mm"'))
    assert cs.load(file) == FREE
    assert FREE.replace("crank.length_m", "60 mm") == FREE.replace("crank.length_m", 0.06)
    assert FREE.short.crank.model_copy(update={"mass_kg": "1 lb"}).mass_kg == 0.45359237
    short = ("--end", 0.001, "--samples", 1, "--quiet")
    by_text = crankslider("simulate", file, "--with", "start.crank_speed_rad_s=1500 rpm", *short)
    by_number = crankslider("simulate", file, "--with", f"start.crank_speed_rad_s={50 * math.pi!r}", *short)
    assert (by_text.code, by_text.stderr) == (0, "")
    assert by_text.stdout == by_number.stdout

"""The library does what the command line does."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import crankslider as cs
from tests.helpers.command import crankslider, table_of

LOOSE: Any = cs.scenes["clearance-driven-0.5mm"]
THROUGH_ZERO = """
name = "through-zero"
end_time_s = 1.0
observe = "rail.along"
[ground]
pins_m = { O = [0.0, 0.0] }
[body.cart]
pins_m = { S = 0.0 }
mass_kg = 1.0
inertia_kg_m2 = 1.0
[guide.rail]
body = "cart"
pin = "S"
[spring.s]
between = ["ground.O", "cart.S"]
stiffness_N_m = 10.0
free_length_m = 0.5
[start]
position_m = { rail = 0.3 }
speed_m_s = { rail = -2.0 }
[drive]
kind = "free"
"""


def short_run(scene: cs.Scene | str | Path) -> cs.Run:
    return cs.simulate(scene, end=0.002, samples=20)


@pytest.fixture(scope="module")
def loose_run() -> cs.Run:
    return short_run(LOOSE)


@pytest.mark.parametrize("scene", ["ideal-driven", "clearance-driven-0.5mm", "rigid-pendulum"])
def test_a_frame_is_the_table_of_the_command_line_over_time(scene: str) -> None:
    written = crankslider("simulate", scene, "--end", 0.002, "--samples", 20).stdout
    expected = table_of(written).set_index("time_s")
    pd.testing.assert_frame_equal(short_run(scene).frame, expected, check_exact=True)


def test_settings_are_told_and_numbers_are_taken_as_people_type_them() -> None:
    typed: dict[str, Any] = {"end": "10 ms", "samples": "4", "tolerance": "1 nm"}
    settings = {"method": "dop853"}
    plain = cs.simulate("ideal-free", settings=settings, end=0.01, samples=4, tolerance=1e-9)
    as_typed = cs.simulate("ideal-free", settings=settings, **typed)
    pd.testing.assert_frame_equal(as_typed.frame, plain.frame)
    assert plain.made_by["settings"]["method"] == "dop853"
    assert (as_typed.tolerance_m, len(plain.impacts)) == (1e-9, 0)


def test_quality_says_the_parts_in_one_line(loose_run: cs.Run) -> None:
    said, parts = loose_run.quality.summary(), loose_run.quality.parts()
    assert list(parts) == ["unaccounted_energy_part", "ideal_gap_part", "penetration_part"]
    for part in parts.values():
        assert f"by {100 * part:.3g} % of" in said
    assert "\n" not in said
    assert crankslider("simulate", LOOSE.name, "--end", 0.002, "--samples", 20).stderr.startswith(
        f"note: quality: {said}\n"
    )


def test_energy_that_a_spring_without_length_loses_names_it(tmp_path: Path) -> None:
    """The cart passes the place of the spring's other end, where the force turns about, near 0.17 s."""
    file = tmp_path / "through-zero.toml"
    file.write_text(THROUGH_ZERO)
    with pytest.raises(cs.Failed, match=r"spring s has next to no length near t = 0\.1[67]\d* s"):
        cs.simulate(file, end=0.3)

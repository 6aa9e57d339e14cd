"""The library does what the command line does."""

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import crankslider as cs
from tests.helpers.command import crankslider, table_of

LOOSE: Any = cs.scenes["clearance-driven-0.5mm"]


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

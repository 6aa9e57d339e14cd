"""Every call checks its arguments; numbers and arrays of NumPy are Python's own; what goes wrong is said."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import crankslider as cs

#: As what mypy lets be called with anything.
lib: Any = cs
LOOSE: Any = cs.scenes["clearance-driven-0.5mm"]


def test_numbers_and_arrays_of_numpy_are_pythons_own(tmp_path: Path) -> None:
    plain = lib.simulate(LOOSE, step=2.0**-17, end=2.0**-10, samples=3, settings={"lowest_flight": 2.5})
    kinds: dict[str, Any] = {"step": np.float32(2.0**-17), "end": np.longdouble(2.0**-10)}
    own = lib.simulate(LOOSE, samples=np.int64(3), settings={"lowest_flight": np.float64(2.5)}, **kinds)
    pd.testing.assert_frame_equal(own.frame, plain.frame)
    masses, start = np.array([0.1, 0.2]), {"revolutions": np.float32(0.125), "jobs": np.int8(1)}
    swept = lib.sweep(LOOSE, {"crank.mass_kg": masses}, out=tmp_path / "rows.parquet", **start)
    np.testing.assert_array_equal(swept.frame["crank.mass_kg"], masses)
    drive = {"kind": "table", "time_s": np.linspace(0, 1, 5), "angle_rad": np.arange(5)}
    table = LOOSE.replace({"drive": drive, "start.crank_speed_rad_s": np.int64(4)}).drive
    assert table.model_dump()["angle_rad"] == (0.0, 1.0, 2.0, 3.0, 4.0)


def test_a_run_in_doubt_warns_of_the_line_that_calls_and_one_that_breaks_down_says_when() -> None:
    with pytest.warns(UserWarning, match="^(energy off|slider position in doubt)") as doubts:
        run = cs.simulate("ideal-free", engine="pymunk", step=1e-3)
    assert [doubt.filename for doubt in doubts] == [__file__] * 2
    energy, position = run.warnings
    assert re.search(r"^energy off by .* past 1 % at t = ", energy)
    assert re.search(r"^slider position in doubt .* by a run at half the step", position)
    with pytest.raises(cs.Failed, match=r"^energy off by .* at t = "):
        cs.simulate("ideal-free", "pymunk", step=5e-3)
    with pytest.raises(cs.Failed, match=r"^slider position not known to 4\.94066e-324 m: "):
        cs.simulate("ideal-free", end=0.001, samples=2, tolerance=5e-324)

"""What is taken for a scene file and for a number, whatever is offered."""

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine_models.scene.file import load
from engine_models.scene.library import MECHANISMS, SCENES, ideal_free
from tests.helpers.command import crankslider

TEXT = ideal_free().to_toml()


@pytest.mark.parametrize("name", [*SCENES, *MECHANISMS])
def test_a_library_scene_has_its_own_name_and_is_read_as_it_is_shown(name: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(crankslider("show", name).stdout, encoding="utf-8")
    assert load(file) == {**SCENES, **MECHANISMS}[name]()
    assert load(file).name == name
    assert crankslider("show", file).stdout == file.read_text(encoding="utf-8")


def test_what_other_systems_write_is_no_part_of_the_text(tmp_path: Path) -> None:
    """A byte order mark, and line ends of Windows."""
    file = tmp_path / "scene.toml"
    for content in (b"\xef\xbb\xbf" + TEXT.encode(), TEXT.replace("\n", "\r\n").encode()):
        file.write_bytes(content)
        assert load(file) == ideal_free()


def test_a_pipe_that_a_shell_has_opened_is_read() -> None:
    reader, writer = os.pipe()
    with os.fdopen(reader), os.fdopen(writer, "w") as file:
        file.write(TEXT)
        file.close()
        assert load(Path(f"/dev/fd/{reader}")) == ideal_free()


def test_a_file_that_is_not_utf_8_is_refused_by_its_first_such_byte(tmp_path: Path) -> None:
    file = tmp_path / "latin.toml"
    file.write_bytes('name = "Kröpfung"'.encode("latin-1"))
    assert crankslider("show", file).stderr == f"error: {file}: expected UTF-8 text, got byte 0xf6 at 10\n"


def test_many_unknown_keys_are_counted_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    count = 20_000
    file.write_text("".join(f"k{k} = 1\n" for k in range(count)) + TEXT)
    done = crankslider("show", file)
    assert (done.code, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith(f"error: {file}: line 1: k0: expected the key name, end_time_s, ")
    assert done.stderr.endswith(f"; and {count - 3} more\n")
    assert len(done.stderr) < 1000


def test_only_plain_decimal_numbers_are_numbers() -> None:
    for number in ("1_0", "1_000.0", " 10", "１０", "١٠", "1e", "0x10", "1,5", "", "."):
        done = crankslider("simulate", "ideal-free", f"--samples={number}")
        assert done.stderr.startswith("error: samples: expected "), number
    for number in ("10", "+10", "010", "10.0", "1e1", "100E-1", ".1e2"):
        done = crankslider("simulate", "ideal-free", "--end", number, "--step", "20")
        assert done.stderr == "error: step: expected a number from 1e-11 to the end time 10, got 20\n"


@pytest.mark.parametrize(
    ("head", "scale"), [("time_ms,angle_deg", (1e3, 180 / math.pi)), ("time_s,angle_rev", (1, 0.5 / math.pi))]
)
def test_a_table_may_have_other_units_in_its_head(
    head: str, scale: tuple[float, float], tmp_path: Path
) -> None:
    times, angles = [0.0, 0.005, 0.01, 0.02], [0.0, 0.5, 1.0, 2.0]
    rows = [f"{time * scale[0]},{angle * scale[1]}" for time, angle in zip(times, angles, strict=True)]
    (tmp_path / "turn.csv").write_text("\n".join([head, *rows]))
    (tmp_path / "scene.toml").write_text(TEXT)
    changes: dict[str, object] = {"drive": {"kind": "table", "file": "turn.csv"}, "end_time_s": 0.02}
    changes |= {"start.crank_speed_rad_s": 100.0}
    drive: Any = load(tmp_path / "scene.toml", changes).drive
    np.testing.assert_allclose(drive.angle_rad, angles, rtol=1e-14)
    np.testing.assert_allclose(drive.time_s, times, rtol=1e-14)

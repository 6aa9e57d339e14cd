"""Bad drives and loads are refused in one line: which entry, what was expected, what came."""

import math
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

SCENE = """
name = "mine"
end_time_s = 0.02
[crank]
length_m = 0.05
mass_kg = 0.3
inertia_kg_m2 = 1e-4
centre_of_mass_m = 0.025
[rod]
length_m = 0.12
mass_kg = 0.21
inertia_kg_m2 = 2.5e-4
centre_of_mass_m = 0.06
[slider]
mass_kg = 0.14
inertia_kg_m2 = 1e-4
[start]
crank_angle_rad = 0.0
crank_speed_rad_s = 100.0
"""
FREE = '[drive]\nkind = "free"\n'


def lines(fields: dict[str, object]) -> list[str]:
    return [f"{name} = {value}" for name, value in fields.items()]


def drive(kind: str, **fields: object) -> str:
    return "\n".join(
        ["[drive]", f'kind = "{kind}"', *(f"{name} = {value}" for name, value in fields.items())]
    )


def load(**fields: object) -> str:
    return "\n".join([FREE, "[load.slider]", *lines(fields)])


def gas(angles: object, forces: object) -> str:
    return f"{FREE}\n[load.slider.gas]\ncrank_angle_rad = {angles}\nforce_N = {forces}\n"


TIME, ANGLE = [0.0, 0.005, 0.01, 0.02], [0.0, 0.5, 1.0, 2.0]
TURN, FORCE = [0.0, 2.0, 4.0, 2 * math.pi], [1.0, 5.0, 3.0, 1.0]
NAN = "[0.0, 0.5, nan, 2.0]"

#: What is written, and what the line has to name: the field, what was expected, what came.
BAD = {
    "unsorted times": (
        drive("table", time_s=[0.0, 0.01, 0.005, 0.02], angle_rad=ANGLE),
        "drive.time_s.2",
        "> 0.01",
        "0.005",
    ),
    "a time twice": (
        drive("table", time_s=[0.0, 0.01, 0.01, 0.02], angle_rad=ANGLE),
        "drive.time_s.2",
        "> 0.01",
        "0.01",
    ),
    "too short a table": (
        drive("table", time_s=TIME[:3], angle_rad=ANGLE[:3]),
        "drive.time_s",
        "at least 4",
        "3",
    ),
    "one point of a straight line": (
        drive("table", time_s=TIME[:1], angle_rad=ANGLE[:1], interpolation='"linear"'),
        "drive.time_s",
        "at least 2",
        "1",
    ),
    "straight lines at two speeds": (
        drive("table", time_s=TIME, angle_rad=[0.0, 0.5, 1.0, 3.0], interpolation='"linear"'),
        "drive.interpolation",
        "'spline' (at time_s.2 the speed would jump from 100 to 200 rad/s",
        "'linear'",
    ),
    "slopes of straight lines": (
        drive("table", time_s=TIME, angle_rad=ANGLE, interpolation='"linear"', end_slopes=[1.0, 1.0]),
        "drive.end_slopes",
        "nothing with interpolation = 'linear'",
        "a list",
    ),
    "a slope at one end": (
        drive("table", time_s=TIME, angle_rad=ANGLE, end_slopes=[100.0]),
        "drive.end_slopes",
        "two numbers",
        "1",
    ),
    "another start than the slope's": (
        drive("table", time_s=TIME, angle_rad=ANGLE, end_slopes=[0.0, 100.0]),
        "start.crank_speed_rad_s",
        "the speed of the drive's table when the scene begins, 0",
        "100",
    ),
    "another interpolation": (
        drive("table", time_s=TIME, angle_rad=ANGLE, interpolation='"cubic"'),
        "drive.interpolation",
        '"spline" or "linear"',
        '"cubic"',
    ),
    "columns of two lengths": (
        drive("table", time_s=TIME, angle_rad=ANGLE[:3]),
        "drive.angle_rad",
        "as many",
        "3",
    ),
    "nan in a table": (drive("table", time_s=TIME, angle_rad=NAN), "drive.angle_rad.2", "finite", "nan"),
    "words in a table": (
        drive("table", time_s=TIME, angle_rad='[0.0, "half", 1.0, 2.0]'),
        "drive.angle_rad.1",
        "number",
        '"half"',
    ),
    "no list": (drive("table", time_s=TIME, angle_rad=3.0), "drive.angle_rad", "a list of numbers", "3.0"),
    "no table": (drive("table"), "drive.time_s", "a list of numbers", "nothing"),
    "a table that begins late": (
        drive("table", time_s=[0.001, *TIME[1:]], angle_rad=ANGLE),
        "drive.time_s.0",
        "<= 0",
        "0.001",
    ),
    "a table that ends early": (
        drive("table", time_s=[t / 2 for t in TIME], angle_rad=[a / 2 for a in ANGLE]),
        "drive.time_s.3",
        "at least 0.02",
        "0.01",
    ),
    "milliseconds": (
        drive("table", time_s=[1e3 * t for t in TIME], angle_rad=ANGLE),
        "start.crank_speed_rad_s",
        "0.1",
        "100",
    ),
    "degrees": (
        drive("table", time_s=TIME, angle_rad=[math.degrees(a) for a in ANGLE]),
        "start.crank_speed_rad_s",
        "5730",
        "100",
    ),
    "a missing file": (drive("table", file='"nowhere.csv"'), "drive.file", "can be read", "No such file"),
    "a file and a list": (
        drive("table", file='"a.csv"', time_s=TIME),
        "drive.file",
        "nothing beside time_s",
        '"a.csv"',
    ),
    "a file of no name": (drive("table", file=3), "drive.file", "the name of a CSV file", "3"),
    "a file for a ramp": (
        drive("ramp", file='"a.csv"', final_speed_rad_s=1.0, ramp_time_s=0.1),
        "drive.file",
        "the key",
        "unknown key",
    ),
    "a ramp of no length": (
        drive("ramp", final_speed_rad_s=200.0, ramp_time_s=0.0),
        "drive.ramp_time_s",
        "> 0",
        "0.0",
    ),
    "a ramp to nowhere": (drive("ramp", ramp_time_s=0.1), "drive.final_speed_rad_s", "number", "nothing"),
    "a still fluctuation": (
        drive("fluctuating", amplitude_rad_s=1.0, frequency_Hz=0.0),
        "drive.frequency_Hz",
        ">= 1e-09",
        "0.0",
    ),
    "a negative amplitude": (
        drive("fluctuating", amplitude_rad_s=-1.0, frequency_Hz=5.0),
        "drive.amplitude_rad_s",
        ">= 0",
        "-1.0",
    ),
    "a motor without a no-load speed": (
        drive("motor", stall_torque_N_m=3.0),
        "drive.no_load_speed_rad_s",
        "number",
        "nothing",
    ),
    "a motor that stands": (
        drive("motor", stall_torque_N_m=3.0, no_load_speed_rad_s=0.0),
        "drive.no_load_speed_rad_s",
        "> 0",
        "0",
    ),
    "a motor that runs away": (
        drive("motor", stall_torque_N_m=-3.0, no_load_speed_rad_s=9.0),
        "drive.no_load_speed_rad_s",
        "< 0",
        "9",
    ),
    "a motor without torque": (
        drive("motor", stall_torque_N_m=0.0, no_load_speed_rad_s=9.0),
        "drive.stall_torque_N_m",
        "other than 0",
        "0",
    ),
    "no load": (load(), "load.slider.force_N", "viscous_N_s_m", "nothing"),
    "an infinite force": (load(force_N="inf"), "load.slider.force_N", "finite", "inf"),
    "friction that drives": (load(viscous_N_s_m=-1.0), "load.slider.viscous_N_s_m", ">= 0", "-1.0"),
    "a spring from nowhere": (
        load(spring_N_m=10.0),
        "load.slider.free_position_m",
        "beside spring_N_m",
        "nothing",
    ),
    "a place for no spring": (
        load(force_N=1.0, free_position_m=0.1),
        "load.slider.free_position_m",
        "without spring_N_m",
        "0.1",
    ),
    "gas that does not close": (
        gas(TURN, [1.0, 5.0, 3.0, 2.0]),
        "load.slider.gas.force_N.3",
        "the first one again, 1",
        "2",
    ),
    "half a revolution": (
        gas([0.0, 1.0, 2.0, math.pi], FORCE),
        "load.slider.gas.crank_angle_rad.3",
        "6.28319",
        "3.14159",
    ),
    "gas in degrees": (
        gas([0.0, 90.0, 180.0, 360.0], FORCE),
        "load.slider.gas.crank_angle_rad.3",
        "6.28319",
        "360",
    ),
    "unsorted gas": (gas([0.0, 4.0, 2.0, TURN[3]], FORCE), "load.slider.gas.crank_angle_rad.2", "> 4", "2"),
    "too little gas": (gas(TURN[:3], FORCE[:3]), "load.slider.gas.crank_angle_rad", "at least 4", "3"),
    "slopes of gas": (
        gas(TURN, FORCE) + "end_slopes = [0.0, 0.0]\n",
        "load.slider.gas.end_slopes",
        "the key crank_angle_rad, force_N or interpolation",
        "unknown key",
    ),
    "one point of gas": (
        gas(TURN[:1], FORCE[:1]) + 'interpolation = "linear"\n',
        "load.slider.gas.crank_angle_rad",
        "at least 2",
        "1",
    ),
    "an unknown load": (load(weight_N=3.0), "load.slider.weight_N", "the key force_N", "unknown key"),
    "a load on the rod": (
        f"{FREE}\n[load.rod]\nforce_N = 1.0\n",
        "load.rod.along_rad",
        "a number for a body without a guide",
        "nothing",
    ),
}


def refused(*arguments: object, pieces: Sequence[object]) -> None:
    done = crankslider(*arguments)
    require_refusal(done.stdout, done.stderr, done.code, *map(str, pieces))


@pytest.mark.parametrize("case", BAD)
def test_a_bad_drive_or_load_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    text, *pieces = BAD[case]
    file = tmp_path / "mine.toml"
    file.write_text(SCENE + text)
    refused("simulate", file, "--out", tmp_path / "out.csv", pieces=pieces)
    assert list(tmp_path.iterdir()) == [file], "nothing was written"


#: A table's file, and what the line has to name.
BAD_FILES = {
    "empty": ("", "table.csv", "the columns time_s, angle_rad", "nothing"),
    "another column": ("t,angle_rad\n0,0\n", "table.csv", "the columns time_s, angle_rad", '"t, angle_rad"'),
    "a column twice": (
        "time_s,angle_rad,time_s\n0,0,0\n",
        "table.csv",
        "the columns",
        "time_s, angle_rad, time_s",
    ),
    "nan": ("time_s,angle_rad\n0,0\n0.01,nan\n", "line 3", "a finite number for angle_rad", '"nan"'),
    "overflow": ("time_s,angle_rad\n0,0\n0.01,1e999\n", "line 3", "a finite number for angle_rad", '"1e999"'),
    "a short line": ("time_s,angle_rad\n0,0\n0.01\n", "line 3", "a finite number for angle_rad", "nothing"),
    "commas of thousands": (
        "time_s;angle_rad\n0;0\n1;1,000,000\n",
        "line 3",
        "a finite number for angle_rad",
        '"1,000,000"',
    ),
    "not text": (b"\xff\xfe\x00", "UTF-8 text", "byte 0xff"),
    "too short": ("time_s,angle_rad\n0,0\n1,100\n", "drive.time_s", "at least 4", "2"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_bad_file_is_refused_with_the_line_in_it(case: str, tmp_path: Path) -> None:
    content, *pieces = BAD_FILES[case]
    (tmp_path / "table.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    file = tmp_path / "mine.toml"
    file.write_text(SCENE + drive("table", file='"table.csv"'))
    refused("show", file, pieces=pieces)


def test_a_pendulum_has_no_slider_to_load(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        SCENE.replace(SCENE[SCENE.index("[rod]") : SCENE.index("[start]")], "") + load(force_N=1.0)
    )
    refused("show", file, pieces=["load.slider", "expected nothing without rod and slider", "a section"])


def test_a_later_end_than_the_tables_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(SCENE + drive("table", time_s=TIME, angle_rad=[100 * t for t in TIME]))
    assert crankslider("simulate", file, "--samples", 2).code == 0
    refused("simulate", file, "--end", 0.03, pieces=["drive.time_s.3", "at least 0.03", "0.02"])


@pytest.mark.parametrize("point", [".", ","])
def test_a_table_may_have_semicolons_and_then_decimal_commas(point: str, tmp_path: Path) -> None:
    lines = [f"{t!r}; {100 * t!r}".replace(".", point) for t in TIME]
    (tmp_path / "turn.csv").write_text("\n".join(["time_s; angle_rad", *lines]))
    by_file, by_list = tmp_path / "file.toml", tmp_path / "list.toml"
    by_file.write_text(SCENE + drive("table", file='"turn.csv"'))
    by_list.write_text(SCENE + drive("table", time_s=TIME, angle_rad=[100 * t for t in TIME]))
    assert crankslider("show", by_file).stdout == crankslider("show", by_list).stdout


def test_a_table_in_a_file_is_the_table_in_the_scene(tmp_path: Path) -> None:
    angles = [100 * t for t in TIME]
    turns = [f"{a}, {t} ,note" for t, a in zip(TIME, angles, strict=True)]
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "turn.csv").write_text("\ufeffangle_rad,time_s,remark\n" + "\n".join(turns) + "\n\n")
    gas_lines = [f"{a},{F}" for a, F in zip(TURN, FORCE, strict=True)]
    (tmp_path / "gas.csv").write_text("\r\n".join(["crank_angle_rad,force_N", *gas_lines]))
    by_file, by_list = tmp_path / "file.toml", tmp_path / "list.toml"
    by_file.write_text(
        SCENE + drive("table", file='"data/turn.csv"') + '\n[load.slider]\ngas = {file = "gas.csv"}\n'
    )
    by_list.write_text(
        SCENE
        + drive("table", time_s=TIME, angle_rad=angles)
        + f"\n[load.slider]\ngas = {{crank_angle_rad = {TURN}, force_N = {FORCE}}}\n"
    )
    shown = crankslider("show", by_file)
    assert (shown.code, shown.stdout) == (0, crankslider("show", by_list).stdout)
    assert "csv" not in shown.stdout, "what is shown needs no other file"


def test_a_table_is_not_overwritten_by_the_output(tmp_path: Path) -> None:
    table, file = tmp_path / "gas.csv", tmp_path / "mine.toml"
    lines = [f"{a},{F}" for a, F in zip(TURN, FORCE, strict=True)]
    table.write_text("\n".join(["crank_angle_rad,force_N", *lines]))
    before = table.read_text()
    file.write_text(SCENE + load(gas='{file = "gas.csv"}'))
    refused("simulate", file, "--out", table, pieces=["--out", "than the scene or its tables", "gas.csv"])
    assert table.read_text() == before


EXTREME = {
    "as good as at one place": ([0.0, 1e-320, 0.005, 0.02], ANGLE, "drive.time_s.1"),
    "endless": ([0.0, 0.005, 0.01, 1e308], ANGLE, "drive.time_s.3"),
    "huge": (TIME, [0.0, 1e300, 0.0, 0.0], "drive.angle_rad.1"),
}


@pytest.mark.parametrize("case", EXTREME)
def test_extremes_that_no_spline_takes_are_refused(case: str, tmp_path: Path) -> None:
    times, angles, field = EXTREME[case]
    file = tmp_path / "mine.toml"
    file.write_text(SCENE + drive("table", time_s=times, angle_rad=angles))
    refused("show", file, pieces=[field, "expected"])
    file.write_text(SCENE + gas([0.0, 3.0, 5.0, 6.28322, 6.28325], [0.0, -5.0, -3.0, 1.0, 0.0]))
    refused("show", file, pieces=["load.slider.gas.crank_angle_rad.3", "< 6.28319", "6.28322"])


@pytest.mark.parametrize("end", [0.00043, 0.0123, 0.03])
@pytest.mark.parametrize("name", ["ideal-driven", "ideal-fluctuating"])
def test_runs_of_any_length_come_to_their_end(name: str, end: float) -> None:
    for samples in range(1, 40):
        done = crankslider("simulate", name, "--end", end, "--samples", samples, "--step", 3e-5)
        assert done.code == 0, done.stderr

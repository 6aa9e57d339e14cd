import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

CLEARANCE = """
[clearance.B]
radial_clearance_m = 5e-4
bearing_radius_m = 0.01
law = "flores"
stiffness = 1e9
restitution = 0.9
"""


@pytest.fixture
def scene_text() -> str:
    return crankslider("show", "ideal-torque").stdout + CLEARANCE


SCENE_CASES = {
    "negative mass": ("mass_kg = 0.3", "mass_kg = -0.3", "crank.mass_kg", "a finite number > 0", "-0.3"),
    "zero mass": ("mass_kg = 0.14", "mass_kg = 0", "slider.mass_kg", "a finite number > 0", "0"),
    "nan": ("end_time_s = 0.3", "end_time_s = nan", "end_time_s", "a finite number > 0", "nan"),
    "inf": ("crank_speed_rad_s = 0.0", "crank_speed_rad_s = inf", "start.crank_speed_rad_s", "finite", "inf"),
    "overflow": ("torque_N_m = 0.3", "torque_N_m = -1e999", "drive.torque_N_m", "a finite number", "-inf"),
    "huge integer": (
        "length_m = 0.12",
        f"length_m = {10**400}",
        "rod.length_m",
        "a finite",
        "a huge integer",
    ),
    "short rod": (
        "length_m = 0.12",
        "length_m = 0.04",
        "rod.length_m",
        "at least crank.length_m = 0.05",
        "0.04",
    ),
    "unknown key": (
        "[rod]",
        '[rod]\ncolour = "red"',
        "rod.colour",
        "the key length_m, mass_kg",
        "an unknown",
    ),
    "unknown section": (
        "[rod]",
        "[sprang]\nk = 1\n[rod]",
        "sprang",
        "the key name, end_time_s",
        "an unknown",
    ),
    "wrong joint": ("[clearance.B]", "[clearance.C]", "clearance.C", "the key O, A or B", "an unknown key"),
    "string for number": ("mass_kg = 0.21", 'mass_kg = "0.21"', "rod.mass_kg", "a finite number", '"0.21"'),
    "boolean for number": ("mass_kg = 0.21", "mass_kg = true", "rod.mass_kg", "a finite number > 0", "true"),
    "list for number": ("mass_kg = 0.21", "mass_kg = [1]", "rod.mass_kg", "a finite number > 0", "a list"),
    "number for name": ('name = "ideal-torque"', "name = 3", "name", "a string that is not empty", "3"),
    "empty name": ('name = "ideal-torque"', 'name = ""', "name", "a string that is not empty", '""'),
    "formula for name": (
        'name = "ideal-torque"',
        """name = "=cmd|'/C calc'!A0\"""",
        "name",
        "begins with neither a blank nor =, +, - or @",
        '"=cmd|',
    ),
    "number for section": ("[start]", "[x]\nstart = 3", "start", "a section", "nothing"),
    "missing field": ("inertia_kg_m2 = 2.5e-05\n", "", "rod.inertia_kg_m2", "a finite number > 0", "nothing"),
    "missing section": ("[start]", "[drive2]", "start", "a section", "nothing"),
    "negative gravity": (
        "gravity_m_s2 = 9.81",
        "gravity_m_s2 = -9.81",
        "gravity_m_s2",
        "number >= 0",
        "-9.81",
    ),
    "bad drive": ('"torque"', '"belt"', "drive.kind", '"ramp", "table" or "torque"', '"belt"'),
    "no drive kind": ('kind = "torque"', "", "drive.kind", '"table" or "torque"', "nothing"),
    "torque missing": ("torque_N_m = 0.3", "", "drive.torque_N_m", "a finite number", "nothing"),
    "torque on a free crank": (
        '"torque"',
        '"free"',
        "drive.torque_N_m",
        "the key body, guide or kind",
        "an unknown key",
    ),
    "no room": ("= 5e-4", "= 0.01", "clearance.B.radial_clearance_m", "< bearing_radius_m = 0.01", "0.01"),
    "bad law": ('"flores"', '"gum"', "clearance.B.law", '"hu-guo", "carvalho-martins" or "rigid"', '"gum"'),
    "no restitution": ("restitution = 0.9", "", "clearance.B.restitution", "with law = 'flores'", "nothing"),
    "restitution 2": ("= 0.9", "= 2", "clearance.B.restitution", "a finite number >= 0 and <= 1", "2"),
    "syntax": ("[rod]", "[rod", "TOML syntax", "valid TOML", "'"),
    "twice": ("[rod]", "[crank]", "TOML syntax", "valid TOML", "'Cannot declare"),
    "too deep": ("[rod]", "x = " + "[" * 100_000, "TOML syntax", "", "too many"),
}


@pytest.mark.parametrize("case", SCENE_CASES)
def test_a_bad_scene_file_is_refused_in_one_line(case: str, scene_text: str, tmp_path: Path) -> None:
    old, new, field, expected, came = SCENE_CASES[case]
    assert scene_text.count(old) == 1
    file, out = tmp_path / "bad.toml", tmp_path / "out.csv"
    file.write_text(scene_text.replace(old, new))
    out.write_text("before")
    done = crankslider("simulate", file, "--out", out)
    require_refusal(done.stdout, done.stderr, done.code, f"{field}: expected", expected, f"got {came}")
    assert out.read_text() == "before"
    assert sorted(tmp_path.iterdir()) == [file, out]


SIMULATE, LOOSE = ("simulate", "ideal-free"), "clearance-driven-0.5mm"
SWEEP = ("sweep", LOOSE, "--vary")
ARGUMENT_CASES: dict[str, tuple[tuple[object, ...], tuple[str, ...]]] = {
    "no command": ((), ("COMMAND: expected scenes", "Missing command")),
    "unknown command": (("simulat",), ("COMMAND: expected scenes", "report", "'simulat'")),
    "unknown option": ((*SIMULATE, "--stepp", 1), ("simulate: expected SCENE, --engine", "--stepp")),
    "unknown global option": (("--verbose",), ("COMMAND: expected", "--verbose")),
    "option without value": ((*SIMULATE, "--step"), ("--step: expected a value, got nothing",)),
    "no scene": (("simulate",), ("SCENE: expected a value, got nothing",)),
    "two scenes": (("show", "ideal-free", "ideal-torque"), ("show: expected SCENE", "ideal-torque")),
    "unknown scene": (("show", "idle"), ("SCENE: expected ideal-free, ", 'a TOML file, got "idle"')),
    "comparison without a scene": (("compare",), ("SCENE: expected a value, got nothing",)),
    "comparison on no scene": (("compare", "idle"), ("SCENE: expected ideal-free, ", 'got "idle"')),
    "comparison by no engine": (
        ("compare", "ideal-free", "--engine", "exodyn"),
        ("--engine: expected reference, exudyn", 'got "exodyn"', "exudyn"),
    ),
    "comparison of what is no scene with a change": (
        ("compare", "ideal-free", "--with", "crank.lenght_m=1"),
        ("--with crank.lenght_m", "(did you mean"),
    ),
    "missing file": (("simulate", "no/such.toml"), ("SCENE: expected", 'got "no/such.toml"')),
    "directory": (("simulate", "."), (".: expected a file that can be read", "Is a directory")),
    "negative step": ((*SIMULATE, "--step=-1e-5"), ("--step: expected a finite number > 0", '"-1e-5"')),
    "zero step": ((*SIMULATE, "--step", 0), ("--step: expected a finite number > 0", 'got "0"')),
    "nan step": ((*SIMULATE, "--step", "nan"), ("--step: expected a finite number > 0", 'got "nan"')),
    "long step": ((*SIMULATE, "--step", 2), ("--step: expected a number", "to the end time 1, got 2")),
    "lost step": ((*SIMULATE, "--step", 1e-300), ("--step: expected a number from 1e-12", "got 1e-300")),
    "step in words": ((*SIMULATE, "--step", "small"), ("--step: expected a finite number", '"small"')),
    "negative tolerance": (
        (*SIMULATE, "--tolerance=-1"),
        ("--tolerance: expected a finite number > 0", '"-1"'),
    ),
    "step and tolerance": (
        (*SIMULATE, "--step", 1e-5, "--tolerance", 1e-6),
        ("--tolerance: expected nothing beside --step", "got 1e-06"),
    ),
    "zero end": ((*SIMULATE, "--end", 0), ("--end: expected a finite number > 0", 'got "0"')),
    "endless": ((*SIMULATE, "--end", "inf"), ("--end: expected a finite number > 0", 'got "inf"')),
    "zero samples": ((*SIMULATE, "--samples", 0), ("--samples: expected an integer >= 1", 'got "0"')),
    "half a sample": ((*SIMULATE, "--samples", 2.5), ("--samples: expected an integer >= 1", 'got "2.5"')),
    "too many samples": ((*SIMULATE, "--samples", 10**9), ("--samples: expected an integer", "<= 100000")),
    "unknown engine": ((*SIMULATE, "--engine", "ode"), ("--engine: expected reference, exudyn, ", '"ode"')),
    "unknown setting": (
        (*SIMULATE, "--set", "colour=red"),
        ("--set colour: expected the key method, ", "got an unknown key"),
    ),
    "setting of another engine": (
        (*SIMULATE, "--set", "iterations=30"),
        ("--set iterations: expected the key method, ", "got an unknown key"),
    ),
    "bad choice": (
        (*SIMULATE, "--engine", "exudyn", "--set", "solver=Euler"),
        ("--set solver: expected ", '"GeneralizedAlpha"', 'got "Euler"'),
    ),
    "bad number": (
        (*SIMULATE, "--engine", "pymunk", "--set", "iterations=0"),
        ("--set iterations: expected an integer > 0", 'got "0"'),
    ),
    "bad boolean": (
        (*SIMULATE, "--engine", "pymunk", "--set", "half_kick_start=maybe"),
        ("--set half_kick_start: expected true or false", 'got "maybe"'),
    ),
    "nan setting": (
        (*SIMULATE, "--set", "baumgarte_alpha_s=nan"),
        ("--set baumgarte_alpha_s: expected a finite number", 'got "nan"'),
    ),
    "setting without value": ((*SIMULATE, "--set", "solver"), ("--set: expected KEY=VALUE", '"solver"')),
    "setting twice": (
        (*SIMULATE, "--set", "stabilisation=none", "--set", "stabilisation=projection"),
        ("--set stabilisation: expected one value", "none and projection"),
    ),
    "unknown study": (("run", "astrology"), ("STUDY: expected agreement", 'got "astrology"')),
    "no jobs": (("run", "--jobs", 0), ("--jobs: expected an integer >= 1", 'got "0"')),
    "too many jobs": (("run", "--jobs", 10**5), ("--jobs: expected an integer >= 1 and <= 1000",)),
    "study of no name": (("run", ""), ("STUDY: expected agreement", 'got ""')),
    "study on no cluster": (
        ("run", "energy", "--scheduler", "x"),
        ("--scheduler: expected the address", "x"),
    ),
    "end too late for the step": (
        (*SIMULATE, "--end", 1e308),
        ("--step: expected a number from 1e+296", "got none, which is 1e-05"),
    ),
    "end with a comma": ((*SIMULATE, "--end", "1,5"), ("--end: expected a finite number > 0", '"1,5"')),
    "samples as a power": ((*SIMULATE, "--samples", "1e3"), ("--samples: expected an integer", '"1e3"')),
    "samples without end": ((*SIMULATE, "--samples", "\u221e"), ("--samples: expected an integer", "\u221e")),
    "setting without a name": ((*SIMULATE, "--set", "=1"), ("--set: expected KEY=VALUE", '"=1"')),
    "setting without its value": ((*SIMULATE, "--set", "method="), ("--set method: expected", 'got ""')),
    "setting by its old name": (
        (*SIMULATE, "--set", "tolerance=1e-9"),
        ("--set tolerance: expected the key method, step_tolerance", "(did you mean step_tolerance?)"),
    ),
    "setting beyond doubles": (
        (*SIMULATE, "--set", "step_tolerance=1e400"),
        ("--set step_tolerance: expected a finite number >= 1e-14 and < 1", "1e400"),
    ),
    "section as a number": ((*SIMULATE, "--with", "crank=1"), ("--with crank: expected a section, got 1",)),
    "list that does not end": (
        (*SIMULATE, "--with", "crank.mass_kg=[1"),
        ("--with crank.mass_kg: expected a finite number > 0", '"[1"'),
    ),
    "table without rows": (
        (*SIMULATE, "--with", "drive.kind=table"),
        ("--with drive.time_s: expected a list of numbers, got nothing",),
    ),
    "engine of no name": ((*SIMULATE, "--engine", ""), ("--engine: expected reference, exudyn", 'got ""')),
    "engine of no module": (
        (*SIMULATE, "--engine", "nomod:E"),
        ("--engine nomod:E: expected a class", "nomod"),
    ),
    "engine that is none": ((*SIMULATE, "--engine", "os.path:join"), ("the methods check, simulate",)),
    "film to stdout": ((*SIMULATE, "--animate", "-"), ("--animate: expected a file that ends in .html",)),
    "device": (("show", "/dev/null"), ("/dev/null: expected a file that can be read, got a device",)),
    "sweep of nothing": (("sweep", LOOSE), ("--vary: expected FIELD=VALUES, or --members and --jitter",)),
    "sweep of a field that is none": (
        ("sweep", LOOSE, "--vary", "crank.mas_kg=1,2"),
        ("--vary crank.mas_kg: expected the key", "(did you mean mass_kg?)"),
    ),
    "sweep that falls": ((*SWEEP, "crank.mass_kg=2:1:log"), ("expected a range that rises, got 2 to 1",)),
    "sweep by logarithms from nought": (
        (*SWEEP, "crank.mass_kg=0:1:log:3"),
        ("expected numbers > 0", "got 0"),
    ),
    "sweep over words": ((*SWEEP, "crank.mass_kg=a,b"), ("--vary crank.mass_kg: expected LOW:HIGH", '"a"')),
    "sweep over kinds": ((*SWEEP, "drive.kind=1,2"), ("--vary drive.kind: expected", "got 1")),
    "sweep without end": ((*SWEEP, "crank.mass_kg=1:2:1000000000000"), ("expected 1 to 100000 members",)),
    "sweep to a table": (
        (*SWEEP, "crank.mass_kg=1,2", "--out", "x.txt"),
        ("--out: expected a file that ends in .parquet or .csv",),
    ),
    "sweep to no picture": (
        (*SWEEP, "crank.mass_kg=1,2", "--plot", "x.txt"),
        ("--plot: expected a file that ends in .png, .svg or .pdf",),
    ),
    "sweep to a picture nowhere": (
        (*SWEEP, "crank.mass_kg=1,2", "--plot", "no/x.png"),
        ("--plot: expected a place that can be written, got no/x.png",),
    ),
    "column of no picture": (
        (*SWEEP, "crank.mass_kg=1,2", "--show", "flight_part"),
        ("--show: expected nothing without --plot, got flight_part",),
    ),
    "draws of no number": (
        (*SWEEP, "crank.mass_kg=1:2", "--sample", "sobol"),
        ("--sample: expected --members N beside sobol",),
    ),
    "comparison into a file": (
        ("compare", LOOSE, "--out", __file__),
        ("--out: expected a place that can be written", "Not a directory"),
    ),
    "study into a file": (("run", "energy", "--out", __file__), ("--out: expected a", "Not a directory")),
    "conformance of nothing": (("conform",), ("ENGINE: expected a value, got nothing",)),
    "conformance of a slip": (("conform", "exudin"), ("ENGINE: expected", "(did you mean exudyn?)")),
    "reason for nothing": (("baseline", "--why", "x"), ("--why: expected a reason with --accept",)),
    "no reason": (("baseline", "--accept"), ("--why: expected a reason with --accept, got none",)),
    "against no report": (("report", "--against", "nope"), ("--against: expected the folder of a report",)),
    "no results": (("report", "--results", "nowhere"), ("--results: expected", "nowhere")),
    "two lines in an argument": (("show", "a\nb"), ("SCENE: expected", r"a\nb")),
    "scene with a slip": (("show", "ideal-fre"), ('got "ideal-fre" (did you mean ideal-free?)',)),
    "file with a slip": (("show", "mine.toml"), ("expected a TOML file that is there", "(no such file)")),
    "engine with a slip": ((*SIMULATE, "--engine", "exudin"), ('got "exudin" (did you mean exudyn?)',)),
    "engine in full with a slip": (("engines", "pymonk"), ("NAME: expected", "(did you mean pymunk?)")),
    "study with a slip": (("run", "agreemnt"), ("STUDY: expected", "(did you mean agreement?)")),
    "setting with a slip": (
        (*SIMULATE, "--set", "stabilization=none"),
        ("--set stabilization: expected the key", "(did you mean stabilisation?)"),
    ),
    "choice with a slip": (
        (*SIMULATE, "--set", "method=dop835"),
        ("--set method: expected", '"dop835" (did you mean dop853?)'),
    ),
    "field with a slip": (
        (*SIMULATE, "--with", "crank.lenght_m=0.1"),
        ("--with crank.lenght_m: expected the key", "(did you mean length_m?)"),
    ),
    "drive with a slip": (
        (*SIMULATE, "--with", "drive.kind=constant-sped"),
        ("--with drive.kind: expected", "(did you mean constant-speed?)"),
    ),
    "field without value": ((*SIMULATE, "--with", "crank"), ("--with: expected FIELD=VALUE", '"crank"')),
    "field twice": (
        (*SIMULATE, "--with", "end_time_s=1", "--with", "end_time_s=2"),
        ("--with end_time_s: expected one value, got 1 and 2",),
    ),
    "bad value of a field": (
        (*SIMULATE, "--with", "crank.mass_kg=-1"),
        ("--with crank.mass_kg: expected a finite number > 0, got -1",),
    ),
    "word in a field": (
        (*SIMULATE, "--with", "crank.mass_kg=heavy"),
        ("--with crank.mass_kg: expected a finite number > 0", '"heavy"'),
    ),
    "field below a number": (
        (*SIMULATE, "--with", "crank.mass_kg.x=1"),
        ("--with crank.mass_kg: expected a finite number > 0, got a section",),
    ),
    "half a clearance": (
        (*SIMULATE, "--with", "clearance.B.radial_clearance_m=1e-4"),
        ("--with clearance.B.bearing_radius_m: expected a finite number > 0, got nothing",),
    ),
    "unknown ending of a table": (
        (*SIMULATE, "--out", "run.xlsx"),
        ("--out: expected a file that ends in .csv, .json or .parquet, got", "run.xlsx"),
    ),
    "unknown ending of impacts": (
        ("simulate", "clearance-driven-0.5mm", "--impacts", "i.txt"),
        ("--impacts: expected a file that ends in .csv, .json or .parquet",),
    ),
    "impacts of ideal joints": (
        (*SIMULATE, "--impacts", "i.csv"),
        ("--impacts: expected a scene with clearance, got ideal-free",),
    ),
    "unknown ending of a figure": (
        (*SIMULATE, "--plot", "figure"),
        ("--plot: expected a file that ends in .png, .svg or .pdf",),
    ),
    "unknown ending of a film": (
        (*SIMULATE, "--animate", "film.avi"),
        ("--animate: expected a file that ends in .html, .gif or .mp4",),
    ),
    "nothing to exaggerate by": (
        (*SIMULATE, "--animate", "film.gif", "--exaggerate", 0),
        ("--exaggerate: expected a finite number > 0",),
    ),
    "exaggerated without a film": (
        (*SIMULATE, "--exaggerate", 20),
        ("--exaggerate: expected nothing without --animate, got 20",),
    ),
    "two tables to one file": (
        ("simulate", "clearance-driven-0.5mm", "--out", "a.csv", "--impacts", "./a.csv"),
        ("--impacts: expected another place than --out, got a.csv",),
    ),
    "two tables to stdout": (
        ("simulate", "clearance-driven-0.5mm", "--impacts", "-"),
        ("--impacts: expected another place than --out, got -",),
    ),
}


@pytest.mark.parametrize("case", ARGUMENT_CASES)
def test_a_bad_argument_is_refused_in_one_line(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, pieces = ARGUMENT_CASES[case]
    monkeypatch.chdir(tmp_path)
    done = crankslider(*arguments)
    require_refusal(done.stdout, done.stderr, done.code, *pieces)
    assert not list(tmp_path.iterdir())


def test_an_output_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("before")
    for out, reason in (
        (tmp_path / "nowhere" / "out.csv", "No such file or directory"),
        (tmp_path, "Is a directory"),
        (file / "out.csv", "Not a directory"),
        (tmp_path / ("x" * 300), "File name too long"),
    ):
        done = crankslider("simulate", "ideal-free", "--end", 1e5, "--out", out)  # the run would take hours
        place = f"--out: expected a place that can be written, got {out} ({reason})"
        require_refusal(done.stdout, done.stderr, done.code, place)
    assert list(tmp_path.iterdir()) == [file]
    assert file.read_text() == "before"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write and read everything")
def test_permissions_are_respected(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    file.write_text("before")
    file.chmod(0o444)
    done = crankslider("simulate", "ideal-free", "--end", 0.01, "--out", file)
    require_refusal(done.stdout, done.stderr, done.code, "--out: expected", "Permission denied")
    assert file.read_text() == "before"
    file.chmod(0)
    done = crankslider("show", file)
    require_refusal(done.stdout, done.stderr, done.code, "out.csv: expected a file", "Permission denied")


def test_a_full_disk_is_reported() -> None:
    done = crankslider("simulate", "ideal-free", "--end", 0.01, "--out", "/dev/full")
    require_refusal(done.stdout, done.stderr, done.code, "--out: expected", "No space left on device")


def test_a_file_that_is_not_utf_8_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "latin.toml"
    file.write_bytes('name = "Kröpfung"'.encode("latin-1"))
    done = crankslider("show", file)
    require_refusal(
        done.stdout, done.stderr, done.code, "latin.toml: expected UTF-8 text, got byte 0xf6 at 10"
    )


def test_a_scene_that_the_engine_cannot_run_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    done = crankslider("simulate", "rigid-driven-0.5mm", "--engine", "exudyn", "--out", out)
    pieces = ("--engine: expected one that can run this scene", "exudyn", "rigid")
    require_refusal(done.stdout, done.stderr, done.code, *pieces)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "piece"),
    [
        (["simulate", "ideal-free", "--engine", "ode"], "--engine: expected"),
        (["simulate", "bad.toml", "--out", "out.csv"], "rod.mass_kg: expected"),
        (["fly"], "COMMAND: expected"),
    ],
)
def test_the_installed_command_refuses_in_one_line(
    arguments: list[str], piece: str, scene_text: str, tmp_path: Path
) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(scene_text.replace("mass_kg = 0.21", "mass_kg = -0.21"))
    command = Path(sys.executable).with_name("crankslider")
    done = subprocess.run([command, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)
    require_refusal(done.stdout, done.stderr, done.returncode, piece)
    assert list(tmp_path.iterdir()) == [file]

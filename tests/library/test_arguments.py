"""Arguments that are none are refused in one line; numbers and arrays of NumPy are Python's own."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pandas as pd
import pytest

import crankslider as cs
from studies.command import simulation
from studies.command.comparison import Comparison
from studies.command.sweep import Swept

#: As what mypy lets be called with anything.
lib: Any = cs
LOOSE: Any = cs.scenes["clearance-driven-0.5mm"]
HUGE = 10**5000
RING: list[Any] = []
RING.append(RING)
MASS = {"crank.mass_kg": [0.1, 0.2]}


def simulate(scene: Any = "ideal-free", **options: Any) -> Any:
    return lib.simulate(scene, **{"end": 0.001, "samples": 2, **options})


def compare(engines: Any, folder: Any = "/dev/null/here") -> Any:
    return lib.compare("ideal-free", engines, folder)


def sweep(vary: Any = MASS, **options: Any) -> Any:
    return lib.sweep(LOOSE, vary, **{"jobs": 0, **options})


#: What is said, where ... stands for more, of which call.
WRONG: dict[str, Callable[[], object]] = {
    "path: expected a path, got 1.5": lambda: lib.load(1.5),
    "path: expected a path, got a huge integer": lambda: lib.load(HUGE),
    "path: expected a path, got b'x.toml'": lambda: lib.load(b"x.toml"),
    r'path: expected a path, got "a\u0000b"': lambda: lib.load("a\0b"),
    r"path: expected a path, got \ud800": lambda: lib.load(Path("\ud800")),
    r"a\nb: expected a file that can be read, got 'No such file or directory'": lambda: lib.load("a\nb"),
    "load: expected path, got a call with no required argument: 'path'": lambda: lib.load(),
    "load: expected path, got a call with too many positional arguments": lambda: lib.load("x", "y"),
    "field: expected a string or a mapping of names to values, got 5": lambda: LOOSE.replace(5),
    "field: expected a string or a mapping of names to values, got 1": lambda: LOOSE.replace({1: 2}),
    "crank.mass_kg: expected ... > 0, got a huge integer": lambda: LOOSE.replace("crank.mass_kg", HUGE),
    "crank.mass_kg: expected ... > 0, got a list": lambda: LOOSE.replace("crank.mass_kg", np.ones(2)),
    "clearance.B: expected a section, got <class 'int'>": lambda: LOOSE.replace("clearance.B", int),
    "clearance.1: expected the key O, A or B, got an unknown key": lambda: LOOSE.replace("clearance", {1: 2}),
    r'name: expected a string ... or @, got "\ud800"': lambda: LOOSE.replace("name", "\ud800"),
    "replace: expected ... levels, got too many inside each other": lambda: LOOSE.replace("name", RING),
    "update: expected a mapping of names to values, got a list": lambda: LOOSE.model_copy(update=[1]),
    "scene: expected ideal-free, ... or a TOML file, got 5": lambda: simulate(5),
    "scene: expected ideal-free, ... or a TOML file, got a section": lambda: simulate({"name": "x"}),
    r'scene: expected ideal-free, ... or a TOML file, got "\ud800"': lambda: simulate("\ud800"),
    r'scene: expected a TOML file that is there, got "x\u0000.toml" ...': lambda: simulate("x\0.toml"),
    "engine: expected a string, got an empty section": lambda: simulate(engine={}),
    "engine: expected a string, got None": lambda: simulate(engine=None),
    'step: expected a finite number > 0, got "1e-5"': lambda: simulate(step="1e-5"),
    "step: expected a finite number > 0, got a huge integer": lambda: simulate(step=HUGE),
    "step: expected a finite number > 0, got a list": lambda: simulate(step=np.ones(1)),
    "end: expected a finite number > 0 ..., got ...timedelta...": lambda: simulate(
        end=np.timedelta64(1, "ns")
    ),
    "samples: expected an integer >= 1 and <= 100000, got a huge integer": lambda: simulate(samples=HUGE),
    "samples: expected an integer >= 1 and <= 100000, got 2.0": lambda: simulate(samples=2.0),
    "settings: expected a mapping of names to values, got a list": lambda: simulate(settings=["none"]),
    "settings: expected a mapping of names to values, got 1": lambda: simulate(settings={1: "rk4"}),
    'method: expected "rk4", "dop853" or "dopri5", got "a huge integer"': lambda: simulate(method=HUGE),
    "max_steps: expected a finite number ..., got a list": lambda: simulate(max_steps=[1]),
    "methods: expected the key method, ..., got an unknown key ...": lambda: simulate(methods=None),
    "truth: expected scene, end, samples, got a call with ... 'step'": lambda: lib.truth(
        "ideal-free", step=1
    ),
    "end: expected a finite number > 0 and >= 1e-100, got 5e-324": lambda: simulate(end=5e-324),
    "end: expected a finite number > 0 ..., got 1j": lambda: lib.truth("ideal-free", end=1j),
    "scene: expected ideal-free, ... or a TOML file, got 1": lambda: lib.compare(1),
    "engines: expected a list of strings, got 1": lambda: compare(1),
    'engines: expected a list of strings, got "scipy"': lambda: compare("scipy"),
    "engines.0: expected a string, got 1": lambda: compare([1]),
    'engines: expected reference, exudyn, ..., got "scypy" (did you mean scipy?)': lambda: compare(["scypy"]),
    "folder: expected a path, got 5": lambda: compare([], 5),
    "folder: expected a place that can be written, got /dev/null/here ...": lambda: compare([]),
    "vary: expected a mapping of names to values, got 5": lambda: sweep(5),
    "vary: expected a mapping of names to values, got 1": lambda: sweep({1: [2]}),
    "vary.f: expected a string or a list of numbers, got 5": lambda: sweep({"f": 5}),
    'vary.f: expected a string or a list of numbers, got "x"': lambda: sweep({"f": [1, "x"]}),
    "vary.f: expected a string or a list of numbers, got true": lambda: sweep({"f": [True]}),
    "scheduler: expected a string, got 5": lambda: sweep(scheduler=5),
    'out: expected a file that ends in .parquet or .csv, got "x.txt"': lambda: sweep(jobs=1, out="x.txt"),
    "jobs: expected an integer >= 1 and <= 1000, got a huge integer": lambda: sweep(jobs=HUGE),
    "member: expected the key sample, ..., got an unknown key ...": lambda: sweep(jobs=1, member=5),
    "joint: expected a string, got a list": lambda: simulate(LOOSE).plot_orbit([]),
    "file: expected a path, got 5": lambda: simulate().animate(5),
    "exaggerate: expected a finite number > 0, got true": lambda: simulate().animate("x.gif", True),
    "plot: expected no arguments, got a call with too many ...": lambda: simulate().plot(1),
    "scene: expected ... (did you mean ideal-free?)": lambda: simulate("ideal-fre"),
    "scene: expected a TOML file that is there...": lambda: simulate("no/such.toml"),
    "step: expected a number from 1e-12 to ...": lambda: lib.simulate("ideal-free", step=2),
    "tolerance: expected nothing beside step, got 1e-06": lambda: simulate(step=1e-4, tolerance=1e-6),
    "engine: expected one that can run this scene...": lambda: simulate("rigid-pendulum", engine="exudyn"),
    "iterations: expected an integer > 0...": lambda: simulate(engine="pymunk", iterations=0),
    "crank.lenght_m: ... (did you mean length_m?)": lambda: LOOSE.replace("crank.lenght_m", 1.0),
    "clearance.B.radial_clearance_m: expected a number < bearing_radius_m...": lambda: LOOSE.replace(
        "clearance.B.radial_clearance_m", 1.0
    ),
    "clearance.A.bearing_radius_m: expected a finite number > 0, got nothing...": lambda: LOOSE.replace(
        "clearance.A.radial_clearance_m", 1e-4
    ),
}


@pytest.mark.parametrize("words", WRONG)
def test_a_wrong_argument_is_refused_in_one_line(words: str) -> None:
    with pytest.raises(cs.BadInput) as refused:
        WRONG[words]()
    assert re.fullmatch(re.escape(words).replace(r"\.\.\.", ".*"), str(refused.value)), refused.value
    assert str(refused.value).isprintable()


OWNERS: dict[str, Any] = {"": cs, "Scene": cs.Scene, "Run": cs.Run, "Swept": Swept, "Comparison": Comparison}
METHODS = ["Scene.replace", "Run.plot", "Run.plot_orbit", "Run.animate", "Swept.plot", "Comparison.save"]
FUNCTIONS = [f".{name}" for name in cs.__all__ if isinstance(getattr(cs, name), FunctionType)]


@pytest.mark.parametrize("name", [*FUNCTIONS, *METHODS])
def test_every_function_of_the_library_refuses_an_unknown_argument(name: str) -> None:
    owner, _, function = name.partition(".")
    some = () if owner == "" else (object.__new__(OWNERS[owner]),)
    with pytest.raises(cs.BadInput, match=r"^[a-z_ ]+: expected "):
        getattr(OWNERS[owner], function)(*some, **{"no argument": 1})


def test_numbers_and_arrays_of_numpy_are_pythons_own(tmp_path: Path) -> None:
    plain = lib.simulate(LOOSE, step=2.0**-17, end=2.0**-10, samples=3, lowest_flight=2.5)
    kinds: dict[str, Any] = {"step": np.float32(2.0**-17), "end": np.longdouble(2.0**-10)}
    own = lib.simulate(LOOSE, samples=np.int64(3), lowest_flight=np.float64(2.5), **kinds)
    pd.testing.assert_frame_equal(own.frame, plain.frame)
    masses, start = np.array([0.1, 0.2]), {"revolutions": np.float32(0.125), "jobs": np.int8(1)}
    swept = lib.sweep(LOOSE, {"crank.mass_kg": masses}, out=tmp_path / "rows.parquet", **start)
    np.testing.assert_array_equal(swept.frame["crank.mass_kg"], masses)
    drive = {"kind": "table", "time_s": np.linspace(0, 1, 5), "angle_rad": np.arange(5)}
    table = LOOSE.replace({"drive": drive, "start.crank_speed_rad_s": np.int64(4)}).drive
    assert table.model_dump()["angle_rad"] == (0.0, 1.0, 2.0, 3.0, 4.0)


def test_a_bug_inside_is_not_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise TypeError("ours")

    monkeypatch.setattr(simulation, "simulated", broken)
    with pytest.raises(TypeError, match="ours"):
        simulate()


def test_a_doubt_is_said_of_the_line_that_calls() -> None:
    with pytest.warns(UserWarning, match="energy") as doubts:
        cs.simulate("ideal-free", engine="pymunk", step=1e-3)
    assert [doubt.filename for doubt in doubts] == [__file__]


def test_contacts_without_the_compiler_are_refused_by_the_variable_that_switched_it_off() -> None:
    call = "cs.simulate('clearance-free-0.5mm', end=1e-3)"
    code = f"import crankslider as cs\ntry: {call}\nexcept cs.BadInput as refused: print(refused)"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("environment variable NUMBA_DISABLE_JIT: expected nothing or 0, ")


def test_the_least_tolerance_is_one() -> None:
    with pytest.raises(cs.Failed, match=r"^slider position not known to 4\.94066e-324 m: "):
        simulate(tolerance=5e-324)

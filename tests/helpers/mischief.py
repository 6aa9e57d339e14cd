"""A study whose engine does what its arm says, most of it bad; addressed by its import path."""

import ctypes
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from engine_models.arms import Arm, Setting
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import ideal_free
from studies.case import LIMIT_S, Case, Curves, Row

NAME = "tests.helpers.mischief"
#: Held from one case to the next, as caches are.
HELD: list[bytearray] = []


class Unpicklable(Exception):
    """An exception that no other process can be told of."""


def case(
    arm: str,
    number: int = 0,
    limit_s: float = LIMIT_S,
    timed: bool = False,
    engine: str = "mischief",
    **settings: Setting,
) -> Case:
    """Return a case that does what the arm says; its number tells it from others."""
    scene = ideal_free().model_copy(update={"end_time_s": 0.01})
    run = RunSettings(1e-3, number + 1)
    return Case(NAME, scene, Arm(engine, arm, settings), run, timed=timed, limit_s=limit_s)


def steady(row: dict[str, Any]) -> dict[str, Any]:
    """Return what is the same in the row of each run of a case."""
    return {name: value for name, value in row.items() if name not in ("pid", "parent", "began", "ended")}


def cases(full: bool) -> list[Case]:
    """Return work that takes a moment; the full set adds a crash and two timed cases, ``HANG_IN`` two hangs.

    ``HANG_IN`` is an environment variable with the folder where those that hang leave their process ids.
    """
    work = [case("work", number) for number in range(12)]
    if folder := os.environ.get("HANG_IN"):
        return work[:2] + [case("hang", n, pid_file=f"{folder}/pid{n}") for n in range(2)]
    more = [case("abort"), case("work", 98, timed=True), case("work", 99, timed=True)]
    return work + (more if full else [])


def measure(case: Case) -> tuple[Row, Curves]:
    """Do what the arm says."""
    began = time.monotonic()
    if case.arm.name == "simulate":
        trajectory = make_engine(case.engine, **case.settings).simulate(case.scene, case.run)
        curves = {"slider_position_m": trajectory.position[:, -1, 0]}
        row: Row = {"farthest_m": float(trajectory.position[:, -1, 0].max())}
    else:
        _misbehave(case)
        curves, row = {"time_s": np.arange(100.0)}, {}
    row |= {"pid": os.getpid(), "parent": os.getppid(), "began": began, "ended": time.monotonic()}
    return row, curves


def _misbehave(case: Case) -> None:
    match case.arm.name:
        case "work":
            time.sleep(0.1)
        case "abort":
            os.abort()
        case "segmentation fault":
            ctypes.string_at(0)
        case "exit":
            os._exit(3)
        case "be killed once":
            if _first(case, 1):
                os.kill(os.getpid(), signal.SIGTERM)
        case "be killed twice":
            if _first(case, 2):
                os.kill(os.getpid(), signal.SIGKILL)
        case "abort until mended":
            if not Path(str(case.settings["mended_file"])).exists():
                os.abort()
        case "hang":
            Path(str(case.settings["pid_file"])).write_text(str(os.getpid()))
            # A C function that keeps the interpreter's lock, as native solvers do.
            ctypes.PyDLL(None).sleep(1000)
        case "no memory":
            raise MemoryError
        case "say and abort":
            os.write(2, b"last words\n")
            os.abort()
        case "noise":
            print("noise" * 100_000)
            print("noise" * 100_000, file=sys.stderr)
            os.write(1, b"noise\n")
            os.write(2, b"noise\n")
        case "spoil":
            HELD.append(bytearray(1))
        case "be spoilt":
            if HELD:
                os.abort()
        case "bug":
            raise KeyError("no such thing")
        case "unpicklable bug":
            raise Unpicklable(threading.Lock())
        case _:
            raise AssertionError(case.arm.name)


def _first(case: Case, times: int) -> bool:
    """Return whether the case is run for one of the first times."""
    with Path(str(case.settings["been_file"])).open("a+") as file:
        file.write("x")
        return file.tell() <= times

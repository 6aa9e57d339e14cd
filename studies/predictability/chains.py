"""Chains over the crank's speed, up and down: where they end in other motions there is hysteresis."""

from engine_models.engine import RunSettings
from engine_models.reference.watch import SPEED, Watch
from studies.predictability.diagrams import ROOM_M, RUNG, SPEEDS
from studies.predictability.scenes import following, period_s, set_r
from studies.predictability.sweeps.chunk import Chunk, Direction, run_chunk
from studies.predictability.sweeps.ranges import Range
from studies.predictability.sweeps.task import Task
from studies.running.case import Case, Curves, Row

PART = "chain over crank speed"
DIRECTIONS: tuple[Direction, ...] = ("up", "down")
#: Ends of the speeds in rad/s: 950 to 7600 rev/min.
SPEEDS_RAD_S = (100.0, 800.0)
#: Members of a chain, revolutions left out and shown: short ones take a core for some seconds, long ones,
#: beside other work, for some four minutes.
SHORT: Row = {"columns": 24, "transient": 8, "revolutions": 12}
LONG: Row = {"columns": 100, "transient": 30, "revolutions": 30}


def cases() -> list[Case]:
    """Return a case for each direction and size."""
    return [_case(size, direction) for size in (SHORT, LONG) for direction in DIRECTIONS]


def measure(case: Case) -> tuple[Row, Curves]:
    """Run a chain; curves are by speed as it goes, and the strobe's one member after the other."""
    of = case.columns
    speeds = Range(*SPEEDS_RAD_S, log=False, count=int(str(of["columns"]))).spaced()
    direction: Direction = "up" if of["direction"] == "up" else "down"
    watch = Watch(float(str(of["transient"])), float(str(of["revolutions"])), exponent=True)
    task = Task(case.scene, case.engine, case.settings, None, watch)
    chunk = Chunk(0, {SPEED: speeds if direction == "up" else speeds[::-1]}, direction)
    found = run_chunk(task, chunk).to_pandas()
    ok = found[found["status"] == "ok"]
    curves = {name: ok[name].to_numpy() for name in (SPEED, "impacts_per_revolution", "exponent_1_s")}
    curves["value"] = curves.pop(SPEED)
    return {"failed_members": len(found) - len(ok)}, curves | {
        "strobe_m": ok["strobe_m"].explode().to_numpy(float)
    }


def _case(size: Row, direction: Direction) -> Case:
    turns = int(str(size["transient"])) + int(str(size["revolutions"]))
    scene = following(set_r(ROOM_M[SPEEDS]), turns)
    columns: Row = {"part": PART, "direction": direction, **size}
    run = RunSettings(turns * period_s(scene), 1)
    return Case("predictability", scene, RUNG.arm, run, RUNG.added, columns=columns)

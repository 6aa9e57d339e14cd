"""Bifurcation diagrams over clearance and speed, and a map of exponents and forces over both, by columns.

A column is a member of a sweep: one value, followed for some revolutions after a transient. Its exponent is
measured twice, over all of its revolutions and over half of them: where the two agree it has converged.
"""

import numpy as np
import pandas as pd

from engine_models import arms
from engine_models.engine import FloatArray, RunSettings
from engine_models.reference.watch import Watch
from engine_models.scene.scene import Scene
from studies.ladders import Rung
from studies.predictability.scenes import following, period_s, set_r, turning
from studies.predictability.sweeps.chunk import Chunk, run_chunk
from studies.predictability.sweeps.ranges import Range
from studies.predictability.sweeps.task import Task
from studies.running.case import Case, Curves, Row

#: The parts, and the field that goes from column to column in each.
CLEARANCES, SPEEDS, MAP = "diagram over clearance", "diagram over crank speed", "map of exponents"
CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"
FIELDS = {CLEARANCES: CLEARANCE, SPEEDS: SPEED, MAP: CLEARANCE}
#: Ends of both, in m and rad/s: 500 to 8000 rev/min.
CLEARANCES_M, SPEEDS_RAD_S = (1e-5, 1e-3), (500 * 2 * np.pi / 60, 8000 * 2 * np.pi / 60)
#: Clearances in m of the two diagrams' scenes; the first one's is replaced in every column.
ROOM_M = {CLEARANCES: 5e-4, SPEEDS: 1e-4}
#: Columns in all and in a case, revolutions left out and shown; which of the columns have an exponent, and
#: over how many revolutions. Quick and full: with the map a quarter of an hour on two cores, as a turn of a
#: member takes 2 ms, or 4 to 5 with its exponent.
SIZES: dict[bool, Row] = {
    False: {
        "columns": 100,
        "in_case": 50,
        "transient": 8,
        "revolutions": 12,
        "exponent_every": 5,
        "exponent_revolutions": 24,
    },
    True: {
        "columns": 1000,
        "in_case": 50,
        "transient": 30,
        "revolutions": 100,
        "exponent_every": 10,
        "exponent_revolutions": 100,
    },
}
#: Of the map: clearances and speeds, a case for each speed.
MAP_SIZE: Row = {
    "columns": 60,
    "in_case": 60,
    "transient": 8,
    "revolutions": 24,
    "exponent_every": 1,
    "exponent_revolutions": 24,
}
#: Loose: of a chaotic motion no tolerance gives the one of this start. Where chaos is transient, when it ends
#: is as much chance as the start.
RUNG = Rung(arms.REFERENCE_DOP853, 1.0, {"step_tolerance": 1e-6})


def cases(full: bool) -> list[Case]:
    """Return the stretches of the diagrams, and the map's rows; the quick set has one short diagram."""
    sizes = [SIZES[False], *([SIZES[True]] if full else [])]
    out = [
        case
        for part, room in ROOM_M.items()
        if full or part == CLEARANCES
        for size in sizes
        for case in _stretches(part, set_r(room), size)
    ]
    if full:
        speeds = Range(*SPEEDS_RAD_S, log=False, count=int(str(MAP_SIZE["columns"]))).spaced()
        scene = set_r(ROOM_M[CLEARANCES])
        out += [case for speed in speeds for case in _stretches(MAP, turning(scene, float(speed)), MAP_SIZE)]
    return out


def measure(case: Case) -> tuple[Row, Curves]:
    """Run a stretch of columns; curves are by column, and the strobe's one column after the other."""
    every = columns_of(case)[:: int(_number(case, "exponent_every"))]
    used, turns = _number(case, "exponent_revolutions"), int(_number(case, "revolutions"))
    whole, half = (_rows(case, every, part, exponent=True) for part in (used, used / 2))
    of_all = len(every) == len(columns_of(case)) and used == turns
    found = whole if of_all else _rows(case, columns_of(case), turns)
    strobe = [np.array(each) if len(each) else np.full(turns, np.nan) for each in found["strobe_m"]]
    curves = {
        "value": columns_of(case),
        "strobe_m": np.concatenate(strobe),
        "impacts_per_revolution": found["impacts_per_revolution"].to_numpy(),
        "largest_contact_force_N": found["largest_contact_force_N"].to_numpy(),
        "exponent_value": every,
        "exponent_1_s": whole["exponent_1_s"].to_numpy(),
        "exponent_half_1_s": half["exponent_1_s"].to_numpy(),
    }
    row: Row = {"crank_speed_rad_s": case.plain_scene.start.crank_speed_rad_s}
    row["failed_members"] = int((found["status"] != "ok").sum() + (whole["status"] != "ok").sum())
    return row, curves


def _stretches(part: str, scene: Scene, size: Row) -> list[Case]:
    columns, in_case = (int(str(size[name])) for name in ("columns", "in_case"))
    turns = int(str(size["transient"])) + int(str(size["revolutions"]))
    long = following(scene, turns)
    return [
        Case(
            "predictability",
            long,
            RUNG.arm,
            RunSettings(turns * period_s(scene), 1),
            RUNG.added,
            columns={"part": part, "first": first, **size},
        )
        for first in range(0, columns, in_case)
    ]


def columns_of(case: Case) -> FloatArray:
    """Return the values of a case's columns."""
    over_clearance = FIELDS[str(case.columns["part"])] == CLEARANCE
    ends, columns = CLEARANCES_M if over_clearance else SPEEDS_RAD_S, int(_number(case, "columns"))
    first, count = int(_number(case, "first")), int(_number(case, "in_case"))
    return Range(*ends, log=over_clearance, count=columns).spaced()[first : first + count]


def _rows(case: Case, values: FloatArray, revolutions: float, exponent: bool = False) -> pd.DataFrame:
    watch = Watch(_number(case, "transient"), revolutions, exponent)
    task = Task(case.scene, case.engine, case.settings, None, watch)
    rows: pd.DataFrame = run_chunk(task, Chunk(0, {FIELDS[str(case.columns["part"])]: values})).to_pandas()
    return rows


def _number(case: Case, name: str) -> float:
    return float(str(case.columns[name]))

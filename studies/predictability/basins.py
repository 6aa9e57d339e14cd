"""Basins of attraction: which motion a mechanism is in after some turns, by where its pin began."""

import numpy as np

from engine_models.engine import FloatArray, RunSettings
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.mechanics.joints import SLIDER
from engine_models.reference.watch import Watch
from studies.predictability.diagrams import ROOM_M, RUNG, SPEEDS
from studies.predictability.scenes import following, period_s, set_r, turning
from studies.predictability.sweeps.chunk import Chunk, run_chunk
from studies.predictability.sweeps.ranges import Range
from studies.predictability.sweeps.task import Task
from studies.running.case import Case, Curves, Row

PART = "basins of attraction"
#: Fields of the start that differ: place and speed of the slider, and so of its bearing about the pin.
PLACE, RATE = "start.slider.x_m", "start.slider.velocity_x_m_s"
#: The speed of the crank: there set R ends at the wall from some starts and goes on knocking from others.
SPEED_RAD_S = 441.0
#: Places on either side of the middle, in clearances, and speeds in m/s.
REACH, RATE_M_S = 0.9, 0.5
#: Starts of each field and in a case, revolutions left out and shown: a member's turn takes 2 ms.
FEW: Row = {"columns": 10, "in_case": 50, "transient": 24, "revolutions": 8}
MANY: Row = {"columns": 40, "in_case": 100, "transient": 40, "revolutions": 12}


def cases() -> list[Case]:
    """Return stretches of the starts, few of them and many."""
    return [case for size in (FEW, MANY) for case in _stretches(size)]


def measure(case: Case) -> tuple[Row, Curves]:
    """Run a stretch of starts; curves are by member, and the strobe's one member after the other."""
    of = case.columns
    watch = Watch(float(str(of["transient"])), float(str(of["revolutions"])))
    task = Task(case.scene, case.engine, case.settings, None, watch)
    place, rate = starts_of(case)
    found = run_chunk(task, Chunk(0, {PLACE: place, RATE: rate})).to_pandas()
    ok = (found["status"] == "ok").to_numpy()
    curves = {
        "place_m": place[ok],
        "rate_m_s": rate[ok],
        "impacts_per_revolution": found["impacts_per_revolution"].to_numpy()[ok],
        "strobe_m": found["strobe_m"][ok].explode().to_numpy(float),
    }
    return {"failed_members": int((~ok).sum())}, curves


def starts_of(case: Case) -> tuple[FloatArray, FloatArray]:
    """Return places in m and speeds in m/s of the slider at the start of a case's members."""
    count, first, taken = (int(str(case.columns[name])) for name in ("columns", "first", "in_case"))
    middle, room = start_state(case.scene)[0][SLIDER, 0], REACH * ROOM_M[SPEEDS]
    places = Range(middle - room, middle + room, log=False, count=count).spaced()
    rates = Range(-RATE_M_S, RATE_M_S, log=False, count=count).spaced()
    place, rate = (each.ravel()[first : first + taken] for each in np.meshgrid(places, rates, indexing="ij"))
    return place, rate


def _stretches(size: Row) -> list[Case]:
    columns, in_case, *turns = (int(str(number)) for number in size.values())
    scene = following(turning(set_r(ROOM_M[SPEEDS]), SPEED_RAD_S), sum(turns))
    scene = started_from(scene, *start_state(scene))  # each body has a start of its own then
    run = RunSettings(sum(turns) * period_s(scene), 1)
    firsts = range(0, columns**2, in_case)
    parts: list[Row] = [{"part": PART, "first": first, **size} for first in firsts]
    return [Case("predictability", scene, RUNG.arm, run, RUNG.added, columns=part) for part in parts]

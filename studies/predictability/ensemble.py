"""A member of an ensemble: a sweep's row of what it did past the horizon, and the phases of its impacts.

Impacts within a member are correlated, so a member is one draw of each number, and intervals and tests are
made over members.
"""

import math

import numpy as np

from engine_models.engine import SimulationFailed
from engine_models.engines import make_engine
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.members import LISTS, Members, supports
from engine_models.reference.members import Row as SweepRow
from engine_models.reference.watch import Watch
from studies.judges.metrics import checked
from studies.predictability.sweeps.gathered import gathered
from studies.running.case import Case, Curves, Row

#: Revolutions left out and used. What has begun anywhere has forgotten it after the four; over eight, means
#: of 200 members are known to a third of their margins.
WATCH = Watch(transient=4, revolutions=8)


def measure(case: Case) -> tuple[Row, Curves]:
    """Run a member: the reference's in the loop of sweeps where that can, any other by the engine's own call.

    The phase of an impact is the crank angle at touch; its mean is that of cosine and sine, since angles go
    round.
    """
    found, check = _ran(case)
    phase = np.array(found["impact_phase_rad"], dtype=float)
    row: Row = {"revolutions": WATCH.revolutions, **check}
    row |= {
        name: float(value)
        for name, value in found.items()
        if name not in LISTS and isinstance(value, float) and math.isfinite(value)
    }
    if len(phase):
        row |= {"impact_phase_cosine": float(np.cos(phase).mean())}
        row |= {"impact_phase_sine": float(np.sin(phase).mean())}
    return row, {"impact_phase_rad": phase}


def _ran(case: Case) -> tuple[SweepRow, Row]:
    """Return a sweep's row of a member, and what the check of its samples says, if it has any."""
    engine, scene = make_engine(case.engine, **case.settings), case.plain_scene
    if not (isinstance(engine, ReferenceEngine) and supports(engine, scene, [])):
        run = engine.simulate(scene, case.run)
        return gathered(WATCH, scene, run), checked(scene, run)
    found, _ = Members(engine, scene, {}, WATCH, case.run.step_s).followed({})
    if found["status"] != "ok":
        raise SimulationFailed(str(found["reason"]))
    return found, {}

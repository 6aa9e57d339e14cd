"""Local errors: an engine begun again and again from the converged solution's state, over one impact each.

A global error past a grazing impact says who was unlucky, a median of local ones who is accurate.
"""

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.assembly import started_from
from engine_models.scene.parts import AnyScene
from studies.judges.metrics import in_flight
from studies.running.case import Row

#: Most restarts in a run.
RESTARTS = 12


def windows(truth: Trajectory, until: int) -> NDArray[np.intp]:
    """Return pairs of samples, (w, 2), before ``until`` at which every pin flies, with a touch between them.

    The first is the last such sample before the touch, the second the next one after it: contacts remember
    how they began, so a run can only begin in flight.
    """
    places = np.flatnonzero(in_flight(truth)[:until])
    touches = np.sort(np.concatenate([contact.impacts.time_s for contact in truth.contacts.values()]))
    touched = np.diff(np.searchsorted(touches, truth.time_s[places])) > 0
    pairs = np.stack([places[:-1], places[1:]], axis=-1)[touched]
    some = np.linspace(0, len(pairs) - 1, min(RESTARTS, len(pairs))).astype(int)
    return np.asarray(pairs[some])


def local_errors(engine: Engine, scene: AnyScene, truth: Trajectory, run: RunSettings, until: int) -> Row:
    """Return median and largest error of position over one window, and how many windows there are.

    Of all bodies' centres of mass the largest error counts: an impact at O moves the slider late.

    ``truth`` is the converged solution of the law that the engine really solves in the scene; windows are
    those of ``windows``.
    """
    step = run.step_used_s(scene.end_time_s)
    pairs, errors = windows(truth, until), []
    for k, m in pairs:
        now, length = float(truth.time_s[k]), float(truth.time_s[m] - truth.time_s[k])
        begun = started_from(scene, truth.position[k], truth.velocity[k], now, length)
        try:
            end = engine.simulate(begun, RunSettings(step, 1))
        except SimulationFailed:
            continue
        off = end.position[-1, :, :2] - truth.position[m, :, :2]
        errors.append(float(np.hypot(off[:, 0], off[:, 1]).max()))
    row: Row = {"restarts": len(pairs), "failed_restarts": len(pairs) - len(errors)}
    if errors:
        row["local_position_error_m"] = float(np.median(errors))
        row["largest_local_position_error_m"] = float(np.max(errors))
    return row

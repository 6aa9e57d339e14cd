"""The run of a Pymunk space, block by block, through the compiled loop."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymunk
from numba import types
from numpy.typing import NDArray
from pymunk._chipmunk_cffi import ffi, lib

from engine_models.engine import FloatArray, RunSettings
from engine_models.kernels import callback
from engine_models.mechanics.loads import integrated_works
from engine_models.progress import tell
from engine_models.pymunk.compiled import loop
from engine_models.pymunk.inputs import Inputs
from engine_models.pymunk.joints.plan import Plan
from engine_models.pymunk.joints.sweeps import Convergence
from engine_models.pymunk.model import Bodies
from engine_models.pymunk.self_test import require_usable
from engine_models.pymunk.workspace import Workspace
from engine_models.scene.scene import Scene

#: Sweeps in the first kicks of a half-kick start (see ``loop.START_KICKS``). They have no impulses of a like
#: step to start from: kick 0 none at all, kicks 1 to 3 those of an unlike one; 3 to 5 share in telling the
#: force at t = 0 (see PymunkEngine). 100 sweeps are enough. The change to fewer leaves a ripple of some 1e-4
#: of the force at dt = 5e-5 s, of order 1, for the next eight kicks; with a single sweep it is 1e-2.
START_ITERATIONS = 200
#: What is enough of them leaves of an open joint.
LEFT_AT_START = 1e-10
#: The number of a kick that no run comes to.
NEVER = 2**62
#: Of a body and a step.
POSITION_UPDATE = types.void(types.uintp, types.float64)


@dataclass(frozen=True)
class Model:
    """A scene in Pymunk at t = 0: its plan, space and bodies, what they are given, and the memory of its run.

    ``start`` (bodies, 3) are the positions of the centres of mass. Steps in contact are ``shorter`` so many
    times.
    """

    scene: Scene
    plan: Plan
    start: FloatArray
    space: pymunk.Space
    bodies: Bodies
    inputs: Inputs
    workspace: Workspace
    convergence: Convergence
    half_kick_start: bool
    shorter: float


@dataclass(frozen=True)
class Block:
    """Kicks that are taken, and then worked off, together.

    ``rows`` (n,) of ``records.ROW`` are those of which results are kept, with positions and velocities before
    and after of the bodies' origins, (n, bodies, 3) each; accelerations are the changes of these over the
    time that loads act. ``begin`` has those of the first kicks, (START_KICKS, bodies, 3), in the first block.
    """

    rows: NDArray[Any]
    position: FloatArray
    before: FloatArray
    after: FloatArray
    acceleration: FloatArray
    begin: FloatArray | None

    @property
    def kick_s(self) -> FloatArray:
        """How long loads act in each kick, (n, 1, 1)."""
        return np.asarray(self.rows["kick_s"][:, None, None])


def run(model: Model, settings: RunSettings, work_off: Callable[[Block], None], bare: bool = False) -> float:
    """Step the space through the blocks; a ``bare`` run keeps what there is at its samples alone.

    Returns:
        The wall time in s of the compiled loop, which steps and reads.

    Raises:
        SimulationFailed: a pin went through the wall of its bearing, or a contact's numbers overflowed.
        UnsupportedScene: the installed Pymunk is not what the loop has been written for.
    """
    require_usable()
    work, state, end_s = model.workspace, model.workspace.run[0], model.scene.end_time_s
    driven, step_s = model.start[model.scene.mechanism.drive.body], settings.step_used_s(end_s)
    per_sample, varies = settings.steps_per_sample(end_s), model.shorter > 1
    state["half_kick_start"] = model.half_kick_start
    state["flight_s"], state["contact_s"] = step_s, step_s / model.shorter
    state["interval_s"], state["samples"] = end_s / settings.samples, settings.samples
    state["per_sample"], state["end"] = (0, NEVER) if varies else (per_sample, settings.samples * per_sample)
    # Works need forces and torques at every step, and so do samples between steps.
    every_step = not bare and (integrated_works(model.scene) or settings.at_s)
    state["every"] = 1 if every_step else state["per_sample"]

    def advance(last: int) -> float:
        steps = np.arange(state["kick"] + 1, last + 1)
        return work.advance(last, model.inputs.turns(steps, step_s, driven))

    if model.half_kick_start:
        rigid = any(room.law == "rigid" for room in model.scene.clearances.values())
        most = START_ITERATIONS if rigid else min(START_ITERATIONS, model.convergence.sweeps(LEFT_AT_START))
        model.space.iterations = max(model.space.iterations, most)
    with _staying(model.bodies):
        solve_time = advance(0)
    last = work.block_kicks - 1
    while True:
        solve_time += advance(last)
        work_off(_block(work, last < work.block_kicks))
        tell(float(state["time_s"]))
        if state["kick"] < last or state["kick"] >= state["end"]:
            return solve_time
        last += work.block_kicks


def _block(work: Workspace, begins: bool) -> Block:
    """Return what has been read of a block."""
    count = int(work.run[0]["row"])
    work.run["row"] = 0
    rows, out = work.rows[:count], work.out[:count, work.row_of]
    acceleration = (out[..., 6:] - out[..., 3:6]) / rows["kick_s"][:, None, None]
    position, before, after = (out[rows["kept"], :, column : column + 3] for column in (0, 3, 6))
    begin = acceleration[: loop.START_KICKS] if begins else None
    return Block(rows[rows["kept"]], position, before, after, acceleration[rows["kept"]], begin)


@contextmanager
def _staying(bodies: Sequence[pymunk.Body]) -> Iterator[None]:
    """Have bodies not move in a step."""
    function = callback(loop.stay, POSITION_UPDATE)
    for body in bodies:
        pointer = ffi.cast("cpBodyPositionFunc", function.address)
        lib.cpBodySetPositionUpdateFunc(body._body, pointer)
    yield
    for body in bodies:
        lib.cpBodySetPositionUpdateFunc(body._body, ffi.addressof(lib, "cpBodyUpdatePosition"))

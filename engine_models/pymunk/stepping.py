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
from engine_models.progress import tell
from engine_models.pymunk.compiled import loop
from engine_models.pymunk.model import Bodies
from engine_models.pymunk.self_test import require_usable
from engine_models.pymunk.step_inputs import StepInputs
from engine_models.pymunk.works import add_up
from engine_models.pymunk.workspace import Workspace
from engine_models.reference.kernels import callback
from engine_models.scene.scene import Scene

#: Sweeps in the first kicks of a half-kick start (see ``loop.START_KICKS``). They have no impulses of a like
#: step to start from: kick 0 none at all, kicks 1 and 2 those of an unlike one; 3 and 4 share in telling the
#: force at t = 0 (see PymunkEngine). 100 sweeps are enough. The change to fewer leaves a ripple of some 1e-4
#: of the force at dt = 5e-5 s, of order 1, for the next eight kicks.
START_ITERATIONS = 200
#: The number of a kick that no run comes to.
NEVER = 2**62
#: Of a body and a step.
POSITION_UPDATE = types.void(types.uintp, types.float64)


@dataclass(frozen=True)
class Model:
    """A scene in Pymunk at t = 0: its space and bodies, and the memory of its run."""

    scene: Scene
    space: pymunk.Space
    bodies: Bodies
    workspace: Workspace


@dataclass(frozen=True)
class Block:
    """Kicks that are taken, and then worked off, together.

    ``rows`` (n,) of ``records.ROW`` are those of which results are kept, with positions and velocities before
    and after, (n, bodies, 3) each; accelerations are the changes of these over the time that loads act.
    ``begin`` has those of the first kicks, (START_KICKS, bodies, 3), in the first block.
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


class Timing:
    """The steps of a run: of one length, or in contact and before it ``shorter`` times as short."""

    def __init__(self, scene: Scene, settings: RunSettings, shorter: float = 1.0) -> None:
        self.step_s = settings.step_used_s(scene.end_time_s)
        self._scene, self._samples, self._contact_s = scene, settings.samples, self.step_s / shorter
        self._every_step = add_up(scene) or bool(settings.at_s)
        self._per_sample = settings.steps_per_sample(scene.end_time_s)

    def set(self, run: NDArray[Any]) -> None:
        """Set the steps of a run (1,) of ``records.RUN``."""
        run["flight_s"], run["contact_s"] = self.step_s, self._contact_s
        run["interval_s"], run["samples"] = self._scene.end_time_s / self._samples, self._samples
        varies, end = self._contact_s < self.step_s, self._samples * self._per_sample
        run["per_sample"], run["end"] = (0, NEVER) if varies else (self._per_sample, end)
        # Works need forces and torques at every step, and so do samples between steps.
        run["every"] = 1 if self._every_step else run["per_sample"]


def run(model: Model, timing: Timing, half_kick_start: bool, work_off: Callable[[Block], None]) -> float:
    """Step the space through the blocks.

    Returns:
        The wall time in s of the compiled loop, which steps and reads.

    Raises:
        SimulationFailed: a pin went through the wall of its bearing, or a contact's numbers overflowed.
        UnsupportedScene: the installed Pymunk is not what the loop has been written for.
    """
    require_usable()
    work, state = model.workspace, model.workspace.run[0]
    inputs = StepInputs(model.scene, float(model.bodies[0].angle), timing.step_s)
    timing.set(work.run)
    state["half_kick_start"] = half_kick_start
    state["torque_N_m"], state["force_N"] = inputs.torque_N_m, inputs.force_N
    gas = inputs.gas_table()

    def advance(last: int) -> float:
        return work.advance(last, inputs.turns(np.arange(state["kick"] + 1, last + 1)), gas)

    if half_kick_start:
        model.space.iterations = max(model.space.iterations, START_ITERATIONS)
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
    rows, out = work.rows[:count], work.out[:count]
    acceleration = (out[..., 6:] - out[..., 3:6]) / rows["kick_s"][:, None, None]
    position, before, after = (out[rows["kept"], :, column : column + 3] for column in (0, 3, 6))
    begin = acceleration[: loop.START_KICKS] if begins else None
    return Block(rows[rows["kept"]], position, before, after, acceleration[rows["kept"]], begin)


@contextmanager
def _staying(bodies: Sequence[pymunk.Body]) -> Iterator[None]:
    """Have bodies not move in a step."""
    function = callback(loop.stay, POSITION_UPDATE)
    for body in bodies:
        pointer = ffi.cast("cpBodyPositionFunc", function.__wrapper_address__())
        lib.cpBodySetPositionUpdateFunc(body._body, pointer)
    yield
    for body in bodies:
        lib.cpBodySetPositionUpdateFunc(body._body, ffi.addressof(lib, "cpBodyUpdatePosition"))

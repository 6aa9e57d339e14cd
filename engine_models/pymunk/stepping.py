"""The loop that steps a Pymunk space block by block and reads it; no exception of a callback gets lost."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

import numpy as np
import pymunk
from numpy.typing import NDArray
from pymunk import batch

from engine_models.engine import FloatArray, RunSettings, SimulationFailed
from engine_models.progress import tell
from engine_models.pymunk.model import Bodies, Model
from engine_models.pymunk.pin import PinLost
from engine_models.pymunk.step_inputs import Input, StepInputs
from engine_models.pymunk.works import add_up
from engine_models.scene.scene import Scene

#: Steps that are worked off at once.
BLOCK_STEPS = 16_384
#: Sweeps in the first kicks of a half-kick start. They have no impulses of a like step to start from: kick 0
#: none at all, kicks 1 and 2 those of an unlike one; 3 and 4 share in telling the force at t = 0 (see
#: PymunkEngine). 100 sweeps are enough. The change to fewer leaves a ripple of some 1e-4 of the force at
#: dt = 5e-5 s, of order 1, for the next eight kicks.
START_ITERATIONS, START_KICKS = 200, 5

STATE = (
    batch.BodyFields.POSITION
    | batch.BodyFields.ANGLE
    | batch.BodyFields.VELOCITY
    | batch.BodyFields.ANGULAR_VELOCITY
)


@dataclass(frozen=True)
class Block:
    """Steps that are taken, and then worked off, together: up to ``last``.

    ``wanted`` are those of which results are kept, ``read`` those whose states it takes for that.
    """

    last: int
    wanted: NDArray[np.int64]
    read: NDArray[np.int64]


class Timing:
    """The steps of a run, in blocks: which of them are wanted, and which of those are samples."""

    def __init__(self, scene: Scene, settings: RunSettings) -> None:
        self.per_sample = settings.steps_per_sample(scene.end_time_s)
        self.dt, self.steps = settings.step_used_s(scene.end_time_s), settings.samples * self.per_sample
        # Works need forces and torques at every step, all else is asked for at the samples alone.
        self._every = 1 if add_up(scene) else self.per_sample

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks, in order; memory holds no more of a run than one of them, and the samples."""
        for first in range(0, self.steps + 1, BLOCK_STEPS):
            last = min(first + BLOCK_STEPS - 1, self.steps)
            wanted, ahead = self._wanted(first, last), self._wanted(first + 1, last + 1)
            # The step before a wanted one tells the kick, the first few what kicks 0 and 1 should have been.
            read = np.concatenate([wanted, ahead[ahead <= self.steps] - 1, np.arange(0 if first else 5)])
            yield Block(last, wanted, np.unique(read))

    def times_s(self, steps: NDArray[np.int64]) -> FloatArray:
        """Return the times in s of steps (n,), counted from the start."""
        return np.asarray(self.dt * steps, dtype=np.float64)

    def _wanted(self, first: int, last: int) -> NDArray[np.int64]:
        every = self._every
        return np.arange(-(-first // every) * every, last + 1, every)


def run(
    model: Model,
    timing: Timing,
    half_kick_start: bool,
    work_off: Callable[[Block, FloatArray, FloatArray], None],
) -> float:
    """Step the space through the blocks, the first of which reads step 0 (before the first step) to step 4.

    ``work_off`` gets a block with its states as Pymunk stores them, each (reads, bodies, 3): positions and
    velocities of crank, rod, slider by (x, y, phi) of the body's origin.

    Returns:
        The wall time in s of the calls of ``space.step`` and what must go with each (the loop, what has to be
        set again, contacts' callbacks), without the reading and the work.

    Raises:
        SimulationFailed: a pin went through the wall of its bearing, or a contact's numbers overflowed.
        BaseException: whatever else a callback raised, or a signal's handler while one ran.
    """
    space, bodies, dt, inputs = model.space, model.bodies, timing.dt, StepInputs(model, timing.dt)
    log, (listed, order) = batch.Buffer(), _order_of_reading(space, bodies)
    iterations, done, solve_time = space.iterations, 0, 0.0
    with _exceptions_of_callbacks() as raised:

        def advance(step_s: float, first: int, last: int, given: Sequence[Input]) -> float:
            step = space.step
            started = perf_counter()
            for k in range(first, last + 1):
                for give in given:
                    give(k)
                step(step_s)
                if raised:
                    _raise(raised, k * dt)
            return perf_counter() - started

        if half_kick_start:
            space.iterations = max(iterations, START_ITERATIONS)
            for body in bodies:
                body.position_func = _stay
            solve_time += advance(dt / 2, 0, 0, inputs.of(0, 0))
            for body in bodies:
                body.position_func = pymunk.Body.update_position
        for block in timing.blocks():
            log.clear()
            reads, given = block.read.tolist(), inputs.of(done + 1, block.last)
            for number, target in enumerate([*reads, block.last]):
                if done == START_KICKS - 1:
                    space.iterations = iterations
                solve_time += advance(dt, done + 1, target, given)
                done = max(done, target)
                if number < len(reads):
                    batch.get_space_bodies(space, STATE, log)
            states = np.frombuffer(bytes(log.float_buf())).reshape(len(block.read), listed, 6)[:, order]
            work_off(block, states[:, :, :3], states[:, :, 3:])
            tell(block.last * dt)
    return solve_time


@contextmanager
def _exceptions_of_callbacks() -> Iterator[list[BaseException]]:
    """Give the list that exceptions of callbacks go to: left alone, they are printed and forgotten."""
    raised: list[BaseException] = []
    before = sys.unraisablehook

    def keep(unraisable: "sys.UnraisableHookArgs") -> None:
        if unraisable.exc_value is not None:
            raised.append(unraisable.exc_value)

    sys.unraisablehook = keep
    try:
        yield raised
    finally:
        sys.unraisablehook = before


def _raise(raised: Sequence[BaseException], time_s: float) -> None:
    """Raise the first of the callbacks' exceptions; one that is no failure of the run comes before."""
    for error in raised:
        if not isinstance(error, (PinLost, ArithmeticError)):
            raise error
    raise SimulationFailed(f"{raised[0]} at t = {time_s:.6g} s") from raised[0]


def _stay(body: pymunk.Body, dt: float) -> None:
    """Leave the body where it is: the position update of a step that only kicks."""


def _order_of_reading(space: pymunk.Space, bodies: Bodies) -> tuple[int, list[int]]:
    """Return how many bodies a batch reading of the space has, and where these stand in it."""
    ids = batch.Buffer()
    batch.get_space_bodies(space, batch.BodyFields.BODY_ID, ids)
    listed = memoryview(ids.int_buf()).cast("P").tolist()
    return len(listed), [listed.index(body.id) for body in bodies]

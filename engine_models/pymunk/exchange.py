"""What compiled code and a space tell each other: the buffers of Pymunk's iterators."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pymunk
from pymunk import batch
from pymunk._chipmunk_cffi import ffi

from engine_models.engine import FloatArray
from engine_models.pymunk.compiled.chipmunk import BODY, IO, LOAD

#: What of a body is read, its position and velocity as x, y, phi each; set as loads; and turned.
STATE = (
    batch.BodyFields.POSITION
    | batch.BodyFields.ANGLE
    | batch.BodyFields.VELOCITY
    | batch.BodyFields.ANGULAR_VELOCITY
)
LOADS = batch.BodyFields.FORCE | batch.BodyFields.TORQUE
TURN = batch.BodyFields.ANGLE | batch.BodyFields.ANGULAR_VELOCITY
#: The iterators take a buffer for full some numbers before it is.
SPARE = 16


def address(pointer: Any) -> int:
    """Return a C pointer, or the place of an array's numbers, as a number."""
    return int(pointer.ctypes.data if isinstance(pointer, np.ndarray) else ffi.cast("uintptr_t", pointer))


class Batch:
    """A NumPy array that Pymunk's iterators read or write, and its ``BUFFER`` record."""

    def __init__(self, fields: Any, numbers: int) -> None:
        self.numbers: FloatArray = np.zeros(numbers + SPARE)
        self._array, self._data = ffi.new("pmFloatArray *"), ffi.new("pmBatchedData *")
        self._array.arr = ffi.from_buffer("double[]", self.numbers)
        self._array.max = len(self.numbers)
        self._data.floatArray, self._data.fields = self._array, fields.value
        count = address(self._array) + ffi.offsetof("pmFloatArray", "num")
        self.record = address(self._data), count


class Exchange:
    """What compiled code and a space tell each other: the states, loads and turns of some of its bodies.

    ``record`` (1,) of ``IO`` and the addresses ``bodies`` (n,) are for compiled code. The state has one more
    row, of zeros, for the ground.
    """

    def __init__(self, space: pymunk.Space, bodies: Sequence[pymunk.Body]) -> None:
        self._space, self._bodies, n = space, bodies, len(bodies)
        self.state, self.loads, self.turn = Batch(STATE, 6 * (n + 1)), Batch(LOADS, 3 * n), Batch(TURN, 2)
        self.bodies = np.array([address(body._body) for body in bodies], dtype=np.uintp)
        self.state_of = self.state.numbers[: 6 * (n + 1)].view(BODY)
        self.loads_of = self.loads.numbers[: 3 * n].view(LOAD)
        self.record = np.zeros(1, IO)
        self.record["space"] = address(space._space)
        for name in ("state", "loads", "turn"):
            self.record[name] = getattr(self, name).record

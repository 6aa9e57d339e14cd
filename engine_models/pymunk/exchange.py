"""What compiled code and a space tell each other: the buffers of Pymunk's iterators."""

from typing import Any

import numpy as np
from pymunk import batch
from pymunk._chipmunk_cffi import ffi

from engine_models.engine import FloatArray

#: What of a body is read, its position and velocity as x, y, phi each; set as loads; turned; and slid.
STATE = (
    batch.BodyFields.POSITION
    | batch.BodyFields.ANGLE
    | batch.BodyFields.VELOCITY
    | batch.BodyFields.ANGULAR_VELOCITY
)
LOADS = batch.BodyFields.FORCE | batch.BodyFields.TORQUE
TURN = batch.BodyFields.ANGLE | batch.BodyFields.ANGULAR_VELOCITY
SLIDE = batch.BodyFields.POSITION | batch.BodyFields.VELOCITY
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

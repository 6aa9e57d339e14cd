"""Data with its numbers replaced: by parameters, for the tape, or by marks, to tell topologies apart."""

import copy
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

T = TypeVar("T")

#: In the metadata of a dataclass's field: numbers that the code is written for, rather than given.
WRITTEN_OUT = "written out"


def lifted(data: T, number: Callable[[float], Any], written_out: tuple[float, ...] = ()) -> T:
    """Return dataclasses and tuples with every number replaced, in order; zeros and ``written_out`` stay.

    What equals zero is structure: a point at the centre of mass, a law without damping.
    """
    if isinstance(data, float):
        return 0.0 if data == 0 else data if data in written_out else number(data)  # type: ignore[return-value]
    if isinstance(data, tuple):
        return tuple(lifted(part, number, written_out) for part in data)  # type: ignore[return-value]
    if not is_dataclass(data):
        return data
    new = copy.copy(data)
    for field in fields(data):
        value = lifted(getattr(data, field.name), number, field.metadata.get(WRITTEN_OUT, ()))
        object.__setattr__(new, field.name, value)  # frozen, and validated when it was made
    return new

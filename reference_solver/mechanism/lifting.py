"""Data with its numbers replaced: by parameters, for the tape, or by marks, to tell topologies apart."""

import copy
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeVar

from reference_solver.mechanism.motions import PiecewiseCubic

T = TypeVar("T")

#: In the metadata of a dataclass's field: numbers that the code is written for, rather than given.
WRITTEN_OUT = "written out"


def lifted(
    data: T,
    number: Callable[[float], Any],
    written_out: tuple[float, ...] = (),
    placed: Callable[[PiecewiseCubic], Any] = PiecewiseCubic.placed,
) -> T:
    """Return dataclasses and tuples with every number replaced, in order; zeros and ``written_out`` stay.

    What equals zero is structure: a point at the centre of mass, a law without damping. Of a table, of which
    a kernel has no input for each number, those of its place are replaced, as ``placed`` gives it.
    """
    if isinstance(data, float):
        return 0.0 if data == 0 else data if data in written_out else number(data)  # type: ignore[return-value]
    if isinstance(data, tuple):
        return tuple(lifted(part, number, written_out, placed) for part in data)  # type: ignore[return-value]
    if isinstance(data, PiecewiseCubic):
        return lifted(placed(data), number)  # type: ignore[no-any-return]
    kind: Any = type(data)
    parts = _fields(kind)
    if not parts:
        return data
    new = copy.copy(data)
    for name, of_field in parts:
        value = lifted(getattr(data, name), number, of_field, placed)
        object.__setattr__(new, name, value)  # the copy of frozen data
    return new


@cache
def _fields(kind: Any) -> tuple[tuple[str, tuple[float, ...]], ...]:
    """Return the names of a dataclass's fields with the numbers written out in them; nothing of others.

    Fields that do not count where two are compared are none.
    """
    if not is_dataclass(kind):
        return ()
    return tuple((field.name, field.metadata.get(WRITTEN_OUT, ())) for field in fields(kind) if field.compare)

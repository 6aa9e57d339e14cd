"""Some samples of a trajectory, of a contact or of reactions, and parts of such records put together."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray, Trajectory

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

#: A dataclass of arrays over samples, and of mappings of arrays or of such records.
Record = TypeVar("Record", bound="DataclassInstance")


def selected(record: Record, which: slice | NDArray[Any]) -> Record:
    """Return a record, and what it holds by name, with some of its samples; impacts all stay."""
    return _of_arrays(record, lambda values: values[which])


def _of_arrays(record: Record, change: Callable[[FloatArray], FloatArray]) -> Record:
    """Return a record with all arrays over its samples changed, those in what it holds by name as well."""
    changed: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray):
            changed[name] = change(value)
        elif isinstance(value, Mapping):
            changed[name] = {
                key: change(part) if isinstance(part, np.ndarray) else _of_arrays(part, change)
                for key, part in value.items()
            }
    return replace(record, **changed)


def interpolated(run: Trajectory, time_s: FloatArray) -> Trajectory:
    """Return a run at other times (n,), from samples at its steps: positions by cubics, all else linearly.

    That is as accurate as a method of second order.
    """
    step = np.clip(np.searchsorted(run.time_s, time_s, "right") - 1, 0, len(run.time_s) - 2)
    part = (time_s - run.time_s[step]) / (run.time_s[step + 1] - run.time_s[step])

    def linear(values: FloatArray) -> FloatArray:
        weight = part.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1 - weight) * values[step] + weight * values[step + 1])

    x, h = part[:, None, None], np.diff(run.time_s)[step][:, None, None]
    start, stop = run.velocity[step] * h, run.velocity[step + 1] * h
    change = run.position[step + 1] - run.position[step]
    curve = (1 - x) * (start - change) + x * (change - stop)
    position = run.position[step] + x * (change + (1 - x) * curve)
    return replace(_of_arrays(run, linear), time_s=time_s, position=position)


def joined(parts: Sequence[Record]) -> Record:
    """Return a record with the samples of all parts, in their order; what has none is the first part's."""
    arrays: dict[str, Any] = {}
    for name, value in vars(parts[0]).items():
        own = [getattr(part, name) for part in parts]
        if isinstance(value, np.ndarray):
            arrays[name] = np.concatenate(own)
        elif isinstance(value, Mapping):
            arrays[name] = {
                key: (np.concatenate if isinstance(part, np.ndarray) else joined)([each[key] for each in own])
                for key, part in value.items()
            }
    return replace(parts[0], **arrays)

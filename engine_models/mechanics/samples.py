"""Some of a trajectory's samples, as a trajectory, and parts of a contact's put together."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, Trajectory

Record = TypeVar("Record", Trajectory, Contact)


def selected(record: Record, which: slice | NDArray[np.bool_]) -> Record:
    """Return a trajectory, or a contact within it, with some of its samples; impacts all stay."""
    changed: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray):
            changed[name] = value[which]
        elif isinstance(value, Mapping):
            changed[name] = {key: _part(part, which) for key, part in value.items()}
    return replace(record, **changed)


def _part(part: Any, which: slice | NDArray[np.bool_]) -> Any:
    return part[which] if isinstance(part, np.ndarray) else selected(part, which)


def joined(parts: Sequence[Contact]) -> Contact:
    """Return a contact with the samples of all parts, in their order; the impacts are those of the first."""
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name, value in vars(parts[0]).items()
        if isinstance(value, np.ndarray)
    }
    return replace(parts[0], **arrays)

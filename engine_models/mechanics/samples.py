"""Some samples of a trajectory, of a contact or of reactions."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray

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

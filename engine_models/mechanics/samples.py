"""Some samples of a trajectory, of a contact or of reactions."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

#: A dataclass of arrays over samples, and of mappings of arrays or of such records.
Record = TypeVar("Record", bound="DataclassInstance")


def selected(record: Record, which: slice | NDArray[Any]) -> Record:
    """Return a record, and what it holds by name, with some of its samples; impacts all stay."""

    def some(value: Any) -> Any:
        return value[which] if isinstance(value, np.ndarray) else selected(value, which)

    kept: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, Mapping):
            kept[name] = {key: some(part) for key, part in value.items()}
        elif isinstance(value, np.ndarray):
            kept[name] = some(value)
    return replace(record, **kept)

"""Some of a trajectory's samples, as a trajectory."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from engine_models.engine import Contact, Trajectory

Record = TypeVar("Record", Trajectory, Contact)


def selected(record: Record, which: slice) -> Record:
    """Return a trajectory, or a contact within it, with the samples of a slice; impacts all stay."""
    kept: dict[str, Any] = {}
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray):
            kept[name] = value[which]
        elif isinstance(value, Mapping):
            kept[name] = {joint: selected(contact, which) for joint, contact in value.items()}
    return replace(record, **kept)

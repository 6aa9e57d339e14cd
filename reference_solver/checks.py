"""Refusals of what a user gives, in one line: the field, what was expected, what came."""

import math
from dataclasses import is_dataclass
from numbers import Real
from typing import Any

import numpy as np

from reference_solver.tape import FloatArray

FINITE, POSITIVE, NOT_NEGATIVE = "a finite number", "a finite number > 0", "a finite number >= 0"


def require(field: str, value: object, valid: Any, wanted: str) -> None:
    """Raise ValueError for a value that is not valid."""
    if not valid:
        came = f'"{value}"' if isinstance(value, str) else value
        raise ValueError(f"{field}: expected {wanted}, got {came}")


def is_number(value: object) -> bool:
    """Return whether a value is a finite real number, and not a truth value."""
    if type(value) is float:  # most are, and of others it takes ten times as long to tell
        return math.isfinite(value)
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def is_count(value: object) -> bool:
    """Return whether a value is an integer >= 1."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(value >= 1)


def require_positive(part: object, *names: str) -> None:
    """Raise ValueError unless these fields of a dataclass are numbers > 0."""
    for name, value in _named(part, names):
        require(name, value, is_number(value) and value > 0, POSITIVE)


def require_not_negative(part: object, *names: str) -> None:
    """Raise ValueError unless these fields of a dataclass are numbers >= 0."""
    for name, value in _named(part, names):
        require(name, value, is_number(value) and value >= 0, NOT_NEGATIVE)


def require_below(part: object, name: str, limit: str) -> None:
    """Raise ValueError unless one field of a dataclass is less than another."""
    (name, value), (_, most) = _named(part, (name, limit))
    require(name, value, value < most, f"a number < {limit} = {most:g}")


def require_vector(field: str, value: object, size: int) -> FloatArray:
    """Return finite numbers (size,) as an array of their own.

    Raises:
        ValueError: they are none, or not so many.
    """
    try:
        vector = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{field}: expected {size} finite numbers, got others") from None
    if vector.shape != (size,):
        raise ValueError(f"{field}: expected {size} finite numbers, got the shape {vector.shape}")
    require_finite(field, tuple(vector))
    return vector


def require_finite(field: str, data: object) -> None:
    """Raise ValueError unless all numbers in dataclasses and tuples are finite; the field is of the first."""
    if isinstance(data, float):
        if not math.isfinite(data):
            require(field, data, False, FINITE)
    elif isinstance(data, tuple):
        numbers = all(isinstance(part, float) for part in data)
        if not (numbers and all(map(math.isfinite, data))):  # tables are long
            for k, part in enumerate(data):
                require_finite(f"{field}[{k}]", part)
    elif is_dataclass(data):
        for name, part in vars(data).items():
            if not (type(part) is float and math.isfinite(part)):
                require_finite(f"{field}.{name}", part)
    elif isinstance(data, Real):
        require(field, data, math.isfinite(data), FINITE)


def _named(part: object, names: tuple[str, ...]) -> list[tuple[str, Any]]:
    """Return fields' values with their names as refusals have them: ``Body.mass_kg``."""
    return [(f"{type(part).__name__}.{name}", getattr(part, name)) for name in names]

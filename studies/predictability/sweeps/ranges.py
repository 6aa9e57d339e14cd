"""The values of a field in a sweep, as a user writes them: ``1e-5:1e-3:log:1000``, or ``1e-5,1e-4``."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene.plain_words import shortened, shown
from engine_models.scene.units import NUMBER
from studies.running.failures import BadInput

#: The most members of one sweep.
MOST_MEMBERS = 10_000_000
FORM = "LOW:HIGH[:log][:COUNT] or a list of numbers"


@dataclass(frozen=True)
class Range:
    """Numbers from ``low`` to ``high``, in equal ratios if ``log``; no ``count`` where they are drawn."""

    low: float
    high: float
    log: bool
    count: int | None

    def __len__(self) -> int:
        return self.count or 0

    def spaced(self) -> FloatArray:
        """Return the ``count`` numbers of a grid, (n,), both ends included."""
        assert self.count is not None
        return (np.geomspace if self.log else np.linspace)(self.low, self.high, self.count)

    def at(self, part: FloatArray) -> FloatArray:
        """Return the numbers at parts of the way, (n,), from 0 to 1."""
        low, high = np.log([self.low, self.high]) if self.log else (self.low, self.high)
        way = low + (high - low) * part
        return np.clip(np.exp(way) if self.log else way, self.low, self.high)


#: What a field is given: a range, or the numbers themselves.
Values = Range | tuple[float, ...]


def values_of(field: str, given: str | Sequence[float]) -> Values:
    """Return the values of a field, as text or as the numbers themselves.

    Raises:
        BadInput: they are none; the message begins with ``--vary FIELD``.
    """
    where = f"--vary {field}"
    if not isinstance(given, str):
        numbers = tuple(map(float, given))
        if not numbers or not np.isfinite(numbers).all():
            raise BadInput(f"{where}: expected finite numbers, got {numbers or 'none'}")
        return numbers
    if ":" not in given:
        return tuple(_number(where, each) for each in given.split(","))
    low, high, *rest = given.split(":")
    log = rest[:1] == ["log"]
    counts = rest[log:]
    if len(counts) > 1:
        raise BadInput(f"{where}: expected {FORM}, got {shown(given)}")
    found = Range(
        _number(where, low), _number(where, high), log, _count(where, counts[0]) if counts else None
    )
    if not found.low < found.high:
        raise BadInput(f"{where}: expected a range that rises, got {found.low:g} to {found.high:g}")
    if log and not found.low > 0:
        raise BadInput(f"{where}: expected numbers > 0 in a range with log, got {found.low:g}")
    return found


def _number(where: str, text: str) -> float:
    if not NUMBER.fullmatch(text) or not np.isfinite(float(text)):
        raise BadInput(f"{where}: expected {FORM}, got {shown(text)}")
    return float(text)


def _count(where: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and float(text) >= 2):
        raise BadInput(f"{where}: expected log or a count >= 2 behind the ends, got {shown(text)}")
    if float(text) > MOST_MEMBERS:  # int() refuses thousands of digits
        raise BadInput(f"{where}: expected 1 to {MOST_MEMBERS} members, got {shortened(text)}")
    return int(float(text))

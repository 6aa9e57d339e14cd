"""The members of a sweep: a grid of values, or draws from ranges, and starts a little apart.

A member's values depend on the seed and on its number alone, not on who runs it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass as checked_dataclass

from engine_models.engine import SETTINGS_CONFIG, FloatArray
from engine_models.mechanics.assembly import start_angle
from engine_models.scene.data import NonNegative
from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import BadInput, shortened, shown
from engine_models.scene.units import NUMBER

Sample = Literal["grid", "random", "latin-hypercube", "sobol"]

#: The most members of one sweep.
MOST_MEMBERS = 100_000
FORM = "LOW:HIGH[:log][:COUNT] or a list of numbers"


@checked_dataclass(frozen=True, config=SETTINGS_CONFIG)
class Draw:
    """How members are chosen: ``members`` are those of a point of a grid, or in all of a sample.

    ``jitter`` moves the turning body's angle at the start by up to so many rad to either side; 0 is none.
    """

    sample: Sample = "grid"
    members: Annotated[int, Field(ge=1, le=MOST_MEMBERS)] | None = None
    jitter: Annotated[NonNegative, Field(le=2 * math.pi)] = 0.0
    seed: Annotated[int, Field(ge=0)] = 0


@dataclass(frozen=True)
class Range:
    """Numbers from ``low`` to ``high``, in equal ratios if ``log``; no ``count`` where they are drawn."""

    low: float
    high: float
    log: bool
    count: int | None

    def spaced(self) -> FloatArray:
        """Return the ``count`` numbers of a grid, (n,), both ends included."""
        assert self.count is not None, "a grid has counts"
        return (np.geomspace if self.log else np.linspace)(self.low, self.high, self.count)

    def at(self, part: FloatArray) -> FloatArray:
        """Return the numbers at parts of the way, (n,), from 0 to 1."""
        low, high = np.log([self.low, self.high]) if self.log else (self.low, self.high)
        way = low + (high - low) * part
        return np.clip(np.exp(way) if self.log else way, self.low, self.high)


def values_of(field: str, given: str | Sequence[float]) -> Range | FloatArray:
    """Return the values of a field, as text or as the numbers themselves, (n,).

    Raises:
        BadInput: they are none; the message begins with ``--vary FIELD``.
    """
    where = f"--vary {field}"
    if not isinstance(given, str):
        numbers = np.array([float(number) for number in given])
        if not numbers.size or not np.isfinite(numbers).all():
            raise BadInput(f"{where}: expected finite numbers, got {numbers.tolist() or 'none'}")
        return numbers
    if ":" not in given:
        return np.array([_number(where, each) for each in given.split(",")])
    low_text, high_text, *rest = given.split(":")
    low, high, log = _number(where, low_text), _number(where, high_text), rest[:1] == ["log"]
    if len(counts := rest[log:]) > 1:
        raise BadInput(f"{where}: expected {FORM}, got {shown(given)}")
    if not low < high:
        raise BadInput(f"{where}: expected a range that rises, got {low:g} to {high:g}")
    if log and not low > 0:
        raise BadInput(f"{where}: expected numbers > 0 in a range with log, got {low:g}")
    return Range(low, high, log, _count(where, counts[0]) if counts else None)


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


def drawn(scene: AnyScene, ranges: Mapping[str, Range | FloatArray], draw: Draw) -> dict[str, FloatArray]:
    """Return the values (n,) of every field that changes, by its path; the last of a grid goes fastest.

    Raises:
        BadInput: there are no members, or too many, or ranges and draw do not fit together.
    """
    values = _grid(ranges, draw) if draw.sample == "grid" else _sampled(ranges, draw)
    if draw.jitter:
        try:
            path, angle = start_angle(scene)
        except ValueError as reason:
            raise BadInput(f"--jitter: {reason}") from None
        if path in ranges:
            raise BadInput(f"--jitter: expected nothing beside --vary {path}, which it moves")
        count = len(next(iter(values.values()))) if values else draw.members or 0
        # Not of the sample's own seed, whose numbers these would be again.
        moves = np.random.default_rng([draw.seed, 1]).uniform(-draw.jitter, draw.jitter, count)
        values[path] = angle + moves
    return values


def _grid(ranges: Mapping[str, Range | FloatArray], draw: Draw) -> dict[str, FloatArray]:
    if draw.members is not None and not draw.jitter:
        expected = "--jitter beside it on a grid, whose members would all be the same"
        raise BadInput(f"--members: expected {expected}")
    if not ranges and draw.members is None:
        raise BadInput("--vary: expected FIELD=VALUES, or --members and --jitter, got nothing")
    for field, values in ranges.items():
        if isinstance(values, Range) and values.count is None:
            raise BadInput(f"--vary {field}: expected a count behind the ends on a grid, got none")
    members = draw.members or 1
    counts = [(values.count or 0) if isinstance(values, Range) else len(values) for values in ranges.values()]
    if (count := math.prod(counts) * members) > MOST_MEMBERS:
        raise BadInput(f"--vary: expected 1 to {MOST_MEMBERS} members, got {count}")
    axes = [values.spaced() if isinstance(values, Range) else values for values in ranges.values()]
    grid = np.meshgrid(*axes, indexing="ij")
    return {field: np.repeat(values.ravel(), members) for field, values in zip(ranges, grid, strict=True)}


def _sampled(ranges: Mapping[str, Range | FloatArray], draw: Draw) -> dict[str, FloatArray]:
    if draw.members is None or not ranges:
        missing = "--members N" if ranges else "--vary FIELD=LOW:HIGH"
        raise BadInput(f"--sample: expected {missing} beside {draw.sample}, got nothing")
    columns = _points(draw.sample, draw.members, len(ranges), np.random.default_rng(draw.seed)).T
    values = {}
    for (field, given), part in zip(ranges.items(), columns, strict=True):
        if not isinstance(given, Range) or given.count is not None:
            came = "a count" if isinstance(given, Range) else "a list"
            raise BadInput(f"--vary {field}: expected LOW:HIGH[:log] with --sample {draw.sample}, got {came}")
        values[field] = given.at(part)
    return values


def _points(sample: Sample, count: int, fields: int, generator: np.random.Generator) -> FloatArray:
    """Return points (count, fields) in the unit cube; Sobol's are the first of a balanced power of two."""
    if sample == "random":
        return generator.random((count, fields))
    from scipy.stats import qmc  # which takes a second to load

    if sample == "latin-hypercube":
        return np.asarray(qmc.LatinHypercube(fields, seed=generator).random(count))
    return np.asarray(qmc.Sobol(fields, seed=generator).random_base2((count - 1).bit_length())[:count])

"""The members of a sweep: a grid of values, or draws from their ranges, and starts a little apart.

A member's values depend on the seed and on its number alone, not on who runs it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.assembly import start_angle
from engine_models.scene.parts import AnyScene
from engine_models.scene.plain_words import one_of, shown
from studies.predictability.sweeps.ranges import MOST_MEMBERS, Range, Values
from studies.running.failures import BadInput

Sample = Literal["grid", "random", "latin-hypercube", "sobol"]
#: Points (n, d) in the unit cube.
Points = Callable[[int, int, np.random.Generator], FloatArray]

#: A jitter moves the start's angle by a whole turn to either side at most.
MOST_JITTER_RAD = 2 * math.pi


@dataclass(frozen=True)
class Draw:
    """How members are chosen: ``members`` are those of a point of a grid, or in all of a sample.

    ``jitter`` moves the turning body's angle at the start by up to so many rad to either side; 0 is none.
    """

    sample: Sample = "grid"
    members: int | None = None
    jitter: float = 0.0
    seed: int = 0


def drawn(scene: AnyScene, ranges: Mapping[str, Values], draw: Draw) -> dict[str, FloatArray]:
    """Return the values (n,) of every field that changes, by its path; the last of a grid goes fastest.

    Raises:
        BadInput: there are no members, or too many, or ranges and draw do not fit together.
    """
    if draw.sample not in get_args(Sample):
        raise BadInput(f"--sample: expected {one_of(list(get_args(Sample)))}, got {shown(draw.sample)}")
    values = _grid(ranges, draw) if draw.sample == "grid" else _sampled(ranges, draw)
    if draw.jitter:
        path, angle = _moved(scene, ranges)
        count = len(next(iter(values.values()))) if values else draw.members or 0
        # Not of the sample's own seed, whose numbers these would be again.
        moves = np.random.default_rng([draw.seed, 1]).uniform(-draw.jitter, draw.jitter, count)
        values[path] = angle + moves
    return values


def _grid(ranges: Mapping[str, Values], draw: Draw) -> dict[str, FloatArray]:
    members = 1 if draw.members is None else draw.members
    if draw.members is not None and not draw.jitter:
        raise BadInput(
            "--members: expected --jitter beside it on a grid, whose members would all be the same"
        )
    if not ranges and draw.members is None:
        raise BadInput("--vary: expected FIELD=VALUES, or --members and --jitter, got nothing")
    for field, values in ranges.items():
        if isinstance(values, Range) and values.count is None:
            raise BadInput(f"--vary {field}: expected a count behind the ends on a grid, got none")
    _require_number(math.prod(map(len, ranges.values())) * members)
    axes = [values.spaced() if isinstance(values, Range) else np.array(values) for values in ranges.values()]
    grid = np.meshgrid(*axes, indexing="ij")
    return {field: np.repeat(values.ravel(), members) for field, values in zip(ranges, grid, strict=True)}


def _sampled(ranges: Mapping[str, Values], draw: Draw) -> dict[str, FloatArray]:
    if draw.members is None or not ranges:
        missing = "--members N" if ranges else "--vary FIELD=LOW:HIGH"
        raise BadInput(f"--sample: expected {missing} beside {draw.sample}, got nothing")
    _require_number(draw.members)
    points = POINTS[draw.sample](draw.members, len(ranges), np.random.default_rng(draw.seed))
    found = {}
    for (field, values), part in zip(ranges.items(), points.T, strict=True):
        if not isinstance(values, Range) or values.count is not None:
            came = "a list" if isinstance(values, tuple) else "a count"
            raise BadInput(f"--vary {field}: expected LOW:HIGH[:log] with --sample {draw.sample}, got {came}")
        found[field] = values.at(part)
    return found


def _require_number(members: int) -> None:
    if not 1 <= members <= MOST_MEMBERS:
        raise BadInput(f"--vary: expected 1 to {MOST_MEMBERS} members, got {members}")


def _moved(scene: AnyScene, ranges: Mapping[str, Values]) -> tuple[str, float]:
    """Return the path of the angle that a jitter moves, and its value."""
    try:
        path, angle = start_angle(scene)
    except ValueError as reason:
        raise BadInput(f"--jitter: {reason}") from None
    if path in ranges:
        raise BadInput(f"--jitter: expected nothing beside --vary {path}, which it moves")
    return path, angle


def _random(count: int, fields: int, generator: np.random.Generator) -> FloatArray:
    return generator.random((count, fields))


def _latin_hypercube(count: int, fields: int, generator: np.random.Generator) -> FloatArray:
    from scipy.stats import qmc  # which takes a second to load

    return np.asarray(qmc.LatinHypercube(fields, seed=generator).random(count))


def _sobol(count: int, fields: int, generator: np.random.Generator) -> FloatArray:
    """Return the first of a power of two, in which alone Sobol's points are balanced."""
    from scipy.stats import qmc

    return np.asarray(qmc.Sobol(fields, seed=generator).random_base2((count - 1).bit_length())[:count])


POINTS: Mapping[str, Points] = {"random": _random, "latin-hypercube": _latin_hypercube, "sobol": _sobol}

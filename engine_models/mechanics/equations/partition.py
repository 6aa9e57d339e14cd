"""Which coordinates of a tree are independent, and the steps in which loops give the others' rates.

A step takes one row and one coordinate, or two and two, and divides by their determinant. Rows are taken
together where these are the only coordinates left in them; where there are none, the largest entry is taken.
A determinant that may vanish while the mechanism moves is ``watched``: where it has become small the
partition is chosen anew. That of a bar that is longer than all others of its loop together does not vanish,
nor that of two bars whose ends are never as far apart as both together, or as near as one less the other,
as with a crank that turns in a four-bar.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from engine_models.mechanics.equations.frames import ByCoordinate, Frames
from engine_models.mechanics.equations.tree import Row, Tree
from reference_solver.mechanism.mechanism import GROUND
from reference_solver.tape import FloatArray

#: Partitions that are looked at one by one, and the part of the largest determinant that is as good.
MOST, AS_GOOD = 300, 0.1
#: A partition is chosen anew where a step's determinant has this part of what it had.
SMALL = 0.2
#: A step's determinant, with arms in parts of a row's longest, below which no partition is of use: what a
#: method leaves of errors is divided by it, and a coarse one would go on in a way of its own.
SINGULAR = 1e-4


class SingularPosition(Exception):
    """Where no partition is of use."""

    def __init__(self) -> None:
        super().__init__("the mechanism is at a singular position, where no coordinates are independent")


@dataclass(frozen=True)
class Step:
    """Rows, coordinates (as many), the sign of their determinant, and whether that may vanish."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    sign: float
    watched: bool


@dataclass(frozen=True)
class Partition:
    """The independent coordinates, and the steps for the others, in their order."""

    independent: tuple[int, ...]
    steps: tuple[Step, ...]

    @property
    def watched(self) -> tuple[int, ...]:
        """Numbers of the steps whose determinants may vanish."""
        return tuple(k for k, step in enumerate(self.steps) if step.watched)


def choose_partition(tree: Tree, u: Sequence[float]) -> Partition:
    """Return a partition that is good at coordinates u.

    Raises:
        SingularPosition: there is none.
    """
    carried, loops = tree.structure.carried, Frames(tree, dict(enumerate(u))).loops
    if not loops:
        return Partition(carried, ())
    B = np.zeros((len(loops), len(u)))
    for r, (row, parts) in enumerate(zip(tree.rows, loops, strict=True)):
        scales = _scales(row)
        for k, value in parts.items():
            B[r, k] = value / scales.get(k, scales[None])
    candidates = [np.array([*c, *tree.explicit]) for c in _candidates(tree, B)]
    dets = np.array([abs(np.linalg.det(B[:, c])) for c in candidates])
    found = list[tuple[int, float, tuple[Step, ...]]]()
    for c in (c for c, det in zip(candidates, dets, strict=True) if det >= AS_GOOD * dets.max()):
        steps, smallest = _steps(tree, loops, [int(k) for k in c], B)
        if smallest >= SINGULAR:
            found.append((sum(step.watched for step in steps), -smallest, steps))
    if not found:
        raise SingularPosition
    *_, steps = min(found, key=lambda one: one[:2])
    dependent = {k for step in steps for k in step.columns}
    return Partition(tuple(k for k in carried if k not in dependent), steps)


def _scales(row: Row) -> dict[int | None, float]:
    """Return the length of a row's vector along each way, and under None its longest arm."""
    scales: dict[int | None, float] = {None: 0.0}
    for (_, way), vector in row.terms.items():
        scales[way] = max(scales.get(way, 0.0), math.hypot(*vector))
    scales[None] = scales[None] or 1.0
    return scales


def _candidates(tree: Tree, B: FloatArray) -> Iterator[tuple[int, ...]]:
    """Yield sets of coordinates that may be dependent: all, if they are few, else the best by pivots.

    Those that follow from loops are so anyway, with their rows.
    """
    carried, count = tree.structure.carried, len(B) - len(tree.explicit)
    if math.comb(len(carried), count) <= MOST:
        yield from combinations(carried, count)
        return
    import scipy.linalg

    others = [r for r in range(len(B)) if r not in tree.explicit.values()]
    _, _, order = scipy.linalg.qr(B[np.ix_(others, carried)], pivoting=True)
    yield tuple(sorted(carried[k] for k in order[:count]))


def _steps(
    tree: Tree, loops: list[ByCoordinate], dependent: list[int], B: FloatArray
) -> tuple[tuple[Step, ...], float]:
    """Return the steps for dependent coordinates, and the smallest size of their determinants."""
    steps, smallest, A = list[Step](), math.inf, B.copy()
    left = [{k for k in row if k in dependent} for row in loops]
    waiting = set(range(len(loops)))
    while waiting and smallest >= SINGULAR:
        rows, columns, alone = _next(A, left, waiting)
        block = A[np.ix_(rows, columns)]
        determinant = float(np.linalg.det(block))
        watched = not (alone and _never_vanishes(tree.rows, rows, columns))
        steps.append(Step(rows, columns, math.copysign(1.0, determinant), watched))
        smallest = min(smallest, abs(determinant))
        waiting -= {*rows}
        for r in waiting if determinant else ():
            if left[r] & {*columns}:
                A[r] -= A[r, list(columns)] @ np.linalg.solve(block, A[list(rows)])
                left[r] = (left[r] | set[int]().union(*(left[k] for k in rows))) - {*columns}
    return tuple(steps), smallest


def _next(
    A: FloatArray, left: list[set[int]], waiting: set[int]
) -> tuple[tuple[int, ...], tuple[int, ...], bool]:
    """Return rows and columns of the next step, and whether these are all that is left in the rows."""
    found = list[tuple[float, tuple[int, ...], tuple[int, ...]]]()
    for size in (1, 2):
        for rows in combinations(sorted(waiting), size):
            columns = tuple(sorted(set[int]().union(*(left[r] for r in rows))))
            if len(columns) == size:
                found.append((abs(float(np.linalg.det(A[np.ix_(rows, columns)]))), rows, columns))
        if found:
            _, rows, columns = max(found)
            return rows, columns, True
    entries = [(abs(A[r, k]), (r,), (k,)) for r in sorted(waiting) for k in sorted(left[r])]
    _, rows, columns = max(entries)
    return rows, columns, False


def _never_vanishes(rows: list[Row], own: tuple[int, ...], columns: tuple[int, ...]) -> bool:
    """Return whether a determinant keeps its sign wherever the loop is closed."""
    row = rows[own[0]]
    of_ways = [(frame, way) for frame, way in row.terms if way is not None]
    if len(own) == 1:
        (k,) = columns
        if k in [way for _, way in of_ways]:  # its entry is a constant
            return all(frame == row.frame for frame, way in of_ways if way == k)
    if of_ways:
        return False
    sizes = {frame: math.hypot(*vector) for (frame, _), vector in row.terms.items()}
    arms = [sizes.pop(k, 0.0) for k in columns if k != row.frame]
    if len(own) == 1:
        fixed = row.terms.get((row.frame, None), (0.0, 0.0))
        off = abs(fixed[0] * row.along[0] + fixed[1] * row.along[1])
        sizes.pop(row.frame, None)
        if arms:  # its entry is the arm times a cosine, whose sine has the others' arms at most
            return bool(arms[0] > sum(sizes.values()) + off)
        # Of the frame that the row is in, the entry is as long as what leads to the line.
        return bool(off == 0.0 and 2.0 * max(sizes.values(), default=0.0) > sum(sizes.values()))
    if rows[own[1]].terms != row.terms or row.frame != GROUND or len(arms) != 2:
        return False
    total, longest = sum(sizes.values()), max(sizes.values(), default=0.0)
    nearest, farthest = max(0.0, 2.0 * longest - total), total
    return bool(farthest < arms[0] + arms[1] and nearest > abs(arms[0] - arms[1]))

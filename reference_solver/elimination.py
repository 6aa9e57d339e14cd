"""In which order the blocks of [B][M]^-1[B]^T are eliminated, from which constraints share a body."""

from dataclasses import dataclass

from reference_solver.mechanism import GROUND, Constraint


@dataclass(frozen=True)
class Elimination:
    """The order that eliminates, one by one, the block with the fewest neighbours left.

    ``order`` (k,) are the constraints; ``below[i]`` the places in the order, all later, that the i-th meets.
    """

    order: list[int]
    below: list[list[int]]


def bodies_of(constraint: Constraint) -> tuple[int, ...]:
    """Return the moving bodies that a constraint holds."""
    named = (getattr(constraint, field, GROUND) for field in ("body", "body_i", "body_j"))
    return tuple(body for body in named if body != GROUND)


def least_degree(constraints: tuple[Constraint, ...]) -> Elimination:
    """Return the elimination of [B][M]^-1[B]^T, in which constraints meet where they share a body."""
    on_body: dict[int, list[int]] = {}
    for k, constraint in enumerate(constraints):
        for body in bodies_of(constraint):
            on_body.setdefault(body, []).append(k)
    neighbours: dict[int, set[int]] = {k: set() for k in range(len(constraints))}
    for k, constraint in enumerate(constraints):
        neighbours[k].update(other for body in bodies_of(constraint) for other in on_body[body] if other != k)
    order, met = [], []
    while neighbours:
        k = min(neighbours, key=lambda one: (len(neighbours[one]), one))
        left = neighbours.pop(k)
        for other in left:
            neighbours[other] = (neighbours[other] | left) - {k, other}
        order.append(k)
        met.append(left)
    place = {k: i for i, k in enumerate(order)}
    return Elimination(order, [sorted(place[k] for k in left) for left in met])

"""Where bodies would be if no joint had clearance: the positions nearest to given ones that close all joints.

Gauss-Newton in the norm of [M]: q - M^-1 B^T (B M^-1 B^T)^-1 g closes the gaps g of joints and guides, whose
rates are B q', to first order. The rows of B are unit wrenches.
"""

from dataclasses import replace

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.reactions import held, solve_systems, unit_wrenches
from engine_models.mechanics.states import off_line, pin_gap, turned_apart
from engine_models.mechanics.wrenches import inertias
from engine_models.scene.scene import Scene

#: Positions that are closed at a time, which bounds the memory; steps at the most, and turns in a step.
AT_ONCE, MOST_STEPS, TURN_RAD = 4096, 12, 0.5
#: A step no longer than this, in m and rad, is the last one: what it leaves is of the order of its square.
SHORT = 1e-9
#: Rows with a least singular value below this, of the largest, may depend on each other once joints with
#: clearance are closed. Singular values below its tenth are then 0.
DEPENDENT = 1e-2


def closed(scene: Scene, position: FloatArray, turning: int | None) -> FloatArray:
    """Return the positions (n, bodies, 3) nearest to given ones with all joints closed; NaN where none is.

    They are the nearest to first order in the distance. A ``turning`` body keeps its angle. A body in a guide
    keeps the angle that it has there in the first one.
    """
    pins = tuple(replace(pin, clearance=None, bearing_on_j=False) for pin in scene.mechanism.pins)
    of = replace(scene.mechanism, pins=pins, drive=replace(scene.mechanism.drive, law=None))
    apart = [turned_apart(guide, position[:1]) for guide in held(of)]
    weights = 1.0 / inertias(of).ravel()
    kept = np.zeros((0, len(weights))) if turning is None else np.eye(len(weights))[[3 * turning + 2]]

    def rows(q: FloatArray) -> FloatArray:
        return np.concatenate([unit_wrenches(of, q), np.broadcast_to(kept, (len(q), *kept.shape))], axis=1)

    def gaps(q: FloatArray, begun: FloatArray) -> FloatArray:
        still, turned = np.zeros_like(q), (q - begun).reshape(len(q), -1) @ kept.T
        lines = [off_line(guide, q, still)[0] for guide in of.guides]
        angles = [turned_apart(guide, q) - own for guide, own in zip(held(of), apart, strict=True)]
        places = [pin_gap(pin, q, still).gap_m for pin in of.pins]
        return np.concatenate([*places, *(row[:, None] for row in [*lines, *angles]), turned], axis=1)

    first = rows(position[:1])[0] * np.sqrt(weights)
    values = np.linalg.svd(first / np.linalg.norm(first, axis=1, keepdims=True), compute_uv=False)
    dependent = bool(values[-1] < DEPENDENT * values[0])
    found = np.full(position.shape, np.nan)
    for begin in range(0, len(position), AT_ONCE):
        begun = position[begin : begin + AT_ONCE]
        q, step = begun, np.full(len(begun), np.inf)
        for _ in range(MOST_STEPS):
            B = rows(q)
            weighted, open_by = weights * B @ B.swapaxes(1, 2), gaps(q, begun)[..., None]
            force = solve_systems(weighted, open_by, dependent, (DEPENDENT / 10) ** 2)
            move = weights * np.einsum("nmk,nm->nk", B, force)
            step, turn = np.abs(move).max(axis=1), np.abs(move[:, 2::3]).max(axis=1)
            q = q - (move * np.minimum(1.0, TURN_RAD / np.maximum(turn, TURN_RAD))[:, None]).reshape(q.shape)
            if not (step > SHORT).any():
                break
        found[begin : begin + AT_ONCE] = np.where((step <= SHORT)[:, None, None], q, np.nan)
    return found

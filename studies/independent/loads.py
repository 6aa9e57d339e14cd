"""The load on the slider in formulas of its own: its parts, positive along +x."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from engine_models.scene.scene import Scene
from studies.independent.drives import piece_at, pieces_of

FloatArray = NDArray[np.float64]
PARTS = ("force", "viscous", "spring", "gas")


class Load(NamedTuple):
    """A force in N, c in N s/m, k in N/m about a place in m; the gas's knots (n,) and its pieces (4, n - 1).

    What is absent is zero or empty. ``kinks`` says whether pieces are straight: a step ends at their knots.
    """

    force_N: float
    viscous_N_s_m: float
    spring_N_m: float
    free_position_m: float
    knots: FloatArray
    pieces: FloatArray
    kinks: bool


def load_of(scene: Scene) -> Load:
    """Return the load of a scene's slider."""
    load, knots, pieces, kinks = scene.load.slider, np.zeros(0), np.zeros((4, 0)), False
    if load is None:
        return Load(0.0, 0.0, 0.0, 0.0, knots, pieces, kinks)
    if load.gas is not None:
        kinks = load.gas.interpolation == "linear"
        angle, force = np.array(load.gas.crank_angle_rad), np.array(load.gas.force_N)
        angle[-1], force[-1] = angle[0] + math.tau, force[0]
        knots, pieces = pieces_of(make_interp_spline(angle, force, k=1 if kinks else 3, bc_type="periodic"))
        inside = (knots >= angle[0]) & (knots <= angle[-1])
        knots, pieces = knots[inside], np.ascontiguousarray(pieces[:, inside[:-1] & inside[1:]])
    return Load(
        load.force_N or 0.0,
        load.viscous_N_s_m or 0.0,
        load.spring_N_m or 0.0,
        load.free_position_m or 0.0,
        knots,
        pieces,
        kinks,
    )


def gas_piece(load: Load, theta: float) -> float:
    """Return the number of the straight piece that a crank angle is in, counted on from turn to turn."""
    if not load.kinks:
        return 0.0
    turns = math.floor((theta - load.knots[0]) / math.tau)
    return float(turns * (len(load.knots) - 1) + piece_at(load.knots, theta - turns * math.tau))


@njit(error_model="numpy")
def gas_knot(load: Load, piece: float) -> float:
    """Return the crank angle at which a piece begins, by its number."""
    turns, k = divmod(piece, len(load.knots) - 1.0)
    return float(load.knots[int(k)] + turns * math.tau)


@njit(error_model="numpy")
def load_forces(load: Load, theta: float, x: float, speed: float, forces: FloatArray) -> None:
    """Fill the load's parts (4,) in N at a crank angle, and the slider's place and speed."""
    forces[0] = load.force_N
    forces[1] = -load.viscous_N_s_m * speed
    forces[2] = load.spring_N_m * (load.free_position_m - x)
    forces[3] = 0.0
    if len(load.knots) > 0:
        angle = load.knots[0] + (theta - load.knots[0]) % math.tau
        k = piece_at(load.knots, angle)
        angle -= load.knots[k]
        for power in range(4):
            forces[3] = forces[3] * angle + load.pieces[power, k]

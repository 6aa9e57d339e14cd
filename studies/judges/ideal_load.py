"""The load on the slider of ideal scenes, derived here again for the truth: its forces and their works.

Forces act along +x. Nothing here is shared with the engines or with the mechanics of their models.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene.loads import Gas
from engine_models.scene.scene import Scene

TURN = 2 * np.pi
#: Gauss-Legendre on panels this wide or less is exact to round-off where the rod is longer than the crank by
#: a thousandth: dx/dtheta is then smooth as far as 0.045 rad off the real axis.
PANELS_PER_TURN, NODES, WEIGHTS = 64, *np.polynomial.legendre.leggauss(16)
#: So near to a knot of the gas's table its force is as smooth as away from it, to round-off.
AT_KNOT_RAD = 1e-9


def slider_force(scene: Scene) -> Callable[[Any, Any, Any], Any] | None:
    """Return the force in N as a function of theta, x and x', arrays (n,) or numbers; None without a load."""
    load = scene.load.slider
    if load is None:
        return None
    gas = None if load.gas is None else _gas_force(load.gas)

    def force(theta: Any, x: Any, velocity: Any) -> Any:
        total = (load.force_N or 0.0) - (load.viscous_N_s_m or 0.0) * velocity
        if load.spring_N_m and load.free_position_m is not None:
            total = total - load.spring_N_m * (x - load.free_position_m)
        return total if gas is None else total + gas(theta)

    return force


def is_viscous(scene: Scene) -> bool:
    """Return whether part of the load is -c x', whose work is an integral over time."""
    return scene.load.slider is not None and bool(scene.load.slider.viscous_N_s_m)


def gas_knots_rad(scene: Scene, theta: float) -> tuple[float, float] | None:
    """Return the knots of the gas's table next below and above a crank angle, None without a gas.

    A knot nearer than ``AT_KNOT_RAD`` is passed over: the angle stands on it.
    """
    if scene.load.slider is None or scene.load.slider.gas is None:
        return None
    first, *others = scene.load.slider.gas.crank_angle_rad
    knots = np.array([0.0, *(knot - first for knot in others[:-1]), TURN])
    turns, offset = np.divmod(theta - first + np.array([-AT_KNOT_RAD, AT_KNOT_RAD]), TURN)
    begins = np.clip(np.searchsorted(knots, offset, side="right") - 1, 0, len(knots) - 2)
    below, above = first + turns * TURN + np.array([knots[begins[0]], knots[begins[1] + 1]])
    return float(below), float(above)


def load_works_J(
    scene: Scene, theta: FloatArray, x: FloatArray, squares: FloatArray | None, slope: Callable[[Any], Any]
) -> dict[str, FloatArray]:
    """Return the work since t = 0 of each part of the load at crank angles and positions (n,), (n,) each.

    ``squares`` (n,) is the integral of x'^2 over time, ``slope`` is dx/dtheta as a function of theta.
    """
    load, works = scene.load.slider, dict[str, FloatArray]()
    if load is None:
        return works
    if load.force_N:
        works["force"] = load.force_N * (x - x[0])
    if squares is not None:
        works["viscous"] = -(load.viscous_N_s_m or 0.0) * squares
    if load.spring_N_m and load.free_position_m is not None:
        works["spring"] = -load.spring_N_m * (x - x[0]) * ((x + x[0]) / 2 - load.free_position_m)
    if load.gas is not None:
        works["gas"] = _gas_work_J(load.gas, theta, slope)
    return works


def _gas_force(gas: Gas) -> Callable[[Any], Any]:
    """Return the curve over a turn and any other; the last entry is the first again, one whole turn on."""
    from scipy.interpolate import CubicSpline  # it takes a moment, and loads without gas do without

    first = gas.crank_angle_rad[0]
    angle, force = (*gas.crank_angle_rad[:-1], first + TURN), (*gas.force_N[:-1], gas.force_N[0])
    if gas.interpolation == "linear":
        return lambda theta: np.interp(first + np.remainder(theta - first, TURN), angle, force)
    spline = CubicSpline(angle, force, bc_type="periodic")
    return lambda theta: spline(first + np.remainder(theta - first, TURN))


def _gas_work_J(gas: Gas, theta: FloatArray, slope: Callable[[Any], Any]) -> FloatArray:
    """Return the integral of force times slope from the first angle on: whole turns, panels, part of one."""
    first, force = gas.crank_angle_rad[0], _gas_force(gas)
    even = first + TURN / PANELS_PER_TURN * np.arange(PANELS_PER_TURN)
    edges = np.append(np.union1d(even, gas.crank_angle_rad[:-1]), first + TURN)

    def integral(begin: FloatArray, end: FloatArray) -> FloatArray:
        half = (end - begin)[:, None] / 2
        angle = begin[:, None] + half * (1 + NODES)
        return np.asarray(np.sum(half * WEIGHTS * force(angle) * slope(angle), axis=1))

    up_to = np.append(0.0, np.cumsum(integral(edges[:-1], edges[1:])))
    turns, offset = np.divmod(theta - first, TURN)
    panel = np.clip(np.searchsorted(edges, first + offset, side="right") - 1, 0, len(edges) - 2)
    potential = turns * up_to[-1] + up_to[panel] + integral(edges[panel], first + offset)
    return np.asarray(potential - potential[0])

"""Functions in a mechanism's data: prescribed motions, and tables with the curves through their points.

How a driven body turns or slides is given by {C(t)}, its integral and {C'}: in rad and rad/s, or in m and
m/s. A curve is piecewise cubic; a kernel looks its pieces up among its parameters.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from reference_solver.mechanism.data import ConstantSpeed, Course, Fluctuation, Motion, Ramp, Table
from reference_solver.tape import FloatArray, Scalar, cos, larger, sin, smaller

#: A ramp takes so many steps at least: its work is an integral of a polynomial of degree 9.
FEWEST_STEPS = 16
#: What a piece has in a table: where it begins, and coefficients of 1, s, s^2, s^3, s counted from there.
ROW = 5
#: A jump of a derivative that makes less than this part of the largest value across a piece is none.
SMOOTH = 1e-12
#: The angle or way since t = 0, the speed, which is C, and the acceleration, which is C'.
Moved = tuple[Scalar, Scalar, Scalar]


def curve_of(table: Table) -> Any:
    """Return the curve through a table, SciPy's ``PPoly`` in pieces of four coefficients each."""
    from scipy.interpolate import CubicSpline, PPoly  # it takes a moment, and most scenes do without

    x, y = table.x, table.y
    if table.period:
        x, y = (*x[:-1], x[0] + table.period), (*y[:-1], y[0])
    if table.interpolation == "linear":
        nothing = np.zeros(len(x) - 1)
        pieces = np.array([nothing, nothing, np.diff(y) / np.diff(x), y[:-1]])
        return PPoly(pieces, x, extrapolate="periodic" if table.period else True)
    if table.period:
        return CubicSpline(x, y, bc_type="periodic")
    level = 0.0 if y[0] == y[1] else None, 0.0 if y[-2] == y[-1] else None
    ends = tuple("not-a-knot" if slope is None else (1, slope) for slope in table.end_slopes or level)
    return CubicSpline(x, y, bc_type=ends)


def pieces_of(curve: Any, period: float = 0.0, x: float = 0.0, y: float = 0.0) -> "PiecewiseCubic":
    """Return a curve's pieces moved by x and y."""
    rows = np.column_stack([curve.x[:-1] + x, curve.c[::-1].T])
    rows[:, 1] += y
    return PiecewiseCubic(tuple(rows.ravel().tolist()), period)


@dataclass(frozen=True)
class PiecewiseCubic:
    """A function of one variable by its pieces: of each, one after the other, a ``ROW`` of numbers.

    Pieces rise. With a ``period`` other than 0 the function repeats.
    """

    rows: tuple[float, ...] = field(repr=False)
    period: float = 0.0

    @cached_property
    def _array(self) -> FloatArray:
        return np.array(self.rows)

    @property
    def knots(self) -> list[float]:
        """Where pieces begin that are more than round-off away from the one before, gone on."""
        begins, value = self._array[::ROW], np.abs(self._array[1::ROW])
        degree = 3 if self._array.reshape(-1, ROW)[:, 3:].any() else 1  # of straight lines
        highest, wide = self._array[1 + degree :: ROW], np.diff(begins, append=begins[-1])
        jump, wide = highest - np.roll(highest, 1), np.maximum(wide, np.roll(wide, 1))
        matters = np.abs(jump) * wide**degree > SMOOTH * value.max()
        return [float(x) for x in begins[matters]]

    def placed(self, behind: int = 0) -> "PlacedTable":
        """Return what a kernel knows of it, with so many numbers of other tables behind this one's."""
        return PlacedTable(-float(len(self.rows) + behind), len(self.rows) / ROW, self.period)

    def at(self, x: Scalar) -> Moved:
        """Return the function and its first two derivatives at numbers: the outer pieces go on for ever."""
        rows = self._array.reshape(-1, ROW)
        if self.period:
            x = x - self.period * np.floor((x - rows[0, 0]) / self.period)
        begin, *coefficients = rows[np.maximum(0, np.searchsorted(rows[:, 0], x, side="right") - 1)].T
        return _cubic(x - begin, *coefficients)


@dataclass(frozen=True)
class PlacedTable:
    """A table among a kernel's parameters: where it begins, from their end on, its pieces and its period."""

    place: Scalar
    pieces: Scalar
    period: Scalar

    def at(self, x: Scalar) -> Moved:
        """Return the function and its first two derivatives on the tape that the place is on."""
        return _cubic(*self.place.tape.call("piece", [self.place, self.pieces, self.period, x], 5))


def _cubic(s: Scalar, a: Scalar, b: Scalar, c: Scalar, d: Scalar) -> Moved:
    return a + s * (b + s * (c + s * d)), b + s * (2.0 * c + s * (3.0 * d)), 2.0 * c + 6.0 * (s * d)


def moved(motion: Motion, t: Scalar) -> Moved:
    """Return what a motion makes of a time since t = 0.

    That of a ramp is a sextic in time within it, and straight lines outside. The way of a fluctuating speed
    is a multiple of cos(phase) - cos(now), without their difference.
    """
    match motion:
        case ConstantSpeed():
            return motion.speed * t, motion.speed, 0.0
        case Ramp():
            T, gain = motion.duration_s, motion.last - motion.first
            x, way = _ramped(motion, t)
            angle = motion.first * t + gain * (way - _ramped(motion, 0.0)[1])
            speed = motion.first + gain * (x * x * x * (10.0 + x * (6.0 * x - 15.0)))
            return angle, speed, 30.0 * (gain / T) * (x * x * (1.0 - x) * (1.0 - x))
        case Fluctuation():
            amplitude, rate, phase = motion.amplitude, math.tau * motion.frequency_Hz, motion.phase_rad
            half, now = 0.5 * (rate * t), rate * t + phase
            angle = motion.mean * t + 2.0 * (amplitude / rate) * (sin(half) * sin(half + phase))
            return angle, motion.mean + amplitude * sin(now), amplitude * rate * cos(now)
        case Course():
            pieces: PiecewiseCubic = motion.table
            return pieces.at(t)


def _ramped(ramp: Ramp, t: Scalar) -> tuple[Scalar, Scalar]:
    """Return the part of a ramp that has passed, and its way for a gain of 1."""
    T = ramp.duration_s
    x = larger(0.0, smaller(1.0, (t - ramp.start_s) / T))
    past = larger(0.0, t - ramp.start_s - T)
    return x, T * (x * x * x * x * (2.5 + x * (x - 3.0))) + past


def going_on(motion: Motion, clock_s: float) -> Motion:
    """Return a motion as it goes on from a time of its clock, its table as pieces."""
    match motion:
        case Ramp():
            return replace(motion, start_s=-clock_s)
        case Fluctuation():
            phase = motion.phase_rad + math.tau * motion.frequency_Hz * clock_s
            return replace(motion, phase_rad=math.remainder(phase, math.tau))
        case Course():
            curve = curve_of(motion.table)
            return Course(pieces_of(curve, x=-clock_s, y=-float(curve(clock_s))))
    return motion


def fastest(motion: Motion) -> float:
    """Return the largest speed; of a table that at a knot."""
    match motion:
        case ConstantSpeed():
            return abs(motion.speed)
        case Ramp():
            return max(abs(motion.first), abs(motion.last))
        case Fluctuation():
            return abs(motion.mean) + abs(motion.amplitude)
        case Course():
            return float(np.abs(motion.table.rows[2::ROW]).max())


def knots_s(motion: Motion, longest_step_s: float) -> list[float]:
    """Return times in s at which a motion is not smooth; of a ramp short for the step also some within."""
    if isinstance(motion, Ramp):
        parts = 1 if motion.duration_s >= FEWEST_STEPS * longest_step_s else FEWEST_STEPS
        return [motion.start_s + k * motion.duration_s / parts for k in range(parts + 1)]
    return motion.table.knots if isinstance(motion, Course) else []

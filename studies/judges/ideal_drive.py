"""The drives of ideal scenes, derived here again for the truth: prescribed motions in closed form, torques.

Nothing here is shared with the engines or with the mechanics of their models.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import Polynomial

from engine_models.engine import FloatArray
from engine_models.scene.drives import TableDrive
from engine_models.scene.scene import Scene

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

OfTime = Callable[[FloatArray], FloatArray]

#: S(x) of a ramp, its share of the change of speed at x = t/T, and the integral of S from 0.
SMOOTH_STEP = Polynomial([0, 0, 0, 10, -15, 6])
ITS_INTEGRAL = SMOOTH_STEP.integ()


@dataclass(frozen=True)
class PrescribedMotion:
    """The crank's motion as functions of times (n,) in s since the run began.

    The angle is what the crank has turned since then. ``knots_s`` are the times in the run at which a higher
    derivative jumps.
    """

    turned_rad: OfTime
    speed_rad_s: OfTime
    acceleration_rad_s2: OfTime
    knots_s: tuple[float, ...] = ()


def prescribed_motion(scene: Scene) -> PrescribedMotion:
    """Return the motion that the drive prescribes.

    Raises:
        ValueError: the drive prescribes none.
    """
    drive, speed, begin = scene.drive, scene.start.crank_speed_rad_s, scene.start.time_s or 0.0
    if drive.kind == "constant-speed":
        return PrescribedMotion(lambda t: speed * t, lambda t: np.full_like(t, speed), np.zeros_like)
    if drive.kind == "ramp":
        motion = _ramp(speed, drive.final_speed, drive.ramp_time_s, begin)
    elif drive.kind == "fluctuating":
        rate = 2 * np.pi * drive.frequency_Hz
        motion = _fluctuating(speed, drive.amplitude, rate, drive.phase_rad + rate * begin)
    elif drive.kind == "table":
        motion = _table(drive, begin)
    else:
        raise ValueError(f"drive.kind: expected one that prescribes the crank's speed, got {drive.kind}")
    inside = tuple(knot for knot in motion.knots_s if 0 < knot < scene.end_time_s)
    return PrescribedMotion(motion.turned_rad, motion.speed_rad_s, motion.acceleration_rad_s2, inside)


def _ramp(first: float, last: float, ramp_time_s: float, begin_s: float) -> PrescribedMotion:
    """From the first speed to the last as the smooth step, whose clock stands at ``begin_s``."""
    change, x_0 = last - first, min(begin_s / ramp_time_s, 1.0)
    # Expanded about the start, so that nothing cancels: the integral of S from x_0 to x_0 + h.
    turning = ITS_INTEGRAL(Polynomial([x_0, 1]))
    turning -= turning(0)

    def ramped(t: FloatArray) -> FloatArray:
        """Return how much of the ramp has passed since the run began, in parts of its time."""
        return np.minimum(t / ramp_time_s, 1 - x_0)

    def turned(t: FloatArray) -> FloatArray:
        h = ramped(t)
        return np.asarray(first * t + change * ramp_time_s * (turning(h) + (t / ramp_time_s - h)))

    def speed(t: FloatArray) -> FloatArray:
        return np.asarray(first + change * SMOOTH_STEP(x_0 + ramped(t)))

    def acceleration(t: FloatArray) -> FloatArray:
        x, left = x_0 + ramped(t), 1 - x_0 - ramped(t)
        return 30 * change / ramp_time_s * (x * left) ** 2

    return PrescribedMotion(turned, speed, acceleration, (ramp_time_s - begin_s,))


def _fluctuating(mean: float, amplitude: float, rate: float, phase: float) -> PrescribedMotion:
    """A speed of ``mean + amplitude sin(rate t + phase)``; cos(a) - cos(b) is written as a product."""
    return PrescribedMotion(
        lambda t: mean * t + 2 * amplitude / rate * np.sin(rate * t / 2) * np.sin(phase + rate * t / 2),
        lambda t: mean + amplitude * np.sin(phase + rate * t),
        lambda t: amplitude * rate * np.cos(phase + rate * t),
    )


def _table(table: TableDrive, begin_s: float) -> PrescribedMotion:
    """The cubic spline of a table, whose third derivative jumps at the knots; or one straight line."""
    times, angles = table.time_s, table.values
    if table.interpolation == "linear":
        speed = (angles[-1] - angles[0]) / (times[-1] - times[0])
        return PrescribedMotion(lambda t: speed * t, lambda t: np.full_like(t, speed), np.zeros_like)
    flat = (0.0 if angles[end] == angles[beside] else None for end, beside in ((0, 1), (-1, -2)))
    spline = cubic_spline(times, angles, *(table.end_slopes or flat))
    return PrescribedMotion(
        lambda t: spline(begin_s + t) - spline(begin_s),
        lambda t: spline(begin_s + t, 1),
        lambda t: spline(begin_s + t, 2),
        tuple(time - begin_s for time in times),
    )


def cubic_spline(
    x: Sequence[float], y: Sequence[float], first: float | None = None, last: float | None = None
) -> "PPoly":
    """Return the cubic spline through four points or more, with these slopes at its ends.

    Of an end without one it is smooth at the second point, or the last but one (not-a-knot). Its unknowns are
    the second derivatives M at the points, with h_(k-1) M_(k-1) + 2 (h_(k-1) + h_k) M_k + h_k M_(k+1)
    = 6 (slope_k - slope_(k-1)), and h_0 (2 M_0 + M_1) = 6 (slope_0 - first), as if a piece of no length were
    before it. SciPy's unknowns are first derivatives, whose differences lose four digits of the second where
    200 points are close together; here the one difference is exact.
    """
    from scipy.interpolate import PPoly  # it takes a moment, and drives without a table do without
    from scipy.linalg import solve_banded

    exact = [(Fraction(a), Fraction(b)) for a, b in zip(x, y, strict=True)]
    slopes = [(after[1] - before[1]) / (after[0] - before[0]) for before, after in pairwise(exact)]
    bends = [6 * (after - before) for before, after in pairwise(slopes)]
    begin = Fraction(0) if first is None else 6 * (slopes[0] - Fraction(first))
    end = Fraction(0) if last is None else 6 * (Fraction(last) - slopes[-1])
    h, slope = np.diff(x), np.array([float(value) for value in slopes])
    # Row k of the matrix has its column j at [2 + k - j, j].
    bands = np.zeros((5, len(x)))
    bands[3, :-2], bands[2, 1:-1], bands[1, 2:] = h[:-1], 2 * (h[:-1] + h[1:]), h[1:]
    bands[2, 0], bands[1, 1], bands[0, 2] = (
        (-h[1], h[0] + h[1], -h[0]) if first is None else (2 * h[0], h[0], 0)
    )
    bands[2, -1], bands[3, -2], bands[4, -3] = (
        (-h[-2], h[-1] + h[-2], -h[-1]) if last is None else (2 * h[-1], h[-1], 0)
    )
    M = solve_banded((2, 2), bands, [float(value) for value in (begin, *bends, end)])
    linear = slope - h * (2 * M[:-1] + M[1:]) / 6
    return PPoly(np.array([np.diff(M) / (6 * h), M[:-1] / 2, linear, y[:-1]]), x)


def drive_torque(scene: Scene) -> Callable[[Any], Any]:
    """Return the torque in N m of a drive that does not prescribe the speed, as a function of the speed."""
    drive = scene.drive
    if drive.kind == "torque":
        torque = drive.constant_N_m
        return lambda _: torque
    if drive.kind == "motor":
        stall, no_load = drive.stall_torque_N_m, drive.no_load_speed_rad_s
        return lambda speed: stall * (1 - speed / no_load)
    return lambda _: 0.0

"""Prescribed motions: how a driven body turns or slides, as functions of time, {C(t)}, its integral and {C'}.

Of turning they are in rad and rad/s, of sliding in m and m/s. A new motion is a function and a line in
``MOTIONS``. One that ``has_knots`` is not smooth at ``knots_s``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from reference_solver.checks import require_positive
from reference_solver.mechanism.tables import ROW, PiecewiseCubic
from reference_solver.tape import Scalar, cos, larger, sin, smaller

#: A ramp takes so many steps at least: its work is an integral of a polynomial of degree 9.
FEWEST_STEPS = 16
#: The angle or way since t = 0, the speed, which is C, and the acceleration, which is C'.
Moved = tuple[Scalar, Scalar, Scalar]


@dataclass(frozen=True)
class Steady:
    """A constant speed, in rad/s or m/s."""

    speed: float
    has_knots: ClassVar[bool] = False

    def knots_s(self, longest_step_s: float) -> tuple[float, ...]:  # noqa: ARG002
        """Return no times."""
        return ()

    @property
    def fastest(self) -> float:
        """The largest speed."""
        return abs(self.speed)


@dataclass(frozen=True)
class Ramp:
    """A speed, in rad/s or m/s, that goes from one to another within ``duration_s`` from ``start_s`` on.

    It stays there: w0 + (w1 - w0) x^3 (10 - 15 x + 6 x^2), x the part of the duration that has passed, so
    that C'' is continuous.
    """

    first: float
    last: float
    duration_s: float
    start_s: float = 0.0
    has_knots: ClassVar[bool] = True

    def __post_init__(self) -> None:
        require_positive(self, "duration_s")

    def knots_s(self, longest_step_s: float) -> tuple[float, ...]:
        """Return times in s: both ends, and where steps are long for the ramp, places within it."""
        parts = 1 if self.duration_s >= FEWEST_STEPS * longest_step_s else FEWEST_STEPS
        return tuple(self.start_s + k * self.duration_s / parts for k in range(parts + 1))

    @property
    def fastest(self) -> float:
        """The largest speed."""
        return max(abs(self.first), abs(self.last))


@dataclass(frozen=True)
class Fluctuation:
    """A speed of mean + amplitude sin(frequency t + phase), in rad/s or m/s; the frequency is in rad/s."""

    mean: float
    amplitude: float
    frequency_rad_s: float
    phase_rad: float = 0.0
    has_knots: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_positive(self, "frequency_rad_s")

    def knots_s(self, longest_step_s: float) -> tuple[float, ...]:  # noqa: ARG002
        """Return no times."""
        return ()

    @property
    def fastest(self) -> float:
        """The largest speed."""
        return abs(self.mean) + abs(self.amplitude)


@dataclass(frozen=True)
class Course:
    """An angle in rad or a way in m by a piecewise cubic function of time, which is 0 at t = 0."""

    moved: PiecewiseCubic
    has_knots: ClassVar[bool] = True

    def knots_s(self, longest_step_s: float) -> tuple[float, ...]:  # noqa: ARG002
        """Return times in s."""
        return tuple(self.moved.knots)

    @property
    def fastest(self) -> float:
        """The largest speed at a knot."""
        return float(np.abs(self.moved.rows[2::ROW]).max())


Motion = Steady | Ramp | Fluctuation | Course


def steady(motion: Steady, t: Scalar) -> Moved:
    """Return what a constant speed makes."""
    return motion.speed * t, motion.speed, 0.0


def ramp(motion: Ramp, t: Scalar) -> Moved:
    """Return the way of a ramp: a sextic in time within it, straight lines outside."""
    T, gain = motion.duration_s, motion.last - motion.first

    def gained(t: Scalar) -> tuple[Scalar, Scalar]:
        x = larger(0.0, smaller(1.0, (t - motion.start_s) / T))
        past = larger(0.0, t - motion.start_s - T)
        return x, T * (x * x * x * x * (2.5 + x * (x - 3.0))) + past

    x, angle = gained(t)
    angle = motion.first * t + gain * (angle - gained(0.0)[1])
    speed = motion.first + gain * (x * x * x * (10.0 + x * (6.0 * x - 15.0)))
    return angle, speed, 30.0 * (gain / T) * (x * x * (1.0 - x) * (1.0 - x))


def fluctuation(motion: Fluctuation, t: Scalar) -> Moved:
    """Return the way of a fluctuating speed."""
    amplitude, rate, phase = motion.amplitude, motion.frequency_rad_s, motion.phase_rad
    half, now = 0.5 * (rate * t), rate * t + phase
    # Equal to cos(phase) - cos(now), without their difference.
    angle = motion.mean * t + 2.0 * (amplitude / rate) * (sin(half) * sin(half + phase))
    return angle, motion.mean + amplitude * sin(now), amplitude * rate * cos(now)


def course(motion: Course, t: Scalar) -> Moved:
    """Return the way by a table."""
    return motion.moved.at(t)


#: The function of each kind of motion, of it and the time.
MOTIONS: Mapping[type, Callable[[Any, Scalar], Moved]] = MappingProxyType(
    {Steady: steady, Ramp: ramp, Fluctuation: fluctuation, Course: course}
)

"""Piecewise polynomials: drives of the time and gas of the crank's angle, whose pieces no step crosses.

An integrator knows of a piece where it begins and its coefficients, as parameters. It stops where the piece
ends, and goes on with the parameters of the next, which are made before a run.
"""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray
from reference_solver.mechanism.mechanism import Mechanism, PrescribedMotion, PrescribedSpeed
from reference_solver.mechanism.motions import MOTIONS, Course, Ramp
from reference_solver.mechanism.tables import ROW
from reference_solver.tape import Array, Scalar

#: A piece goes on so far past its ends, in rad: an angle that has just passed one is off it by its rounding.
BEYOND_RAD = 1e-14


@dataclass(frozen=True)
class Polynomials:
    """Pieces (m, 1 + n) of a function: where each begins, and its coefficients of 1, s, s^2 and so on.

    s is counted from there. With a ``period`` other than 0 they repeat.
    """

    rows: FloatArray
    period: float = 0.0

    @property
    def terms(self) -> int:
        """The number n of a piece's coefficients."""
        return int(self.rows.shape[1]) - 1


@dataclass(frozen=True)
class Piece:
    """One piece on a tape: a polynomial from where it begins, in place of a table."""

    begin: Scalar
    coefficients: Array

    def at(self, x: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return the function and its first two derivatives."""
        s, found = x - self.begin, list[Scalar]()
        for order in range(3):
            value: Scalar = 0.0
            for k in reversed(range(order, len(self.coefficients))):
                part = float(np.prod(range(k - order + 1, k + 1)))
                value = value * s + part * self.coefficients[k]
            found.append(value)
        return found[0], found[1], found[2]


def drive_of(mechanism: Mechanism) -> Polynomials | None:
    """Return the angle turned since t = 0 by pieces of time, None where it is smooth."""
    for motion in mechanism.prescribed:
        if isinstance(motion, Course):
            return Polynomials(np.reshape(motion.moved.rows, (-1, ROW)))
        if isinstance(motion, Ramp):
            return Polynomials(_ramp(motion))
    return None


def gas_of(mechanism: Mechanism) -> Polynomials | None:
    """Return the force of a gas by pieces of the crank's angle, None without one."""
    for load in mechanism.gas:
        return Polynomials(np.reshape(load.force_N.rows, (-1, ROW)), load.force_N.period)
    return None


def _ramp(motion: Ramp) -> FloatArray:
    """Return what is before, within and after a ramp, (3, 8)."""
    start, T, gain = motion.start_s, motion.duration_s, motion.last - motion.first
    rows = np.zeros((3, 8))
    rows[:, 0] = start - T, start, start + T
    for row, speed in zip(rows, (motion.first, motion.first, motion.last), strict=True):
        row[1:3] = MOTIONS[Ramp](motion, row[0])[0], speed
    rows[1, 5:8] = gain * T * np.array([2.5, -3.0, 1.0]) / T ** np.arange(4, 7)
    return rows


def turn_of(driver: PrescribedSpeed | PrescribedMotion, t: Scalar, piece: Piece | None) -> tuple[Scalar, ...]:
    """Return the angle turned since t = 0, the speed and the acceleration of a driven crank, on a tape."""
    if isinstance(driver, PrescribedSpeed):
        return driver.speed_rad_s * t, driver.speed_rad_s, 0.0
    if piece is not None:
        return piece.at(t)
    return MOTIONS[type(driver.motion)](driver.motion, t)


class Knots:
    """The parameters of a run's pieces: they stand behind each other, of drive and end, and of the gas.

    Those of a drive are ``until``, where the piece or the run ends, in s, and the piece, those of the gas the
    angles at which its piece ends, and the piece.
    """

    def __init__(self, drive: Polynomials | None, gas: Polynomials | None, end_s: float, timed: bool) -> None:
        rows = np.zeros((1, 0)) if drive is None else drive.rows
        begins = np.zeros(1) if drive is None else rows[:, 0]
        ends = np.minimum(np.append(begins[1:], np.inf), end_s)
        first, last = np.searchsorted(begins, 0.0, "right") - 1, np.searchsorted(begins, end_s)
        whole = np.column_stack([ends, rows])[max(first, 0) : last]
        self._times = whole if timed else np.zeros((1, 0))
        self._period, self._gas = 0.0, np.zeros((0, 0))
        if gas is not None:
            begins, self._period = gas.rows[:, 0], gas.period
            ends = np.append(begins[1:], begins[0] + gas.period)
            self._gas = np.column_stack([begins - BEYOND_RAD, ends + BEYOND_RAD, gas.rows])
        self._time, self._angle = 0, 0

    def begin(self, pars: FloatArray, angle: float) -> None:
        """Set the parameters for the start of a run."""
        self._time = 0
        pars[: self._times.shape[1]] = self._times[0]
        if len(self._gas):
            begins = self._gas[:, 2]
            turns = int(np.floor((angle - begins[0]) / self._period))
            place = int(np.searchsorted(begins, angle - turns * self._period, "right")) - 1
            self._set_gas(pars, turns * len(begins) + place)

    def pass_time(self, pars: FloatArray) -> bool:
        """Set the parameters for the drive's next piece, and return whether there is one."""
        self._time += 1
        if self._time == len(self._times):
            return False
        pars[: self._times.shape[1]] = self._times[self._time]
        return True

    def pass_angle(self, pars: FloatArray, by: int) -> None:
        """Set the parameters for the gas's next piece, or the one before."""
        self._set_gas(pars, self._angle + by)

    def _set_gas(self, pars: FloatArray, number: int) -> None:
        """Set those of a piece, whose number counts all turns."""
        self._angle, first = number, self._times.shape[1]
        turns, place = divmod(number, len(self._gas))
        pars[first:] = self._gas[place]
        pars[first : first + 3] += turns * self._period

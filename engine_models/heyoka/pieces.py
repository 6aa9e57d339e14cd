"""Functions in pieces, of the time, a body's angle or its speed, whose ends no step crosses.

Those are tables of drives, gas, loads and motors, and ramps. An integrator knows of a piece where it begins
and its coefficients, as parameters. It stops where the piece ends, and goes on with the parameters of the
next, which are made before a run.
"""

from dataclasses import dataclass, replace

import numpy as np

from engine_models.engine import FloatArray
from reference_solver.mechanism.lifting import Table, lifted
from reference_solver.mechanism.mechanism import (
    ForceByTime,
    GasForce,
    Mechanism,
    PrescribedMotion,
    PrescribedSlide,
    TorqueBySpeed,
    TorqueByTime,
)
from reference_solver.mechanism.motions import MOTIONS, Course, Ramp
from reference_solver.mechanism.tables import ROW, PiecewiseCubic
from reference_solver.tape import Array, Scalar, Tape, array

#: A piece of a function that is none of the time goes on so far past its ends, in rad or rad/s: an angle that
#: has just passed one is off it by its rounding.
BEYOND = 1e-14


@dataclass(frozen=True)
class Polynomials(Table):
    """Pieces (m, 1 + n) of a function: where each begins, and its coefficients of 1, s, s^2 and so on.

    s is counted from there. With a ``period`` other than 0 they repeat. The function is one of the time, or
    where ``of`` is the number of an angle among q, of that or of its rate.
    """

    pieces: FloatArray
    period: float = 0.0
    of: int | None = None
    of_rate: bool = False

    def placed(self, behind: int = 0) -> object:  # noqa: ARG002
        """Return itself: a tape has its numbers by name."""
        return self

    def argument(self, q: Array, v: Array) -> Scalar:
        """Return the angle in rad, or its rate, of coordinates and velocities (3b,)."""
        return v[self.of] if self.of_rate else q[self.of]


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


def _ramp(motion: Ramp) -> FloatArray:
    """Return what is before, within and after a ramp, (3, 8)."""
    start, T, gain = motion.start_s, motion.duration_s, motion.last - motion.first
    rows = np.zeros((3, 8))
    rows[:, 0] = start - T, start, start + T
    for row, speed in zip(rows, (motion.first, motion.first, motion.last), strict=True):
        row[1:3] = MOTIONS[Ramp](motion, row[0])[0], speed
    rows[1, 5:8] = gain * T * np.array([2.5, -3.0, 1.0]) / T ** np.arange(4, 7)
    return rows


def in_pieces(mechanism: Mechanism) -> tuple[Mechanism, list[Polynomials]]:
    """Return a mechanism with its ramps as tables, and all its tables in their order."""
    tables, constraints = list[Polynomials](), list(mechanism.constraints)

    def keep(table: PiecewiseCubic, of: int | None = None, of_rate: bool = False) -> None:
        tables.append(Polynomials(np.reshape(table.rows, (-1, ROW)), table.period, of, of_rate))

    for k, driver in enumerate(constraints):
        motion = driver.motion if isinstance(driver, PrescribedMotion | PrescribedSlide) else None
        if isinstance(motion, Ramp):
            tables.append(Polynomials(_ramp(motion)))
            assert isinstance(driver, PrescribedMotion | PrescribedSlide)
            constraints[k] = replace(driver, motion=Course(PiecewiseCubic((0.0,) * ROW)))
        elif isinstance(motion, Course):
            keep(motion.moved)
    for load in mechanism.loads:
        if isinstance(load, GasForce):
            keep(load.force_N, 3 * load.crank + 2)
        elif isinstance(load, TorqueBySpeed):
            keep(load.torque_N_m, 3 * load.body + 2, of_rate=True)
        elif isinstance(load, ForceByTime):
            keep(load.force_N)
        elif isinstance(load, TorqueByTime):
            keep(load.torque_N_m)
    return replace(mechanism, constraints=tuple(constraints)), tables


def on_tape(mechanism: Mechanism, tables: list[Polynomials], tape: Tape) -> Mechanism:
    """Return a mechanism of ``in_pieces`` whose tables are pieces, by the names of ``names_of``."""
    pieces = iter(
        Piece(tape.input(begin), array([tape.input(name) for name in coefficients]))
        for begin, *coefficients in (_of_piece(k, table) for k, table in enumerate(tables))
    )
    return lifted(mechanism, lambda number: number, placed=lambda _: next(pieces))


def _of_piece(k: int, table: Polynomials) -> list[str]:
    return [f"begin{k}", *(f"c{k}_{n}" for n in range(table.pieces.shape[1] - 1))]


class Walk:
    """The pieces of a function that is none of the time, and the one of them that a run is in.

    The parameters of a piece are the values at which it ends, and those of ``_of_piece``. Pieces repeat with
    the function's period. Without one the first and the last piece go on by parts, each as long as all before
    the last: an end far away would be among the numbers by whose size heyoka judges its steps.
    """

    def __init__(self, table: Polynomials) -> None:
        begins, self._repeats = table.pieces[:, 0], table.period != 0
        self._length = table.period or begins[-1] - begins[0]
        ends = np.append(begins[1:], begins[0 if self._repeats else -1] + self._length)
        self._rows = np.column_stack([begins - BEYOND, ends + BEYOND, table.pieces])
        self._turn(0)

    def begin(self, own: FloatArray, x: float) -> None:
        """Set a function's own parameters for an argument x."""
        self._turn(int(np.floor((x - self._rows[0, 2]) / self._length)) if self._repeats else 0)
        self._place = max(int(np.searchsorted(self._now[:, 2], x, "right")) - 1, 0)
        self.go_on(own, 0)
        while not own[0] <= x <= own[1]:
            self.go_on(own, 1 if x > own[1] else -1)

    def go_on(self, own: FloatArray, by: int) -> None:
        """Set a function's own parameters for the next piece (1), or the one before (-1)."""
        self._place += by
        if not 0 <= self._place < len(self._now):
            self._turn(self._turns + by)
            self._place = 0 if by > 0 else len(self._now) - 1
        own[:] = self._now[self._place]

    def _turn(self, turns: int) -> None:
        """Go on with the pieces of another period, or with another part before or after them all."""
        self._turns, moved = turns, turns * self._length
        if self._repeats:
            self._now = self._rows.copy()
            self._now[:, :3] += moved
            return
        self._now = self._rows[[-1 if turns > 0 else 0]] if turns else self._rows
        if turns:
            self._now[:, :2] += moved
        if turns < 0:
            self._now[:, 1] = self._now[:, 0] + self._length + 2 * BEYOND


class Knots:
    """The parameters of a run's pieces, by their ``names``.

    If it is ``timed``, the first is ``until``, where a piece of the time or the run ends, in s. Then come the
    pieces of the time, and of each other function the values at which its piece ends, and the piece.
    """

    def __init__(self, tables: list[Polynomials], end_s: float, timed: bool) -> None:
        by_time = [(k, table) for k, table in enumerate(tables) if table.of is None]
        #: The functions that are none of the time, by their numbers.
        self.others = {k: table for k, table in enumerate(tables) if table.of is not None}
        self.names = ["until"] * timed + [name for k, table in by_time for name in _of_piece(k, table)]
        knots = {x for _, table in by_time for x in table.pieces[1:, 0].tolist() if 0 < x < end_s}
        begins = np.array([0.0, *sorted(knots)])
        columns = [np.append(begins[1:], end_s)[:, None]] * timed
        for _, table in by_time:
            rows = np.searchsorted(table.pieces[:, 0], begins, "right") - 1
            columns.append(table.pieces[np.maximum(rows, 0)])
        self._times, self._time = np.hstack(columns) if columns else np.zeros((1, 0)), 0
        #: Where the parameters of the other functions stand, and the walks over their pieces.
        self.places, self.walks = dict[int, slice](), dict[int, Walk]()
        for k, table in self.others.items():
            first = len(self.names)
            self.names += [f"low{k}", f"high{k}", *_of_piece(k, table)]
            self.places[k], self.walks[k] = slice(first, len(self.names)), Walk(table)

    def begin(self, pars: FloatArray, q: FloatArray, v: FloatArray) -> None:
        """Set the parameters for the start of a run at coordinates and velocities (3b,)."""
        self._time = -1
        self.pass_time(pars)
        for k, table in self.others.items():
            self.walks[k].begin(pars[self.places[k]], float(table.argument(q, v)))

    def pass_time(self, pars: FloatArray) -> bool:
        """Set the parameters for the next piece of the time, and return whether there is one."""
        self._time += 1
        if self._time == len(self._times):
            return False
        pars[: self._times.shape[1]] = self._times[self._time]
        return True

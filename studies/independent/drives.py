"""Drives of the crank in formulas of their own: torques, and speeds that are prescribed."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import PPoly, make_interp_spline

from engine_models.scene.drives import TableDrive
from engine_models.scene.scene import Scene

FloatArray = NDArray[np.float64]
#: Torques: one that is constant or none, and a motor's; and the prescribed speeds.
TORQUE, MOTOR, CONSTANT, RAMP, SINE, TABLE = range(6)


class Drive(NamedTuple):
    """Its kind and four numbers of that; the table's knots (n,) and the pieces (4, n - 1) of its spline.

    The numbers are the torque; a motor's slope and speed without load; else the speed, then its change and
    its duration or its amplitude and rate, and last what the clock reads at the start or the phase then.
    """

    kind: int
    numbers: tuple[float, float, float, float]
    knots: FloatArray
    pieces: FloatArray


def drive_of(scene: Scene) -> Drive:
    """Return the drive of a scene."""
    drive, first, clock = scene.drive, scene.start.crank_speed_rad_s, scene.start.time_s or 0.0
    kind, numbers, knots, pieces = TORQUE, [0.0], np.zeros(0), np.zeros((4, 0))
    if drive.kind == "torque":
        numbers = [drive.constant_N_m]
    elif drive.kind == "motor":
        stall, no_load = drive.line
        slope = stall / no_load
        kind, numbers = MOTOR, [slope, no_load]
    elif drive.kind == "constant-speed":
        kind, numbers = CONSTANT, [first]
    elif drive.kind == "ramp":
        kind, numbers = RAMP, [first, drive.final_speed - first, drive.ramp_time_s, clock]
    elif drive.kind == "fluctuating":
        rate = math.tau * drive.frequency_Hz
        kind, numbers = SINE, [first, drive.amplitude, rate, drive.phase_rad + rate * clock]
    elif drive.kind == "table":
        kind, numbers = TABLE, [0.0, 0.0, 0.0, clock]
        knots, pieces = pieces_of(_turning(drive))
    a, b, c, d = [*numbers, 0.0, 0.0, 0.0][:4]
    return Drive(kind, (a, b, c, d), knots, pieces)


def _turning(table: TableDrive) -> object:
    """Return the B-spline of a table; not-a-knot leaves out the knot next to an end without a slope."""
    t, angle = table.time_s, table.values
    if table.interpolation == "linear":
        return make_interp_spline(t, angle, k=1)
    first, last = table.end_slopes or (
        0.0 if angle[1] - angle[0] == 0 else None,
        0.0 if angle[-1] - angle[-2] == 0 else None,
    )
    inside = t[2 if first is None else 1 : -2 if last is None else -1]
    ends = tuple(None if slope is None else [(1, slope)] for slope in (first, last))
    return make_interp_spline(t, angle, k=3, t=[*[t[0]] * 4, *inside, *[t[-1]] * 4], bc_type=ends)


def pieces_of(spline: object) -> tuple[FloatArray, FloatArray]:
    """Return the knots (n,) of a B-spline, cubic at most, and its cubics' coefficients (4, n - 1)."""
    pieces = PPoly.from_spline(spline)
    wide = np.diff(pieces.x) > 0
    cubics = np.zeros((4, np.count_nonzero(wide)))
    cubics[-len(pieces.c) :] = pieces.c[:, wide]
    return np.append(pieces.x[:-1][wide], pieces.x[-1]), cubics


def stops_s(drive: Drive) -> FloatArray:
    """Return the times at which a derivative of the prescribed speed jumps."""
    if drive.kind == RAMP:
        return np.array([drive.numbers[2] - drive.numbers[3]])
    return drive.knots - drive.numbers[3]


@njit(error_model="numpy")
def piece_at(knots: FloatArray, x: float) -> int:
    """Return the number of the piece that x is in; the first and the last go on beyond the ends."""
    low, high = 0, len(knots) - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if knots[middle] <= x else (low, middle)
    return low


@njit(error_model="numpy")
def prescribed_speed(drive: Drive, t: float) -> float:
    """Return the crank's speed in rad/s, by a drive that prescribes it, at a time since the run began."""
    first, change, rate, phase = drive.numbers
    if drive.kind == RAMP:
        x = min((phase + t) / rate, 1.0)
        return float(first + change * (10 * x**3 - 15 * x**4 + 6 * x**5))
    if drive.kind == SINE:
        return float(first + change * math.sin(rate * t + phase))
    if drive.kind == TABLE:
        k = piece_at(drive.knots, t + phase)
        x = t + phase - drive.knots[k]
        return float((3 * drive.pieces[0, k] * x + 2 * drive.pieces[1, k]) * x + drive.pieces[2, k])
    return float(first)


@njit(error_model="numpy")
def prescribed_acceleration(drive: Drive, t: float) -> float:
    """Return the derivative of the prescribed speed in rad/s^2."""
    _, change, rate, phase = drive.numbers
    if drive.kind == RAMP:
        x = min((phase + t) / rate, 1.0)
        return float(change / rate * (30 * x**2 - 60 * x**3 + 30 * x**4))
    if drive.kind == SINE:
        return float(change * rate * math.cos(rate * t + phase))
    if drive.kind == TABLE:
        k = piece_at(drive.knots, t + phase)
        return float(6 * drive.pieces[0, k] * (t + phase - drive.knots[k]) + 2 * drive.pieces[1, k])
    return 0.0


@njit(error_model="numpy")
def torque(drive: Drive, speed: float) -> float:
    """Return the torque in N m of a drive that does not prescribe the speed."""
    if drive.kind == MOTOR:
        return float(drive.numbers[0] * (drive.numbers[1] - speed))
    return float(drive.numbers[0]) if drive.kind == TORQUE else 0.0


def start_speed(scene: Scene) -> float:
    """Return the crank's speed in rad/s as the run begins."""
    if scene.speed_is_prescribed:
        return float(prescribed_speed(drive_of(scene), 0.0))
    return scene.start.crank_speed_rad_s

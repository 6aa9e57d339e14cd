"""Tables as cubic pieces, by B-splines. Which piece is meant is told: steps can end where it changes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly, make_interp_spline

from reference_solver.mechanism.data import Table
from studies.truth.machine import bare

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Columns of a piece: where it begins, and coefficients of s^3, s^2, s, 1, s counted from there.
BEGIN = 0


class Tables(NamedTuple):
    """All tables one after the other: ``pieces`` (q, 5).

    ``at`` (n, 2) has the first piece and how many of each table, ``ends`` (n, 2) where its last piece ends
    and its period, 0 without one.
    """

    at: NDArray[np.int64]
    ends: FloatArray
    pieces: FloatArray


def pieces_of(table: Table) -> FloatArray:
    """Return the pieces (n, 5) of a table, and behind them one of which only the beginning is meant."""
    x, y = np.array(table.x), np.array(table.y)
    order = 1 if table.interpolation == "linear" else 3
    if table.period:
        x[-1], y[-1] = x[0] + table.period, y[0]
        spline = make_interp_spline(x, y, k=order, bc_type="periodic")
    elif order == 1:
        spline = make_interp_spline(x, y, k=1)
    else:
        spline = _spline(x, y, table.end_slopes)
    found = PPoly.from_spline(spline)
    wide = (np.diff(found.x) > 0) & (found.x[:-1] >= x[0]) & (found.x[:-1] < x[-1])
    rows = np.zeros((np.count_nonzero(wide) + 1, 5))
    rows[:-1, BEGIN], rows[-1, BEGIN] = found.x[:-1][wide], x[-1]
    rows[:-1, 5 - len(found.c) :] = found.c[:, wide].T
    return rows


def _spline(x: FloatArray, y: FloatArray, slopes: tuple[float | None, float | None] | None) -> object:
    """Return a spline; not-a-knot leaves out the knot next to an end without a slope."""
    first, last = slopes or (
        0.0 if y[1] - y[0] == 0 else None,
        0.0 if y[-1] - y[-2] == 0 else None,
    )
    inside = x[2 if first is None else 1 : -2 if last is None else -1]
    ends = tuple(None if slope is None else [(1, slope)] for slope in (first, last))
    return make_interp_spline(x, y, k=3, t=[*[x[0]] * 4, *inside, *[x[-1]] * 4], bc_type=ends)


def tables_of(tables: list[Table]) -> Tables:
    """Return tables in numbers."""
    parts = [pieces_of(table) for table in tables]
    counts = [len(part) - 1 for part in parts]
    at = [(sum(counts[:k]), count) for k, count in enumerate(counts)]
    ends = [(part[-1, BEGIN], table.period) for part, table in zip(parts, tables, strict=True)]
    pieces = np.concatenate([np.zeros((0, 5)), *(part[:-1] for part in parts)])
    return Tables(
        np.array(at, np.int64).reshape(-1, 2),
        np.array(ends, float).reshape(-1, 2),
        np.ascontiguousarray(pieces),
    )


@bare
def knot(tables: Tables, table: int, piece: float) -> float:
    """Return where a piece begins; they are counted on from period to period."""
    first, count, period = tables.at[table, 0], tables.at[table, 1], tables.ends[table, 1]
    if period > 0.0:
        turns, k = divmod(piece, float(count))
        return float(tables.pieces[first + int(k), BEGIN] + turns * period)
    return float(tables.pieces[first + int(piece), BEGIN] if piece < count else tables.ends[table, 0])


@bare
def piece_at(tables: Tables, table: int, x: float) -> float:
    """Return the piece that x is in: of a table that does not repeat -1 before it, and its count beyond."""
    first, low, high = tables.at[table, 0], 0, tables.at[table, 1]
    count, period, turns = float(high), tables.ends[table, 1], 0.0
    if period > 0.0:
        turns = np.floor((x - tables.pieces[first, BEGIN]) / period)
        x -= turns * period
    elif x < tables.pieces[first, BEGIN]:
        return -1.0
    elif x >= tables.ends[table, 0]:
        return count
    while high - low > 1:
        middle = (low + high) // 2
        if tables.pieces[first + middle, BEGIN] <= x:
            low = middle
        else:
            high = middle
    return float(turns * count + low)


@bare
def value_in(tables: Tables, table: int, piece: float, x: float) -> tuple[float, float, float]:
    """Return the value and two derivatives of a piece, which goes on beyond its ends."""
    first, count = tables.at[table, 0], float(tables.at[table, 1])
    s = x - knot(tables, table, piece)
    p = tables.pieces[first + int(piece % count)]
    return (
        ((p[1] * s + p[2]) * s + p[3]) * s + p[4],
        (3.0 * p[1] * s + 2.0 * p[2]) * s + p[3],
        6.0 * p[1] * s + 2.0 * p[2],
    )


@bare
def value_at(tables: Tables, table: int, x: float) -> tuple[float, float, float]:
    """Return the value and two derivatives of a table; its first and last pieces go on beyond its ends."""
    piece = piece_at(tables, table, x)
    if tables.ends[table, 1] == 0.0:
        piece = min(max(piece, 0.0), tables.at[table, 1] - 1.0)
    return value_in(tables, table, piece, x)

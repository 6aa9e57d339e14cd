"""What becomes of pins on rigid walls at one time: one hits, or is no more pressed; others follow or leave.

The jump of z' is from the mass matrix of ``equations``, by Newton's restitution and Coulomb's friction. A
flight that would be too short is none: its pin hits without rebound.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.truth.equations import (
    CONTACT,
    FLIGHT,
    FOLLOWS,
    GAP,
    NORMAL,
    PIECE,
    assemble,
    fill_sliding_row,
    place,
)
from studies.truth.machine import bare, interpreted
from studies.truth.physics import MU, SLOWEST, C, E, K
from studies.truth.record import OF_TOLD, Mechanism, Packed, parts
from studies.truth.switches import piece_of

FloatArray = NDArray[np.float64]
#: A part of the largest speed: a pin that moves no faster along the normal has not left its wall.
RESTING = 1e-12
#: The part of the time within which a pin hits at the same instant as another.
AT_ONCE = 1e-13
#: Of speeds, as a part of the largest in them.
ROUND_OFF = 1e-14


class Paradox(Exception):
    """No forces or impulses of rigid walls fit, or several do: friction (Painleve), or two hits at once."""


@dataclass(frozen=True)
class Impulse:
    """What a joint got of an impact: approach speed, normal impulse in N s, and energy lost in J."""

    joint: int
    speed_m_s: float
    normal_N_s: float
    lost_J: float


@dataclass(frozen=True)
class Impact:
    """The rates u' after it, what every joint that touches got, and a driver's impulse in N s or N m s."""

    rate: FloatArray
    impulses: tuple[Impulse, ...] = ()
    driver_N_s: float = 0.0


@dataclass(frozen=True)
class Rows:
    """At a state: M (n, n), the inverse of its part that is not driven, T (m, n), and rows (k, n) of joints.

    ``normal`` makes speeds outwards of z', ``sliding`` sliding speeds; ``order`` (n,) are the coordinates z.
    """

    M: FloatArray
    inverse: FloatArray
    T: FloatArray
    normal: FloatArray
    sliding: FloatArray
    order: NDArray[np.int64]


@bare
def walls_at(p: Packed, phases: FloatArray, y: FloatArray, normal: FloatArray, sliding: FloatArray) -> None:
    """Fill M, T and the rows (k, n) of normal and sliding speeds at a state in gaps; no pin follows."""
    m = parts(p)
    w = m.work
    place(m, phases, y)
    assemble(m)
    for k in range(len(m.walls)):
        x = m.joints[k, GAP]
        distance = np.hypot(w.u[x], w.u[x + 1])
        fill_sliding_row(m, k)
        for i in range(len(m.q)):
            normal[k, i] = (w.u[x] * w.T[x, i] + w.u[x + 1] * w.T[x + 1, i]) / distance
            sliding[k, i] = 0.0
            for j in range(len(m.row)):
                sliding[k, i] += m.row[j] * w.T[j, i]


class RigidWalls:
    """The rigid walls of a mechanism, while its compliant contacts stay in their phases.

    Flights that are shorter than ``shortest_s``, or lower than the part ``lowest`` of the clearance, are
    none. ``rates`` and ``rows`` are compiled functions of ``equations`` and of ``walls_at``.
    """

    def __init__(
        self, p: Packed, m: Mechanism, rates: Any, rows: Any, shortest_s: float, lowest: float
    ) -> None:
        self.p, self.m = p, m
        self.rates, self.fill_rows, self.shortest_s, self.lowest = rates, rows, shortest_s, lowest
        self.size, self.time = len(m.row), 2 * len(m.row)

    def settled(
        self, y: FloatArray, phases: FloatArray, joint: int, following: Sequence[int]
    ) -> tuple[Impact, tuple[int, ...]]:
        """Return what a pin's arrival at its wall does, or the end of its following, and who follows now.

        ``y`` (state,) is the state in gaps, and ``phases`` (k, 3) those before.
        """
        closed, after = list(following), Impact(self._speeds(y).copy())
        if joint in closed:
            closed.remove(joint)
        else:
            self._require_alone(y, joint, following)
            after = self._hit(y, phases, joint, following)
            closed.append(joint)
            y = self._moving(y, after.rate)
            # A pin has left where more than round-off of its speeds is left along the normal.
            fastest = float(np.abs(after.rate * self.m.tree.unit).max())
            rest = max(1e-9 * after.impulses[0].speed_m_s, RESTING * fastest)
            closed = [
                k for k in closed if self._inward(y, k) < rest or not self._flies(y, phases, k, following)
            ]
            after = Impact(self._kept(y, closed), after.impulses, after.driver_N_s)
        return after, self._pressed(self._moving(y, after.rate), phases, closed)

    def rows_at(self, y: FloatArray) -> Rows:
        """Return what walls need at a state in gaps."""
        m, w = self.m, self.m.work
        n, joints = len(m.q), len(m.walls)
        normal, sliding = np.empty((2, joints, n))
        self.fill_rows(self.p, np.zeros((joints + len(m.kinks), 3)), y, normal, sliding)
        first, inverse = int(m.driven >= 0), np.zeros((n, n))
        inverse[first:, first:] = np.linalg.inv(m.M[first:, first:])
        return Rows(m.M.copy(), inverse, w.T.copy(), normal, sliding, w.order[:n].copy())

    def sliding_m_s(self, z: FloatArray, phases: FloatArray, k: int) -> float:
        """Return the sliding speed of a pin."""
        y = self.gaps_of(z, phases)
        at = self.rows_at(y)
        return float(at.sliding[k] @ self._speeds(y)[at.order])

    def gaps_of(self, z: FloatArray, phases: FloatArray) -> FloatArray:
        """Return y of z."""
        y = np.array(z)
        for k in np.flatnonzero(phases[: len(self.m.walls), CONTACT] == FOLLOWS).tolist():
            x, c = int(self.m.joints[k, GAP]), self.m.walls[k, C]
            d, rate = c * np.array([np.cos(z[x]), np.sin(z[x])]), z[self.size + x]
            y[x : x + 2] = d
            y[self.size + x : self.size + x + 2] = rate * np.array([-d[1], d[0]])
        return y

    def _require_alone(self, y: FloatArray, joint: int, following: Sequence[int]) -> None:
        """Raise a paradox where another pin hits at the same instant: an impact here is of one."""
        for k in set(np.flatnonzero(np.isinf(self.m.walls[:, K])).tolist()) - {joint, *following}:
            x = self.m.joints[k, GAP]
            left_m = self.m.walls[k, C] - np.hypot(*y[x : x + 2])
            if left_m < -self._inward(y, k) * AT_ONCE * y[self.time]:
                raise Paradox(f"joints {joint} and {k} hit at one instant")

    def _hit(self, y: FloatArray, phases: FloatArray, joint: int, following: Sequence[int]) -> Impact:
        """Return the impact, without rebound if the pin is too slow or would be back too soon."""
        wall = self.m.walls[joint]
        e = float(wall[E]) if -self._inward(y, joint) >= wall[SLOWEST] else 0.0
        hit = self._impact(y, joint, following, e)
        if e and not self._flies(self._moving(y, hit.rate), phases, joint, following):
            return self._impact(y, joint, following, 0.0)
        return hit

    def _impact(self, y: FloatArray, joint: int, following: Sequence[int], restitution: float) -> Impact:
        """Return what a pin's hit makes of u' while others follow, by Newton's and Coulomb's laws.

        Every pin that touches gets no impulse, or one that leaves it Newton's speed, and sticks or slides one
        way: the first case whose signs and limits hold is it.
        """
        at, touching = self.rows_at(y), [joint, *following]
        friction, speeds = self.m.walls[touching, MU], self._speeds(y)[at.order]
        D = np.array([row for k in touching for row in (-at.normal[k], at.sliding[k])])
        W, u = D @ at.inverse @ D.T, D @ speeds
        approach = -u[::2]
        u[2::2] = 0.0  # they follow
        slack = 1e-12 * abs(u[0]) + ROUND_OFF * float(np.max(np.abs(D) @ np.abs(speeds)))
        newton = np.zeros(len(touching))
        newton[0] = -restitution * u[0]
        for case in product(*(("none", "stick", "up", "down") if mu else ("none", "up") for mu in friction)):
            impulse = _impulse_of(case, W, u, newton, friction)
            after = u + W @ impulse
            if _fits(case, impulse, after, newton, friction, slack):
                break
        else:
            raise Paradox(f"no impulses of joints {touching} fit")
        if impulse @ (u + after) > slack * np.abs(impulse).sum():
            raise Paradox(f"the impulses of joints {touching} would add energy")
        jump, lost = at.inverse @ D.T @ impulse, -impulse * (u + after) / 2
        driver = float(at.M[0] @ jump - D[:, 0] @ impulse) if self.m.driven >= 0 else 0.0
        shares = zip(touching, approach, impulse[::2], lost[::2] + lost[1::2], strict=True)
        got = tuple(Impulse(k, float(v), float(p), float(part)) for k, v, p, part in shares)
        return Impact(at.T @ (speeds + jump), got, driver)

    def _speeds(self, y: FloatArray) -> FloatArray:
        return y[self.size : self.time]

    def _moving(self, y: FloatArray, rate: FloatArray) -> FloatArray:
        return np.asarray(np.concatenate([y[: self.size], rate, y[self.time :]]))

    def _inward(self, y: FloatArray, k: int) -> float:
        x = self.m.joints[k, GAP]
        d = y[x : x + 2]
        return -float(d @ self._speeds(y)[x : x + 2] / np.hypot(*d))

    def _flies(self, y: FloatArray, phases: FloatArray, k: int, following: Sequence[int]) -> bool:
        leaving = self._inward(y, k)
        pushed = self._outward(y, phases, k, [other for other in following if other != k])
        height = self.lowest * self.m.walls[k, C]
        return bool(2 * leaving >= self.shortest_s * pushed and leaving * abs(leaving) >= 2 * height * pushed)

    def _kept(self, y: FloatArray, closed: Sequence[int]) -> FloatArray:
        """Return u' without the normal speeds of pins that stay on their walls."""
        if not closed:
            return self._speeds(y)
        at = self.rows_at(y)
        rate, rows = self._speeds(y)[at.order], at.normal[list(closed)]
        solved = np.linalg.solve(rows @ at.inverse @ rows.T, rows @ rate)
        return np.asarray(at.T @ (rate - at.inverse @ rows.T @ solved))

    def placed_on_walls(self, y: FloatArray, phases: FloatArray, following: Sequence[int]) -> FloatArray:
        """Return z of y, and change the phases of rigid walls so that these pins follow and no others do."""
        z, speeds = np.array(y), self._speeds(y)
        for k in np.flatnonzero(np.isinf(self.m.walls[:, K])).tolist():
            x = int(self.m.joints[k, GAP])
            phases[k, CONTACT] = FLIGHT
            if k in following:
                at, (d_x, d_y), (v_x, v_y) = self.rows_at(y), y[x : x + 2], speeds[x : x + 2]
                phases[k, CONTACT] = FOLLOWS
                sliding = float(at.sliding[k] @ speeds[at.order])
                phases[k, PIECE] = interpreted(piece_of)(self.m.walls[k], sliding)
                z[x : x + 2] = np.arctan2(d_y, d_x), 0.0
                turn = (d_x * v_y - d_y * v_x) / self.m.walls[k, C] ** 2
                z[self.size + x : self.size + x + 2] = turn, 0.0
        return z

    def _answer(
        self, y: FloatArray, phases: FloatArray, following: Sequence[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Return what ``rates`` fills while these pins follow."""
        out, told, mine = np.empty(len(y)), np.empty(self.p.told), phases.copy()
        z = self.placed_on_walls(y, mine, following)
        self.rates(self.p, mine, z, out, told)
        return out, told

    def _outward(self, y: FloatArray, phases: FloatArray, k: int, following: Sequence[int]) -> float:
        """Return the acceleration of a pin on its wall, outwards, while others follow."""
        x, out = self.m.joints[k, GAP], self._answer(y, phases, following)[0]
        d, v = y[x : x + 2], self._speeds(y)[x : x + 2]
        pushed = out[self.size + x : self.size + x + 2]
        return float(d @ pushed / np.hypot(*d) + v @ v / self.m.walls[k, C])

    def _pressed(self, y: FloatArray, phases: FloatArray, closed: Sequence[int]) -> tuple[int, ...]:
        """Return which pins without normal speed follow: those pressed, while all others move inwards."""
        fits = []
        for count in range(len(closed) + 1):
            for some in combinations(sorted(closed), count):
                told = self._answer(y, phases, some)[1]
                leaving = [k for k in closed if k not in some]
                if all(told[OF_TOLD * k + NORMAL] > 0 for k in some) and all(
                    self._outward(y, phases, k, some) <= 0 for k in leaving
                ):
                    fits.append(some)
        if len(fits) != 1:
            raise Paradox(f"{len(fits)} sets of joints {closed} fit")
        return fits[0]


def _impulse_of(
    case: tuple[str, ...], W: FloatArray, u: FloatArray, newton: FloatArray, friction: FloatArray
) -> FloatArray:
    """Return normal and tangential impulses by joint in turns, of joints that stick, slide or get none."""
    A, a = np.eye(len(u)), np.zeros(len(u))
    for k, kind in enumerate(case):
        n, s = 2 * k, 2 * k + 1
        if kind != "none":
            A[n], a[n] = W[n], newton[k] - u[n]
        if kind == "stick":
            A[s], a[s] = W[s], -u[s]
        elif kind != "none":
            A[s, n] = friction[k] if kind == "up" else -friction[k]
    return np.asarray(np.linalg.solve(A, a))


def _fits(
    case: tuple[str, ...],
    impulse: FloatArray,
    after: FloatArray,
    newton: FloatArray,
    friction: FloatArray,
    slack: float,
) -> bool:
    """Return whether walls push, no pin is slower than Newton's, and friction is in its limit and brakes."""
    hair = 1e-12 * np.abs(impulse).max()
    return all(
        impulse[2 * k] >= 0
        and after[2 * k] >= newton[k] - slack
        and abs(impulse[2 * k + 1]) <= friction[k] * impulse[2 * k] + hair
        and (kind in ("none", "stick") or not friction[k] or after[2 * k + 1] * impulse[2 * k + 1] <= 0)
        for k, kind in enumerate(case)
    )

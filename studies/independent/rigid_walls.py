"""What becomes of pins on rigid walls at one time: one hits, or is no more pressed; others follow or leave.

The jump of w' is from the mass matrix of ``equations``, by Newton's restitution and Coulomb's friction. A
flight that would be too short is none: its pin hits without rebound.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np

from studies.independent.equations import (
    CONTACT,
    FLIGHT,
    FOLLOWS,
    NORMAL,
    PIECE,
    STATE,
    TIME,
    assemble,
    fill_sliding_row,
    kinematics,
)
from studies.independent.mechanism import SIZE, FloatArray, Mechanism
from studies.independent.switches import piece_of

#: A part of the crank's speed: a pin that moves no faster along the normal has not left its wall.
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
    """The rates w' after it, what every joint that touches got, and a driver's angular impulse in N m s."""

    rate: FloatArray
    impulses: tuple[Impulse, ...] = ()
    driver_N_m_s: float = 0.0


class RigidWalls:
    """The rigid walls of a mechanism, while its compliant contacts stay in their phases.

    Flights that are shorter than ``shortest_s``, or lower than the part ``lowest`` of the clearance, are
    none. ``rates`` is the compiled function of ``equations``.
    """

    def __init__(self, m: Mechanism, rates: Any, shortest_s: float, lowest: float) -> None:
        self.m, self.rates, self.shortest_s, self.lowest = m, rates, shortest_s, lowest

    def settled(
        self, y: FloatArray, phases: FloatArray, joint: int, following: Sequence[int]
    ) -> tuple[Impact, tuple[int, ...]]:
        """Return what a pin's arrival at its wall does, or the end of its following, and who follows now.

        ``y`` (STATE,) is the state in the coordinates w, and ``phases`` (4, 3) those before.
        """
        closed, after = list(following), Impact(y[SIZE:TIME].copy())
        if joint in closed:
            closed.remove(joint)
        else:
            self._require_alone(y, joint, following)
            after = self._hit(y, phases, joint, following)
            closed.append(joint)
            y = self._moving(y, after.rate)
            # A pin has left where more than round-off of its speeds is left along the normal.
            crank = self.m.bodies.crank_m * abs(after.rate[0])
            rest = max(1e-9 * after.impulses[0].speed_m_s, RESTING * crank)
            closed = [
                k for k in closed if self._inward(y, k) < rest or not self._flies(y, phases, k, following)
            ]
            after = Impact(self._kept(y, closed), after.impulses, after.driver_N_m_s)
        return after, self._pressed(self._moving(y, after.rate), phases, closed)

    def _require_alone(self, y: FloatArray, joint: int, following: Sequence[int]) -> None:
        """Raise a paradox where another pin hits at the same instant: an impact here is of one."""
        for k in set(np.flatnonzero(np.isinf(self.m.walls.K)).tolist()) - {joint, *following}:
            left_m = self.m.walls.c[k] - np.hypot(*y[2 * k + 1 : 2 * k + 3])
            if left_m < -self._inward(y, k) * AT_ONCE * y[TIME]:
                raise Paradox(f"joints {joint} and {k} hit at one instant")

    def _hit(self, y: FloatArray, phases: FloatArray, joint: int, following: Sequence[int]) -> Impact:
        """Return the impact, without rebound if the pin is too slow or would be back too soon."""
        walls = self.m.walls
        e = float(walls.e[joint]) if -self._inward(y, joint) >= walls.slowest[joint] else 0.0
        hit = self._impact(y, joint, following, e)
        if e and not self._flies(self._moving(y, hit.rate), phases, joint, following):
            return self._impact(y, joint, following, 0.0)
        return hit

    def _impact(self, y: FloatArray, joint: int, following: Sequence[int], restitution: float) -> Impact:
        """Return what a pin's hit makes of w' while others follow, by Newton's and Coulomb's laws.

        Every pin that touches gets no impulse, or one that leaves it Newton's speed, and sticks or slides one
        way: the first case whose signs and limits hold is it.
        """
        M, inverse = self._mass(y)
        touching, friction = (joint, *following), self.m.walls.mu[[joint, *following]]
        D = np.array([row for k in touching for row in (-self._normal(y, k), self.sliding_row(y, k))])
        W, u = D @ inverse @ D.T, D @ y[SIZE:TIME]
        approach = -u[::2]
        u[2::2] = 0.0  # they follow
        slack = 1e-12 * abs(u[0]) + ROUND_OFF * float(np.max(np.abs(D) @ np.abs(y[SIZE:TIME])))
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
        jump, lost = inverse @ D.T @ impulse, -impulse * (u + after) / 2
        driver = 0.0 if 0 in self.m.bodies.free else float(M[0] @ jump - D[:, 0] @ impulse)
        shares = zip(touching, approach, impulse[::2], lost[::2] + lost[1::2], strict=True)
        got = tuple(Impulse(k, float(v), float(p), float(part)) for k, v, p, part in shares)
        return Impact(y[SIZE:TIME] + jump, got, driver)

    def _mass(self, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M, and the inverse of its part of the coordinates that move on their own."""
        M, J, bias = np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE)
        x = kinematics(self.m.bodies, y, J, bias)
        assemble(self.m, y, x, J, bias, M, np.empty(SIZE), np.empty(4))
        inverse, free = np.zeros((SIZE, SIZE)), np.ix_(self.m.bodies.free, self.m.bodies.free)
        inverse[free] = np.linalg.inv(M[free])
        return M, inverse

    def _normal(self, y: FloatArray, k: int) -> FloatArray:
        """Return the row (SIZE,) of a joint's speed outwards."""
        row, d = np.zeros(SIZE), y[2 * k + 1 : 2 * k + 3]
        row[2 * k + 1 : 2 * k + 3] = d / np.hypot(*d)
        return row

    def sliding_row(self, y: FloatArray, k: int) -> FloatArray:
        """Return the row (SIZE,) of a joint's sliding speed."""
        J, row = np.empty((SIZE, SIZE)), np.empty(SIZE)
        kinematics(self.m.bodies, y, J, np.empty(SIZE))
        fill_sliding_row(self.m.walls, k, y, J[5], row)
        return row

    def _moving(self, y: FloatArray, rate: FloatArray) -> FloatArray:
        return np.asarray(np.concatenate([y[:SIZE], rate, y[TIME:]]))

    def _inward(self, y: FloatArray, k: int) -> float:
        return -float(self._normal(y, k) @ y[SIZE:TIME])

    def _flies(self, y: FloatArray, phases: FloatArray, k: int, following: Sequence[int]) -> bool:
        leaving = self._inward(y, k)
        pushed = self._outward(y, phases, k, [other for other in following if other != k])
        height = self.lowest * self.m.walls.c[k]
        return bool(2 * leaving >= self.shortest_s * pushed and leaving * abs(leaving) >= 2 * height * pushed)

    def _kept(self, y: FloatArray, closed: Sequence[int]) -> FloatArray:
        """Return w' without the normal speeds of pins that stay on their walls."""
        rate = y[SIZE:TIME]
        if not closed:
            return rate
        _, inverse = self._mass(y)
        rows = np.array([self._normal(y, k) for k in closed])
        solved = np.linalg.solve(rows @ inverse @ rows.T, rows @ rate)
        return np.asarray(rate - inverse @ rows.T @ solved)

    def placed_on_walls(self, y: FloatArray, phases: FloatArray, following: Sequence[int]) -> FloatArray:
        """Return z of y, and change the phases of rigid walls so that these pins follow and no others do."""
        z = np.array(y)
        for k in np.flatnonzero(np.isinf(self.m.walls.K)).tolist():
            x = 2 * k + 1
            phases[k, CONTACT] = FLIGHT
            if k in following:
                (d_x, d_y), (v_x, v_y) = y[x : x + 2], y[SIZE + x : SIZE + x + 2]
                phases[k, CONTACT] = FOLLOWS
                phases[k, PIECE] = piece_of(self.m.walls, k, float(self.sliding_row(y, k) @ y[SIZE:TIME]))
                z[x : x + 2] = np.arctan2(d_y, d_x), 0.0
                z[SIZE + x : SIZE + x + 2] = (d_x * v_y - d_y * v_x) / self.m.walls.c[k] ** 2, 0.0
        return z

    def _answer(
        self, y: FloatArray, phases: FloatArray, following: Sequence[int]
    ) -> tuple[FloatArray, FloatArray]:
        """Return what ``rates`` fills while these pins follow."""
        out, told, mine = np.empty(STATE), np.empty((4, 3)), phases.copy()
        z = self.placed_on_walls(y, mine, following)
        self.rates(self.m, mine, z, out, told)
        return out, told

    def _outward(self, y: FloatArray, phases: FloatArray, k: int, following: Sequence[int]) -> float:
        """Return the acceleration of a pin on its wall, outwards, while others follow."""
        place, out = slice(SIZE + 2 * k + 1, SIZE + 2 * k + 3), self._answer(y, phases, following)[0]
        turning = y[place] @ y[place] / self.m.walls.c[k]
        return float(self._normal(y, k) @ out[SIZE:TIME] + turning)

    def _pressed(self, y: FloatArray, phases: FloatArray, closed: Sequence[int]) -> tuple[int, ...]:
        """Return which pins without normal speed follow: those pressed, while all others move inwards."""
        fits = []
        for count in range(len(closed) + 1):
            for some in combinations(sorted(closed), count):
                told = self._answer(y, phases, some)[1]
                leaving = [k for k in closed if k not in some]
                if all(told[k, NORMAL] > 0 for k in some) and all(
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

"""A pin in its bearing between two live Pymunk bodies: where it stands, how fast the surfaces move.

d points from the bearing's centre to the pin's, n = d/|d|, t = (-n_y, n_x). Both centres lie on the x axis of
their bodies. The surfaces meet in the middle of the penetration delta = |d| - c.
"""

import math
from typing import NamedTuple

import pymunk

from engine_models.scene.scene import Clearance

Pair = tuple[float, float]


class PinLost(Exception):
    """The pin's centre is further from the bearing's than the bearing's radius: it is through the wall."""


class Touch(NamedTuple):
    """A contact at one position: n, penetration in m, and what speeds at it are made of.

    ``arm_i`` and ``arm_j`` lead from the origins of the bodies of bearing and pin to the centres of bearing
    and pin, ``reach_i`` and ``reach_j`` in m from there to the contact point, along n.
    """

    n: Pair
    penetration_m: float
    arm_i: Pair
    arm_j: Pair
    reach_i: float
    reach_j: float


class PinInBearing:
    """The bearing of radius R_i at (x_i, 0) of its body, the pin of radius R_i - c at (x_j, 0) of its own."""

    def __init__(
        self, name: str, bearing: tuple[pymunk.Body, float], pin: tuple[pymunk.Body, float], room: Clearance
    ) -> None:
        self.name, self.room = name, room
        (self.bearing, self.bearing_x), (self.pin, self.pin_x) = bearing, pin
        self._c, self._R = room.radial_clearance_m, room.bearing_radius_m

    def touch(self) -> Touch | None:
        """Return the contact at the bodies' present positions, None in flight.

        Raises:
            PinLost: the pin is through the wall.
        """
        i, j, x_i, x_j = self.bearing, self.pin, self.bearing_x, self.pin_x
        place_x, place_y = j.position
        origin_x, origin_y = i.position
        d_x, d_y = place_x - origin_x, place_y - origin_y
        arm_i_x = arm_i_y = arm_j_x = arm_j_y = 0.0
        if x_i:
            along = i.rotation_vector
            arm_i_x, arm_i_y = x_i * along.x, x_i * along.y
            d_x, d_y = d_x - arm_i_x, d_y - arm_i_y
        if x_j:
            along = j.rotation_vector
            arm_j_x, arm_j_y = x_j * along.x, x_j * along.y
            d_x, d_y = d_x + arm_j_x, d_y + arm_j_y
        distance = math.hypot(d_x, d_y)
        if not distance > self._c:
            return None
        if distance > self._R:
            raise PinLost(f"pin through the wall of its bearing at joint {self.name}")
        delta = distance - self._c
        return Touch(
            (d_x / distance, d_y / distance),
            delta,
            (arm_i_x, arm_i_y),
            (arm_j_x, arm_j_y),
            self._R + delta / 2,
            self._R - self._c - delta / 2,
        )

    def speeds(self, at: Touch) -> Pair:
        """Return delta' and the pin's sliding speed along t in m/s, by the bodies' present velocities."""
        i, j = self.bearing, self.pin
        (v_x, v_y), (w_x, w_y) = j.velocity, i.velocity
        spin_i, spin_j = i.angular_velocity, j.angular_velocity
        (n_x, n_y), (a_x, a_y), (b_x, b_y) = at.n, at.arm_i, at.arm_j
        rate_x = v_x - spin_j * b_y - w_x + spin_i * a_y
        rate_y = v_y + spin_j * b_x - w_y - spin_i * a_x
        sliding = n_x * rate_y - n_y * rate_x + spin_j * at.reach_j - spin_i * at.reach_i
        return n_x * rate_x + n_y * rate_y, sliding

    def bearing_point(self, at: Touch) -> Pair:
        """Return the contact point by the bearing, in m in the global frame."""
        x, y = self.bearing.position
        return x + at.arm_i[0] + at.reach_i * at.n[0], y + at.arm_i[1] + at.reach_i * at.n[1]

    def pin_point(self, at: Touch) -> Pair:
        """Return the contact point by the pin, in m in the global frame."""
        x, y = self.pin.position
        return x + at.arm_j[0] + at.reach_j * at.n[0], y + at.arm_j[1] + at.reach_j * at.n[1]

"""A pin in its bearing between two live Pymunk bodies: where it stands, how fast the surfaces move.

d points from the bearing's centre to the pin's, n = d/|d|, t = (-n_y, n_x). Geometry and signs are those of
``mechanics.joints``, of numbers in place of arrays: it is done in every step.
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

    ``bearing_at`` and ``pin_at`` lead from the origins of the two bodies to the centres of bearing and pin,
    ``bearing_lever`` and ``pin_lever`` in m from there to the contact point, along n.
    """

    n: Pair
    penetration_m: float
    bearing_at: Pair
    pin_at: Pair
    bearing_lever: float
    pin_lever: float


class PinInBearing:
    """A bearing of radius R at (bearing_x, 0) of its body, a pin of radius R - c at (pin_x, 0) of its own."""

    def __init__(
        self,
        name: str,
        bearing: tuple[pymunk.Body, float],
        pin: tuple[pymunk.Body, float],
        clearance: Clearance,
    ) -> None:
        self.name, self.clearance = name, clearance
        (self.bearing, self.bearing_x), (self.pin, self.pin_x) = bearing, pin
        self._c, self._R = clearance.radial_clearance_m, clearance.bearing_radius_m

    def touch(self) -> Touch | None:
        """Return the contact at the bodies' present positions, None in flight.

        Raises:
            PinLost: the pin is through the wall.
        """
        bearing_x, bearing_y = bearing_at = _turned(self.bearing, self.bearing_x)
        pin_x, pin_y = pin_at = _turned(self.pin, self.pin_x)
        place_x, place_y = self.pin.position
        origin_x, origin_y = self.bearing.position
        d_x, d_y = place_x - origin_x - bearing_x + pin_x, place_y - origin_y - bearing_y + pin_y
        distance = math.hypot(d_x, d_y)
        if not distance > self._c:
            return None
        if distance > self._R:
            raise PinLost(f"pin through the wall of its bearing at joint {self.name}")
        delta = distance - self._c
        levers = self._R + delta / 2, self._R - self._c - delta / 2
        return Touch((d_x / distance, d_y / distance), delta, bearing_at, pin_at, *levers)

    def speeds(self, at: Touch) -> Pair:
        """Return delta' and the pin's sliding speed along t in m/s, by the bodies' present velocities."""
        bearing, pin = self.bearing, self.pin
        (v_x, v_y), (w_x, w_y) = pin.velocity, bearing.velocity
        bearing_spin, pin_spin = bearing.angular_velocity, pin.angular_velocity
        (n_x, n_y), (a_x, a_y), (b_x, b_y) = at.n, at.bearing_at, at.pin_at
        rate_x = v_x - pin_spin * b_y - w_x + bearing_spin * a_y
        rate_y = v_y + pin_spin * b_x - w_y - bearing_spin * a_x
        sliding = n_x * rate_y - n_y * rate_x + pin_spin * at.pin_lever - bearing_spin * at.bearing_lever
        return n_x * rate_x + n_y * rate_y, sliding

    def bearing_point(self, at: Touch) -> Pair:
        """Return the contact point by the bearing, in m in the global frame."""
        return _reached(self.bearing, at.bearing_at, at.bearing_lever, at.n)

    def pin_point(self, at: Touch) -> Pair:
        """Return the contact point by the pin, in m in the global frame."""
        return _reached(self.pin, at.pin_at, at.pin_lever, at.n)


def _turned(body: pymunk.Body, place_m: float) -> Pair:
    """Return the vector from a body's origin to a place on its x axis; most are there and need no turning."""
    if not place_m:
        return 0.0, 0.0
    along = body.rotation_vector
    return place_m * along.x, place_m * along.y


def _reached(body: pymunk.Body, centre: Pair, lever: float, n: Pair) -> Pair:
    x, y = body.position
    return x + centre[0] + lever * n[0], y + centre[1] + lever * n[1]

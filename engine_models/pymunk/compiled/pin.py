"""A pin in its bearing, compiled: where it stands, how fast the surfaces move.

d points from the bearing's centre to the pin's, n = d/|d|, t = (-n_y, n_x). Geometry and signs are those of
``mechanics.joints``, of numbers in place of arrays: it is done in every step.
"""

import math

from numba.extending import register_jitable

from engine_models.pymunk.compiled.chipmunk import INNER
from engine_models.pymunk.compiled.loads import apart, drift
from engine_models.pymunk.compiled.records import CONTACT, FLIGHT, LOST


@register_jitable(**INNER)
def locate(pin, bearing, of_pin):
    """Set a pin's phase and geometry, with its bodies where they are; return whether it touches."""
    a_x, a_y, b_x, b_y, d_x, d_y = apart(pin, bearing, of_pin)
    distance = math.hypot(d_x, d_y)
    pin.d_x, pin.d_y, pin.a_x, pin.a_y, pin.b_x, pin.b_y = d_x, d_y, a_x, a_y, b_x, b_y
    if not distance > pin.clearance:
        pin.phase = FLIGHT
        return False
    pin.fresh = pin.phase == FLIGHT
    pin.depth = distance - pin.clearance
    pin.n_x, pin.n_y = d_x / distance, d_y / distance
    pin.phase = LOST if distance > pin.radius else CONTACT
    return pin.phase == CONTACT


@register_jitable(**INNER)
def touches_within(pin, bearing, of_pin, time_s):
    """Return whether a pin, where it has been located, touches or will within a time, at its present rate."""
    rate_x, rate_y = drift(bearing, of_pin, pin.a_x, pin.a_y, pin.b_x, pin.b_y)
    square = rate_x * rate_x + rate_y * rate_y
    outward = pin.d_x * rate_x + pin.d_y * rate_y
    inside = pin.clearance * pin.clearance - pin.d_x * pin.d_x - pin.d_y * pin.d_y
    # |d|^2 has grown by square t^2 + 2 outward t, which is largest at one end of the time.
    return inside <= max(0.0, square * time_s * time_s + 2 * outward * time_s)


@register_jitable(**INNER)
def speeds(pin, bearing, of_pin):
    """Return the rate of the penetration and the pin's sliding speed along t in m/s, at its contact."""
    rate_x, rate_y = drift(bearing, of_pin, pin.a_x, pin.a_y, pin.b_x, pin.b_y)
    turning = of_pin.spin * pin.pin_lever - bearing.spin * pin.bearing_lever
    return pin.n_x * rate_x + pin.n_y * rate_y, pin.n_x * rate_y - pin.n_y * rate_x + turning


@register_jitable(**INNER)
def enter_means(pin, bearing, of_pin, kick):
    """Make of the speeds before a kick, which it has, the means of before and after."""
    rate, sliding = speeds(pin, bearing, of_pin)
    kick.mean_rate = (kick.mean_rate + rate) / 2
    kick.mean_sliding = (kick.mean_sliding + sliding) / 2

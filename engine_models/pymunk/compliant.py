"""A compliant contact in Pymunk: the scene's law as a pair of forces, set between position and velocity.

A step moves the positions first, so a force must be set after that: before ``space.step`` it would see the
positions of the step before. A constraint's ``pre_solve`` is called at the right moment. The hook's is a
slide joint between the two centres, too long ever to act.
"""

import math
from typing import Any

import pymunk

from engine_models.pymunk.contact import ContactStep
from engine_models.pymunk.contact_law import NormalLaw, friction_share
from engine_models.pymunk.pin import PinInBearing, Touch


class CompliantContact:
    """The contact force of one pin, at x_k and, as far as it depends on speeds, at v of t_k - dt/2.

    ``step`` is the number of the kick that the next call belongs to.
    """

    def __init__(self, space: pymunk.Space, pin: PinInBearing, first_step: int) -> None:
        self.pin, self.step = pin, first_step
        self._steps: list[ContactStep] = []
        self._law, self._friction = NormalLaw(pin.room), pin.room.friction
        self.clips = self._law.clips
        self._approach = 0.0  # v0 of the present contact, valid while _touch is
        self._touch: Touch | None = None
        self._kick: ContactStep | None = None  # the last one, as known before it
        self.hook = pymunk.SlideJoint(
            pin.bearing, pin.pin, (pin.bearing_x, 0.0), (pin.pin_x, 0.0), 0.0, math.inf
        )
        self.hook.collide_bodies = False
        self.hook.max_force = self.hook.max_bias = math.inf
        self.hook.error_bias = 0.0
        self.hook.pre_solve = self._push
        space.add(self.hook)

    def _push(self, _hook: Any, space: pymunk.Space) -> None:
        self._finish()
        touch, new = self.pin.touch(), self._touch is None
        self._touch = touch
        step, self.step = self.step, self.step + 1
        if touch is None:
            return
        rate, sliding = self.pin.speeds(touch)
        if new:
            self._approach = rate
        normal, spring, clipped = self._law.force(touch.penetration_m, rate, self._approach)
        friction = 0.0
        if self._friction is not None:
            share = friction_share(self._friction, sliding)
            friction = -self._friction.coefficient * max(normal, 0.0) * share
        n_x, n_y = touch.n
        f_x, f_y = -normal * n_x - friction * n_y, -normal * n_y + friction * n_x
        point = self.pin.bearing_point(touch)
        for body, force in ((self.pin.pin, (f_x, f_y)), (self.pin.bearing, (-f_x, -f_y))):
            if body.body_type == pymunk.Body.DYNAMIC:
                body.apply_force_at_world_point(force, point)
        dt = space.current_time_step
        self._kick = ContactStep(step, normal * dt, friction * dt, rate, rate, sliding, spring * dt, clipped)

    def _finish(self) -> None:
        """Enter the last kick, now that the velocities after it are known."""
        kick, touch = self._kick, self._touch
        if kick is None or touch is None:
            return
        rate, sliding = self.pin.speeds(touch)
        self._kick = None
        self._steps.append(
            kick._replace(
                mean_rate=(kick.mean_rate + rate) / 2, mean_sliding=(kick.mean_sliding + sliding) / 2
            )
        )

    def taken(self) -> list[ContactStep]:
        """Return the kicks in contact since the last call, and forget them."""
        self._finish()
        steps, self._steps = self._steps, []
        return steps

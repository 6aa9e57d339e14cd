"""A rigid contact in Pymunk: a circle in a circle, whose contact is rewritten in a collision handler.

Pymunk knows no hollow circle: a pin's circle inside its bearing's overlaps it, and would be thrown out. Its
contact is there in every step, though, and may be changed before it is solved. In flight it is ignored; past
the wall it gets the normal and the points of a pin that touches its bearing from inside. From there on all is
Pymunk's own: restitution, Coulomb friction, the pin's penetration, and the sweeps over contacts and joints.

The other native ways are worse. A slide joint as long as the clearance has neither restitution nor friction.
A ring of segments is a polygon with corners: with 16 to 64 of them impulses are off by tens of per cent
however short the step, with 256 a step takes 0.7 ms. As everywhere in Pymunk, Newton's restitution and
Coulomb's friction know nothing of energy: an impact that turns the sliding round may create some (Kane 1984).
"""

from dataclasses import dataclass, field
from typing import Any

import pymunk

from engine_models.pymunk.contact import ContactStep
from engine_models.pymunk.pin import PinInBearing, Touch


@dataclass
class Sweeps:
    """The number of sweeps of a step: ``contact`` if any pin touches, else ``flight``."""

    space: pymunk.Space
    flight: int
    contact: int
    touching: set[str] = field(default_factory=set)

    def tell(self, name: str, touches: bool) -> None:
        """Note whether a joint's pin touches, and set the sweeps of the present step by it."""
        if touches != (name in self.touching):
            (self.touching.add if touches else self.touching.discard)(name)
            self.space.iterations = self.contact if self.touching else self.flight


class RigidContact:
    """The contact of one pin between rigid walls.

    ``step`` is the number of the kick that the next call belongs to.
    ``number`` tells the joint's shapes from those of others.
    """

    clips = False

    def __init__(self, pin: PinInBearing, number: int, sweeps: Sweeps, first_step: int) -> None:
        self.pin, self.step = pin, first_step
        self._steps: list[ContactStep] = []
        room = pin.room
        self._sweeps, self._closing_speed = sweeps, room.minimum_impact_speed_m_s or 0.0
        self._R, self._R_pin = room.bearing_radius_m, room.bearing_radius_m - room.radial_clearance_m
        self._touch: Touch | None = None
        self._before = (0.0, 0.0)
        bearing = pymunk.Circle(pin.bearing, self._R, (pin.bearing_x, 0.0))
        inside = pymunk.Circle(pin.pin, self._R_pin, (pin.pin_x, 0.0))
        kinds = 2 * number + 1, 2 * number + 2
        for shape, kind in zip((bearing, inside), kinds, strict=True):
            shape.collision_type = kind  # no mass: bodies have their own, and one set here would replace it
            shape.filter = pymunk.ShapeFilter(categories=1 << number, mask=1 << number)
            shape.elasticity = shape.friction = 1.0  # a pair's are the products of both
        bearing.elasticity = room.restitution or 0.0
        bearing.friction = room.friction.coefficient if room.friction is not None else 0.0
        sweeps.space.add(bearing, inside)
        sweeps.space.on_collision(*kinds, pre_solve=self._rewrite, post_solve=self._record)

    def _rewrite(self, arbiter: Any, _space: Any, _data: Any) -> None:
        """Make of the two circles' overlap the contact of a pin in a bearing, if there is one."""
        self.step += 1
        touch = self._touch = self.pin.touch()
        arbiter.process_collision = touch is not None
        self._sweeps.tell(self.pin.name, touch is not None)
        if touch is None:
            return
        # Each wall has its own point: Pymunk takes the penetration from their distance.
        touch = self._touch = touch._replace(reach_i=self._R, reach_j=self._R_pin)
        n_x, n_y = touch.n
        contact = arbiter.contact_point_set
        contact.normal = pymunk.Vec2d(-n_x, -n_y)
        contact.points[0].point_a = pymunk.Vec2d(*self.pin.bearing_point(touch))
        contact.points[0].point_b = pymunk.Vec2d(*self.pin.pin_point(touch))
        arbiter.contact_point_set = contact
        self._before = self.pin.speeds(touch)
        if self._before[0] < self._closing_speed:
            arbiter.restitution = 0.0

    def _record(self, arbiter: Any, _space: Any, _data: Any) -> None:
        """Enter the kick's impulse, if there is one; Pymunk tells the one on the bearing."""
        touch = self._touch
        if touch is None:  # the pin is lost, which ends the run after this step
            return
        x, y = arbiter.total_impulse
        n_x, n_y = touch.n
        normal = x * n_x + y * n_y
        if normal <= 0.0:
            return
        (rate, sliding), (rate_after, sliding_after) = self._before, self.pin.speeds(touch)
        self._steps.append(
            ContactStep(
                self.step - 1,
                normal,
                x * n_y - y * n_x,
                rate,
                (rate + rate_after) / 2,
                (sliding + sliding_after) / 2,
                0.0,
                False,
            )
        )

    def taken(self) -> list[ContactStep]:
        """Return the kicks with an impulse since the last call, and forget them."""
        steps, self._steps = self._steps, []
        return steps

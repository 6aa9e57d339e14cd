"""A native contact of Pymunk between rigid walls: a circle in a circle, whose contact is set anew.

Pymunk knows no hollow circle: a pin's circle inside its bearing's overlaps it, and would be thrown out. Its
contact is there in every step, though, and may be changed before it is solved. In flight it is ignored; past
the wall it gets the normal and the points of a pin that touches its bearing from inside. From there on all is
Pymunk's own: restitution, Coulomb friction, the pin's penetration, and the sweeps over contacts and joints.

The other native ways are worse. A slide joint as long as the clearance has neither restitution nor friction.
A ring of segments is a polygon with corners: with 16 to 64 of them impulses are off by tens of per cent
however short the step, with 256 a step takes 0.7 ms. As everywhere in Pymunk, Newton's restitution and
Coulomb's friction know nothing of energy: an impact that turns the sliding round may create some (Kane 1984).
"""

from typing import Any

import pymunk

from engine_models.engine import T, UnsupportedScene
from engine_models.scene.scene import Clearance


class NativeContact:
    """The circles of a pin and its bearing in a space.

    Of the last step it tells the impulses in N s, positive where the wall pushes the pin, or where friction
    acts 90 degrees counter-clockwise of the normal on it; the speed at which the pin went into the wall,
    before; and whether it is through it.
    """

    def __init__(self, space: pymunk.Space, number: int, room: Clearance, *ends: Any) -> None:
        """Add a joint's contact by its ``number``; ``ends`` are (body, point) of bearing and pin."""
        self._room, self._ends = room, ends
        self.normal_N_s = self.friction_N_s = self.rate_m_s = 0.0
        self.through = False
        circles = []
        for end, (body, point) in enumerate(ends):
            circle = pymunk.Circle(body, room.bearing_radius_m - end * room.radial_clearance_m, point)
            circle.collision_type = 2 * number + end + 1
            circle.filter = pymunk.ShapeFilter(categories=1 << number, mask=1 << number)
            circle.elasticity = circle.friction = 1.0  # a pair's are the products of both
            circles.append(circle)
        circles[0].elasticity = room.restitution or 0.0
        circles[0].friction = room.friction.coefficient if room.friction is not None else 0.0
        space.add(*circles)
        kinds = (circle.collision_type for circle in circles)
        space.on_collision(*kinds, pre_solve=self._set_points, post_solve=self._keep_impulse)

    def _set_points(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        """Make of the circles' overlap the contact of a pin in a bearing, if there is one."""
        (bearing, at_bearing), (pin, at_pin) = self._ends
        centre, place = bearing.local_to_world(at_bearing), pin.local_to_world(at_pin)
        way, c = place - centre, self._room.radial_clearance_m
        self.normal_N_s = self.friction_N_s = 0.0
        arbiter.process_collision = way.length > c
        if not way.length > c:
            return
        self.through = self.through or not way.length <= self._room.bearing_radius_m
        n = self._n = way / way.length
        drift = pin.velocity_at_local_point(at_pin) - bearing.velocity_at_local_point(at_bearing)
        self.rate_m_s = n.dot(drift)
        contact = arbiter.contact_point_set
        contact.normal = -n
        contact.points[0].point_a = centre + self._room.bearing_radius_m * n
        contact.points[0].point_b = place + (self._room.bearing_radius_m - c) * n
        arbiter.contact_point_set = contact
        if self.rate_m_s < (self._room.minimum_impact_speed_m_s or 0.0):
            arbiter.restitution = 0.0

    def _keep_impulse(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        """Keep the impulse; Pymunk tells the one on the bearing."""
        impulse = arbiter.total_impulse
        self.normal_N_s, self.friction_N_s = impulse.dot(self._n), impulse.cross(self._n)


def rigid_twin(scene: T) -> T:
    """Return the scene with rigid contact in every joint with clearance: same restitution, same friction.

    Hertz's law and the linear one lose nothing, so theirs is 1. Pymunk's friction is Coulomb's, at any
    sliding speed: the scene's regularised one is the nearest that a scene can say, with the same coefficient.

    Raises:
        UnsupportedScene: Kelvin-Voigt's restitution depends on the masses.
    """
    return scene.with_clearances({name: _rigid(name, room) for name, room in scene.clearances.items()})


def _rigid(name: str, clearance: Clearance) -> Clearance:
    if clearance.law == "rigid":
        return clearance
    if clearance.law == "kelvin-voigt":
        raise UnsupportedScene(
            f"pymunk with contact = rigid needs a restitution, kelvin-voigt names none (joint {name})"
        )
    return Clearance(
        radial_clearance_m=clearance.radial_clearance_m,
        bearing_radius_m=clearance.bearing_radius_m,
        law="rigid",
        restitution=1.0 if clearance.restitution is None else clearance.restitution,
        friction=clearance.friction,
        bearing=clearance.bearing,
    )

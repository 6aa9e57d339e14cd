"""A native contact of Pymunk between rigid walls: a circle in a circle, whose contact is set anew.

Pymunk knows no hollow circle: a pin's circle inside its bearing's overlaps it, and would be thrown out. Its
contact is there in every step, though, and may be changed before it is solved. In flight it is ignored; past
the wall it gets the normal and the points of a pin that touches its bearing from inside. From there on all is
Pymunk's own: restitution, Coulomb friction, the pin's penetration, and the sweeps over contacts and joints.

The other native ways are worse: a slide joint has neither restitution nor friction, and with a ring of 64
segments impulses are off by tens of per cent however short the step. Newton's restitution and Coulomb's
friction know nothing of energy: an impact that turns the sliding round may create some (Kane 1984).
"""

from typing import Any

import numpy as np
import pymunk

from engine_models.engine import FloatArray, UnsupportedScene
from engine_models.pymunk.model import Model
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import Pin


class NativeContact:
    """The circles of a pin and its bearing in a space.

    It tells of the last step the impulses (2,) of the wall and of friction, which acts 90 degrees
    counter-clockwise of the bearing's normal on the pin, in N s; the speed before at which the pin went into
    the wall; and whether it has ever gone ``through`` it.
    """

    def __init__(self, model: Model, number: int, pin: Pin, room: Clearance) -> None:
        """Add the contact of a joint, by its number, to the model's space."""
        ends, self._room = [model.end(pin.body_i, pin.point_i), model.end(pin.body_j, pin.point_j)], room
        self._ends = ends[::-1] if pin.bearing_on_j else ends
        self.impulse_N_s: FloatArray = np.zeros(2)
        self.rate_m_s, self.through = 0.0, False
        circles = []
        for end, (body, point) in enumerate(self._ends):
            circle = pymunk.Circle(body, room.bearing_radius_m - end * room.radial_clearance_m, point)
            circle.collision_type = 2 * number + end + 1
            circle.filter = pymunk.ShapeFilter(categories=1 << number, mask=1 << number)
            circle.elasticity = circle.friction = 1.0  # a pair's are the products of both
            circles.append(circle)
        circles[0].elasticity = room.restitution or 0.0
        circles[0].friction = room.friction.coefficient if room.friction is not None else 0.0
        model.space.add(*circles)
        bearing, inside = (circle.collision_type for circle in circles)
        model.space.on_collision(bearing, inside, pre_solve=self._set_points, post_solve=self._keep_impulse)

    def _set_points(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        """Make of the circles' overlap the contact of a pin in a bearing, if there is one."""
        (bearing, at_bearing), (pin, at_pin) = self._ends
        centre, place = bearing.local_to_world(at_bearing), pin.local_to_world(at_pin)
        gap, radius, c = place - centre, self._room.bearing_radius_m, self._room.radial_clearance_m
        self.impulse_N_s[:] = 0.0
        arbiter.process_collision = gap.length > c
        if not arbiter.process_collision:
            return
        self.through = self.through or not gap.length <= radius
        self._n = n = gap / gap.length
        drift = pin.velocity_at_local_point(at_pin) - bearing.velocity_at_local_point(at_bearing)
        self.rate_m_s = n.dot(drift)
        contact = arbiter.contact_point_set
        # Each wall has its own point: Pymunk takes the penetration from their distance.
        contact.normal = -n
        contact.points[0].point_a, contact.points[0].point_b = centre + radius * n, place + (radius - c) * n
        arbiter.contact_point_set = contact
        if self.rate_m_s < (self._room.minimum_impact_speed_m_s or 0.0):
            arbiter.restitution = 0.0

    def _keep_impulse(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        """Keep the impulse; Pymunk tells the one on the bearing."""
        impulse = arbiter.total_impulse
        self.impulse_N_s[:] = impulse.dot(self._n), impulse.cross(self._n)


def rigid_twin(scene: Scene) -> Scene:
    """Return the scene with rigid contact in every joint with clearance: same restitution, same friction.

    Hertz's law and the linear one lose nothing, so theirs is 1. Pymunk's friction is Coulomb's, at any
    sliding speed: the scene's regularised one is the nearest that a scene can say, with the same coefficient.

    Raises:
        UnsupportedScene: Kelvin-Voigt's restitution depends on the masses.
    """
    return scene.replace({f"clearance.{name}": _rigid(name, room) for name, room in scene.clearances.items()})


def _rigid(name: str, room: Clearance) -> Clearance:
    if room.law == "rigid":
        return room
    if room.law == "kelvin-voigt":
        raise UnsupportedScene(
            f"pymunk with contact = rigid needs a restitution, kelvin-voigt names none (joint {name})"
        )
    same = room.model_dump(include={"radial_clearance_m", "bearing_radius_m", "friction", "bearing"})
    restitution = 1.0 if room.restitution is None else room.restitution
    return Clearance(law="rigid", restitution=restitution, **same)

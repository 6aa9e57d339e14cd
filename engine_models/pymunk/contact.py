"""A pin's contact in Pymunk, compliant or rigid, and the scene that the rigid one solves in a law's place.

Compliant: the scene's law as a pair of forces, set between position and velocity. A step moves the positions
first, so a force must be set after that: before ``space.step`` it would see the positions of the step before.
A constraint's ``pre_solve`` is called at the right moment. The hook's is a slide joint between the two
centres, too long ever to act.

Rigid: a circle in a circle, whose contact is rewritten in a collision handler. Pymunk knows no hollow circle:
a pin's circle inside its bearing's overlaps it, and would be thrown out. Its contact is there in every step,
though, and may be changed before it is solved. In flight it is ignored; past the wall it gets the normal and
the points of a pin that touches its bearing from inside. From there on all is Pymunk's own: restitution,
Coulomb friction, the pin's penetration, and the sweeps over contacts and joints.

The other native ways are worse. A slide joint as long as the clearance has neither restitution nor friction.
A ring of segments is a polygon with corners: with 16 to 64 of them impulses are off by tens of per cent
however short the step, with 256 a step takes 0.7 ms. As everywhere in Pymunk, Newton's restitution and
Coulomb's friction know nothing of energy: an impact that turns the sliding round may create some (Kane 1984).
"""

import math
from dataclasses import dataclass, field
from typing import Any

import pymunk

from engine_models.engine import UnsupportedScene
from engine_models.mechanics.contact_law import NormalLaw, friction_share
from engine_models.mechanics.joints import clearances
from engine_models.pymunk.contact_log import ContactStep
from engine_models.pymunk.pin import PinInBearing, Touch
from engine_models.scene.scene import Clearance, Clearances, Scene


def rigid_twin(scene: Scene) -> Scene:
    """Return the scene with rigid contact in every joint with clearance: same restitution, same friction.

    Hertz's law and the linear one lose nothing, so theirs is 1. Pymunk's friction is Coulomb's, at any
    sliding speed: the scene's regularised one is the nearest that a scene can say, with the same coefficient.

    Raises:
        UnsupportedScene: Kelvin-Voigt's restitution depends on the masses.
    """
    joints = {name: _rigid(name, clearance) for name, clearance in clearances(scene).items()}
    return scene.model_copy(update={"clearance": Clearances(**joints)}) if joints else scene


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
    )


class PinContact:
    """The contact of one pin; ``step`` is the number of the kick that the next call belongs to."""

    def __init__(self, pin: PinInBearing, first_step: int) -> None:
        self.pin, self.step = pin, first_step
        self._steps: list[ContactStep] = []
        self._touch: Touch | None = None

    def taken(self) -> list[ContactStep]:
        """Return the kicks in contact since the last call, and forget them."""
        steps, self._steps = self._steps, []
        return steps


class CompliantContact(PinContact):
    """The contact force of one pin, at x_k and, as far as it depends on speeds, at v of t_k - dt/2."""

    def __init__(self, space: pymunk.Space, pin: PinInBearing, first_step: int) -> None:
        super().__init__(pin, first_step)
        self._law, self._friction = NormalLaw(pin.clearance), pin.clearance.friction
        self._approach = 0.0  # v0 of the present contact, valid while _touch is
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
        """Return the kicks in contact since the last call, the last one among them, and forget them."""
        self._finish()
        return super().taken()


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


class RigidContact(PinContact):
    """The contact of one pin between rigid walls; ``number`` tells its shapes from those of other joints."""

    def __init__(self, pin: PinInBearing, number: int, sweeps: Sweeps, first_step: int) -> None:
        super().__init__(pin, first_step)
        clearance = pin.clearance
        self._sweeps, self._closing_speed = sweeps, clearance.minimum_impact_speed_m_s or 0.0
        self._bearing_radius = clearance.bearing_radius_m
        self._pin_radius = clearance.bearing_radius_m - clearance.radial_clearance_m
        self._before = (0.0, 0.0)
        bearing = pymunk.Circle(pin.bearing, self._bearing_radius, (pin.bearing_x, 0.0))
        inside = pymunk.Circle(pin.pin, self._pin_radius, (pin.pin_x, 0.0))
        kinds = 2 * number + 1, 2 * number + 2
        for shape, kind in zip((bearing, inside), kinds, strict=True):
            shape.collision_type = kind  # no mass: bodies have their own, and one set here would replace it
            shape.filter = pymunk.ShapeFilter(categories=1 << number, mask=1 << number)
            shape.elasticity = shape.friction = 1.0  # a pair's are the products of both
        bearing.elasticity = clearance.restitution or 0.0
        bearing.friction = clearance.friction.coefficient if clearance.friction is not None else 0.0
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
        touch = self._touch = touch._replace(bearing_lever=self._bearing_radius, pin_lever=self._pin_radius)
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
        mean_rate, mean_sliding = (rate + rate_after) / 2, (sliding + sliding_after) / 2
        friction = x * n_y - y * n_x
        self._steps.append(
            ContactStep(self.step - 1, normal, friction, rate, mean_rate, mean_sliding, 0.0, False)
        )

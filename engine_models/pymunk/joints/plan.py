"""What of a mechanism becomes bodies and joints of a space, by numbers alone: no object of Pymunk's yet.

Pymunk is given no joint that it can do without. A body that is driven and pinned to the ground is kinematic.
One that turns about an ideal pin of the ground is a ``rotor``: its origin is that pin, its mass so large that
no force moves it, and its inertia is about the pin. A body that a guide of the ground carries without
turning cannot turn: its inertia is infinite. Where no joint holds on to it either it is a ``runner``: forces
act on it along its guide alone, so that it needs no groove. All other pins are pivots, and all other guides
grooves, with a gear where one is on a body that turns.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from engine_models.engine import UnsupportedScene
from reference_solver.mechanism.data import GROUND, Guide, Line, MechanismData, Pin, Point, Spring

#: The mass of a rotor in kg: a power of two, so that its weight is taken back to the last bit.
IMMOVABLE_KG = 2.0**100
#: A line is through a place that is off it by less than this part of the distances in play.
ON_LINE = 1e-9
#: A groove is so many times as long as all bodies in a row.
GROOVE = 1e3


@dataclass(frozen=True)
class Seat:
    """How a space has a body: with its ``origin``, from the centre of mass in the body's axes.

    The inertia is about the origin, which a ``pivot`` of the ground keeps where it is. A body of infinite
    mass is kinematic; one that runs ``along`` a unit vector is moved by forces along it alone. What weighs is
    ``weight_kg`` at a ``centre``, from the origin.
    """

    mass_kg: float
    inertia_kg_m2: float
    weight_kg: float
    centre: Point = (0.0, 0.0)
    origin: Point = (0.0, 0.0)
    pivot: Point | None = None
    along: Point | None = None

    @property
    def is_kinematic(self) -> bool:
        """Whether its motion is given."""
        return math.isinf(self.mass_kg)

    @property
    def is_lifted(self) -> bool:
        """Whether the space's gravity is taken back, and what the weight does is a load."""
        return not self.is_kinematic and (self.along is not None or self.mass_kg != self.weight_kg)

    def place(self, point: Point) -> Point:
        """Return a point that is given from the centre of mass from the origin."""
        return point[0] - self.origin[0], point[1] - self.origin[1]


#: A body, or the ground, and a place on it.
End = tuple[int, Point]
#: The ground's.
FRAME = Seat(math.inf, math.inf, 0.0)


@dataclass(frozen=True)
class Joint(Line):
    """A pivot, a groove or a gear between bodies i and j, with points from their origins, in m."""

    kind: Literal["pivot", "groove", "gear"]

    @property
    def rows(self) -> int:
        """How many equations it makes."""
        return 2 if self.kind == "pivot" else 1


@dataclass(frozen=True)
class Plan:
    """The seats of the bodies, in their order, and the joints; ``groove_m`` is half of a groove's length."""

    seats: tuple[Seat, ...]
    joints: tuple[Joint, ...]
    groove_m: float

    def seat(self, body: int) -> Seat:
        """Return a body's seat, or the ground's."""
        return FRAME if body == GROUND else self.seats[body]

    def ends(self, of: Pin | Line | Spring) -> tuple[End, End]:
        """Return the bodies that a part is between, each with the part's place from its origin."""
        return (
            (of.body_i, self.seat(of.body_i).place(of.point_i)),
            (of.body_j, self.seat(of.body_j).place(of.point_j)),
        )


def plan_of(of: MechanismData, fewest: bool) -> Plan:
    """Return the plan, with the ``fewest`` joints, or with one for every pin and guide that is not driven.

    Raises:
        UnsupportedScene: a guide is none that Pymunk's groove is right for.
    """
    for guide in of.guides:
        _require_no_slot(of, guide)
    kept = _not_turning(of)
    seats, dropped = list[Seat](), list[Pin | Guide]()
    for body in range(len(of.bodies)):
        seat, joint = _seat(of, body, kept, fewest)
        seats.append(seat)
        dropped += [joint] if joint is not None else []
    bare, joints = Plan((*seats,), (), GROOVE * _reach_m(of)), list[Joint]()
    for pin in of.ideal:
        if pin not in dropped:
            joints.append(_joint("pivot", *bare.ends(pin)))
    for guide in of.guides:
        if guide in dropped:
            continue
        joints.append(_joint("groove", *bare.ends(guide), guide.angle_rad))
        if not is_exact(bare, joints[-1]):
            raise UnsupportedScene(
                f"pymunk: expected guide {guide.name} to lead through the point about which "
                f"{_name(of, guide.body_i)} turns, its pin with the ground or its centre of mass, got a line "
                "beside it: Chipmunk's groove solves the pin's full 2x2 impulse and projects it, which is of "
                "order 1 in the step there (measured on a quick return)"
            )
        if not {guide.body_i, guide.body_j} <= {GROUND, *kept}:
            joints.append(_joint("gear", (guide.body_i, (0.0, 0.0)), (guide.body_j, (0.0, 0.0))))
    return replace(bare, joints=(*joints,))


def _joint(kind: Literal["pivot", "groove", "gear"], i: End, j: End, angle_rad: float = 0.0) -> Joint:
    return Joint(*i, angle_rad, *j, kind)


def _not_turning(of: MechanismData) -> set[int]:
    """Return the bodies that guides, or a row of them, or a drive keep from being turned by forces."""
    still, pairs = {GROUND}, [{guide.body_i, guide.body_j} for guide in of.guides]
    for _ in pairs:
        still = still.union(*(both for both in pairs if both & still))
    if of.drive.prescribes and of.drive.guide is None:
        still.add(of.drive.body)
    return still - {GROUND}


def _seat(of: MechanismData, body: int, kept: set[int], fewest: bool) -> tuple[Seat, Pin | Guide | None]:
    """Return a body's seat, and the joint with the ground that it needs none of Pymunk's for."""
    own = of.bodies[body]
    inertia = math.inf if body in kept else own.inertia_kg_m2
    pivots = [pin for pin in of.ideal if (pin.body_i, pin.body_j) == (GROUND, body)]
    driven = of.drive.prescribes and of.drive.body == body
    if driven and of.drive.guide is not None:
        return Seat(math.inf, math.inf, own.mass_kg), of.guides[of.drive.guide]
    if pivots and (driven or (fewest and body not in kept)):
        pin = pivots[0]
        moment = own.inertia_kg_m2 + own.mass_kg * (pin.point_j[0] ** 2 + pin.point_j[1] ** 2)
        mass, moment = (math.inf, math.inf) if driven else (IMMOVABLE_KG, moment)
        x, y = pin.point_j
        return Seat(mass, moment, own.mass_kg, (-x, -y), pin.point_j, pin.point_i), pin
    guide = _run_on(of, body)
    if guide is not None and fewest:
        along = math.cos(guide.angle_rad), math.sin(guide.angle_rad)
        return Seat(own.mass_kg, inertia, own.mass_kg, along=along), guide
    return Seat(own.mass_kg, inertia, own.mass_kg), None


def _run_on(of: MechanismData, body: int) -> Guide | None:
    """Return the ground's guide that all of a body's joints leave to it, or none.

    Walls that Pymunk solves itself are joints in this.
    """
    held: Iterable[Pin | Guide] = [
        *(pin for pin in of.pins if pin.clearance is None or pin.clearance.law == "rigid"),
        *of.guides,
    ]
    own = [joint for joint in held if body in (joint.body_i, joint.body_j)]
    if len(own) == 1 and isinstance(own[0], Guide) and own[0].body_i == GROUND:
        return own[0]
    return None


def _require_no_slot(of: MechanismData, guide: Guide) -> None:
    """Refuse a pin in a slot, and a motion along a guide that moves.

    Raises:
        UnsupportedScene: the guide is one.
    """
    body, on = of.bodies[guide.body_j].name, _name(of, guide.body_i)
    if guide.turns:
        raise UnsupportedScene(
            f"pymunk: expected guide {guide.name} to keep {body} from turning on {on}, got turns = true: "
            "Chipmunk's groove solves the pin's full 2x2 impulse and projects it, which is of order 1 in the "
            "step between bodies that turn (measured on a Scotch yoke)"
        )
    driven = of.drive.prescribes and of.drive.guide is not None and of.guides[of.drive.guide] == guide
    if driven and guide.body_i != GROUND:
        raise UnsupportedScene(
            f"pymunk: expected drive.guide to be one on the ground, got {guide.name} on {on}: no joint of "
            "Chipmunk's moves a body along a line of another one"
        )


def is_exact(plan: Plan, groove: Joint) -> bool:
    """Return whether Pymunk's groove is right for a guide.

    A groove's impulse is the normal part of K^-1 v, with K the mobility of both bodies at the pin. So it
    closes n.K^-1.v, which is as good as n.v where the normal n is an axis of K: where a push along the line
    turns neither body. Body j may be turned by it, if one across does not turn that.
    """
    (x_i, y_i), (x_j, y_j), near = groove.point_i, groove.point_j, ON_LINE * plan.groove_m / GROOVE
    u_x, u_y = math.cos(groove.angle_rad), math.sin(groove.angle_rad)
    off_i, off_j, along_j = u_x * y_i - u_y * x_i, u_x * y_j - u_y * x_j, u_x * x_j + u_y * y_j
    i, j = plan.seat(groove.body_i).inertia_kg_m2, plan.seat(groove.body_j).inertia_kg_m2
    return (math.isinf(i) or abs(off_i) <= near) and (math.isinf(j) or min(abs(off_j), abs(along_j)) <= near)


def _name(of: MechanismData, body: int) -> str:
    return "the ground" if body == GROUND else of.bodies[body].name


def _reach_m(of: MechanismData) -> float:
    """Return the length of all bodies in a row, and of the ground, in m."""
    points: dict[int, list[Point]] = {body: [(0.0, 0.0)] for body in range(GROUND, len(of.bodies))}
    parts: list[Pin | Guide | Spring] = [*of.pins, *of.guides, *of.springs]
    for part in parts:
        points[part.body_i].append(part.point_i)
        points[part.body_j].append(part.point_j)
    spans = (np.ptp(np.array(own), axis=0) for own in points.values())
    return float(sum(np.hypot(*span) for span in spans)) or 1.0

"""A mechanism as bodies and joints of a Pymunk space."""

import math
from dataclasses import dataclass

import numpy as np
import pymunk

from engine_models.engine import FloatArray, UnsupportedScene
from engine_models.mechanics.states import levers_m
from engine_models.minimal.model import Numbers
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import DAMPING_FACTORS
from reference_solver.mechanism.data import GROUND, ConstantSpeed, Guide, MechanismData, Pin, Point

#: The mass of a body that turns about a pin of the ground without a joint: a power of two loses no digit.
IMMOVABLE_KG = 2.0**100
#: A point is on a line that it is beside by less than this part of the longest lever; half a groove's length
#: in levers.
ON_LINE, GROOVE = 1e-9, 1e3
PROJECTED = "Chipmunk's groove solves the pin's full 2x2 impulse and projects it, of order 1 in the step"
#: What sweeps may leave of an open joint at the start, how many times as many there are on the way, and at
#: least and at most.
LEFT_OVER, ON_THE_WAY, LEAST_SWEEPS, MOST_SWEEPS = 0.2, 4.0, 100, 2000


@dataclass(frozen=True)
class Model:
    """A space with the bodies of a mechanism in its start, their joints, and the mechanism's numbers.

    ``origin`` (bodies, 2) is the way from each body's centre of mass to its origin in the space, in the
    body's axes: a body that is moved about a pin of the ground, or turns about it as one with it, has it
    there. ``lift_N`` (bodies, 2) is what takes the space's gravity back where a weight is given as a load,
    and ``loaded`` whether loads are to be set in every step.
    """

    forces: Numbers
    space: pymunk.Space
    bodies: tuple[pymunk.Body, ...]
    origin: FloatArray
    lift_N: FloatArray
    loaded: bool

    def end(self, body: int, point: Point) -> tuple[pymunk.Body, pymunk.Vec2d]:
        """Return a body of the space, or its static one for the ground, and a point from its origin."""
        if body == GROUND:
            return self.space.static_body, pymunk.Vec2d(*point)
        return self.bodies[body], pymunk.Vec2d(*point) - tuple(self.origin[body])

    def set_velocities(self, velocity: FloatArray) -> None:
        """Set the velocities (bodies, 3) of the centres of mass; origins in pins of the ground stay there."""
        for body, origin, (x, y, spin) in zip(self.bodies, self.origin, velocity.tolist(), strict=True):
            body.velocity, body.angular_velocity = (0.0, 0.0) if origin.any() else (x, y), spin


def build(scene: Scene, position: FloatArray, all_joints: bool) -> Model:
    """Return the space of a scene's mechanism at positions (bodies, 3) of its centres of mass.

    Ideal pins are pivots and guides grooves, with a gear where one of their bodies turns, but for those of
    what a drive moves, which is kinematic. Where loads or contacts are set in every step, what turns about a
    pin of the ground does so without a joint, which errs less, unless ``all_joints`` are wanted.

    Raises:
        UnsupportedScene: a guide is none that Pymunk's groove is right for.
    """
    of, space = scene.mechanism, pymunk.Space()
    # A law that somebody adds has no factor: it is known to the reference alone.
    q, factors = np.zeros(3 * len(of.bodies)), DAMPING_FACTORS
    forces = Numbers(of, q, lambda law, e: factors[law](e) if law in factors else 0.0)
    pushed = bool(forces.parts) or any(room.law != "rigid" for room in scene.clearances.values())
    still, rotors = _not_turning(of), pushed and not all_joints
    pivots = {body: _pivot(of, body, still, rotors) for body in range(len(of.bodies))}
    about = {body: pin for body, pin in pivots.items() if pin is not None}
    bodies, origin, lift = list[pymunk.Body](), np.zeros((len(of.bodies), 2)), np.zeros((len(of.bodies), 2))
    for number, part in enumerate(of.bodies):
        if number in about:
            origin[number] = about[number].point_j
        if is_kinematic(of, number):
            body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        elif number in about:
            inertia = part.inertia_kg_m2 + part.mass_kg * float(origin[number] @ origin[number])
            body = pymunk.Body(IMMOVABLE_KG, inertia)
            lift[number] = IMMOVABLE_KG * np.array(of.gravity_m_s2)
        else:
            body = pymunk.Body(part.mass_kg, math.inf if number in still else part.inertia_kg_m2)
            lift[number] = part.mass_kg * np.array(of.gravity_m_s2)
        x, y, phi = position[number].tolist()
        body.position = pymunk.Vec2d(x, y) + pymunk.Vec2d(*origin[number]).rotated(phi)
        body.angle = phi
        bodies.append(body)
    loaded = bool(forces.parts) or any(body.mass == IMMOVABLE_KG for body in bodies)
    model = Model(forces, space, tuple(bodies), origin, lift, loaded)
    joints = list[pymunk.Constraint]()
    for pin in of.ideal:
        if pin not in about.values():
            (i, at_i), (j, at_j) = model.end(pin.body_i, pin.point_i), model.end(pin.body_j, pin.point_j)
            joints.append(pymunk.PivotJoint(i, j, at_i, at_j))
    for guide in of.guides:
        if not _drives(of, guide):
            joints += _guide_joints(model, guide, still)
    for joint in joints:
        joint.collide_bodies = False
    space.add(*bodies, *joints)
    return model


def sweeps_of(forces: Numbers, position: FloatArray) -> int:
    """Return how many Gauss-Seidel sweeps over its joints a mechanism is given in a step.

    A sweep gives each joint in turn the impulse that closes it. What it leaves open of all joints is G times
    what was open before, with G = -(D + L)^-1 U of the joints' matrix J M^-1 J^T = L + D + U, and n sweeps
    leave rho^n, rho the largest eigenvalue of G. Half is too much (see ``PymunkEngine``).
    """
    of, still = forces.of, _not_turning(forces.of)
    mobility = 1.0 / forces.masses
    for body in range(len(of.bodies)):
        mobility[body] *= [not is_kinematic(of, body)] * 2 + [body not in still]
    sizes = [2] * len(of.ideal) + [1] * sum(1 if guide.turns else 2 for guide in of.guides)
    rows = forces.look(0.0, position.ravel())[0][: sum(sizes)]
    matrix, joint = rows * mobility.ravel() @ rows.T, np.repeat(np.arange(len(sizes)), sizes)
    moves = np.flatnonzero(np.diag(matrix) > 0.0)
    matrix, done = matrix[np.ix_(moves, moves)], joint[moves, None] >= joint[moves]
    try:
        sweep = np.linalg.pinv(np.where(done, matrix, 0.0)) @ np.where(done, 0.0, matrix)
        rate = float(np.abs(np.linalg.eigvals(sweep)).max(initial=0.0))
    except np.linalg.LinAlgError:  # no number, or one too large
        rate = 1.0
    needed = ON_THE_WAY * math.log(LEFT_OVER) / math.log(rate) if 0.0 < rate < 1.0 else MOST_SWEEPS * rate
    return int(min(max(needed, LEAST_SWEEPS), MOST_SWEEPS))


def is_kinematic(of: MechanismData, body: int) -> bool:
    """Return whether a drive moves a body along its guide, or about an ideal pin of the ground."""
    drive = of.drive
    return drive.prescribes and drive.body == body and (drive.guide is not None or bool(_pins(of, body)))


def changes_speed(of: MechanismData) -> bool:
    """Return whether a drive prescribes another speed in every step."""
    return of.drive.prescribes and not isinstance(of.drive.law, ConstantSpeed)


def _drives(of: MechanismData, guide: Guide) -> bool:
    return of.drive.prescribes and of.drive.guide is not None and of.guides[of.drive.guide] == guide


def _pins(of: MechanismData, body: int) -> list[Pin]:
    """Return the ideal pins of a body with the ground."""
    return [pin for pin in of.ideal if (pin.body_i, pin.body_j) == (GROUND, body)]


def _not_turning(of: MechanismData) -> set[int]:
    """Return the bodies that guides, or a row of them, or a drive keep from being turned by forces."""
    still, pairs = {GROUND}, [{guide.body_i, guide.body_j} for guide in of.guides if not guide.turns]
    for _ in pairs:
        still = still.union(*(both for both in pairs if both & still))
    if of.drive.prescribes and of.drive.guide is None:
        still.add(of.drive.body)
    return still


def _pivot(of: MechanismData, body: int, still: set[int], rotors: bool) -> Pin | None:
    """Return the pin of the ground that is a body's origin, None where that is its centre of mass.

    A groove's impulse is the normal part of K^-1 v, with K the mobility of both bodies at the pin. So it
    closes n.K^-1.v, which is as good as n.v where the normal n is an axis of K: where a push along the line
    turns neither body. So the line has to lead through a body's origin; on body j it may also be across it.

    Raises:
        UnsupportedScene: a guide leads through neither, or lets a pin turn in a slot, or is driven and moves.
    """
    pins, near = _pins(of, body), ON_LINE * (max(levers_m(of), default=0.0) or 1.0)
    if is_kinematic(of, body):
        return pins[0] if of.drive.guide is None else None
    lines = [guide for guide in of.guides if body in (guide.body_i, guide.body_j)]
    for guide in lines:
        name = of.bodies[guide.body_j].name
        on = "the ground" if guide.body_i == GROUND else of.bodies[guide.body_i].name
        if guide.turns:
            raise UnsupportedScene(
                f"pymunk: expected guide {guide.name} to keep {name} from turning on {on}, got turns = true: "
                f"{PROJECTED} between bodies that turn (measured on a Scotch yoke)"
            )
        if _drives(of, guide) and guide.body_i != GROUND:
            raise UnsupportedScene(
                f"pymunk: expected drive.guide to be one on the ground, got {guide.name} on {on}: no joint "
                "of Chipmunk's moves a body along a line of another one"
            )
    if body in still:
        return None
    for pin in (*pins, None) if rotors else (None, *pins):
        place = (0.0, 0.0) if pin is None else pin.point_j
        if all(_leads_through(guide, body, place, near) for guide in lines):
            return pin
    raise UnsupportedScene(
        f"pymunk: expected guide {lines[0].name} to lead through the point about which "
        f"{of.bodies[body].name} turns, its pin with the ground or its centre of mass, got a line "
        f"beside it: {PROJECTED} there (measured on a quick return)"
    )


def _leads_through(guide: Guide, body: int, place: Point, near: float) -> bool:
    x, y = guide.point_i if body == guide.body_i else guide.point_j
    x, y, c, s = x - place[0], y - place[1], math.cos(guide.angle_rad), math.sin(guide.angle_rad)
    beside, along = abs(c * y - s * x), abs(c * x + s * y)
    return beside <= near or (body == guide.body_j and along <= near)


def _guide_joints(model: Model, guide: Guide, still: set[int]) -> list[pymunk.Constraint]:
    (i, at_i), (j, at_j) = model.end(guide.body_i, guide.point_i), model.end(guide.body_j, guide.point_j)
    longest = max(levers_m(model.forces.of), default=0.0) or 1.0
    reach = pymunk.Vec2d(GROOVE * longest, 0.0).rotated(guide.angle_rad)
    joints: list[pymunk.Constraint] = [pymunk.GrooveJoint(i, j, at_i - reach, at_i + reach, at_j)]
    if not {guide.body_i, guide.body_j} <= still:
        joints.append(pymunk.GearJoint(i, j, j.angle - i.angle, 1.0))
    return joints

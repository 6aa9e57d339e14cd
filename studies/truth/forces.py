"""Forces of ideal joints and guides from what else acts and from accelerations, body by body.

Newton and Euler have three equations a body, M (a - g) = known forces + B lambda, which fit each other. The
columns of B are unit forces of joints; lambda is the solution by least squares in the norm of 1/M.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact
from reference_solver.mechanism.data import GROUND, Line, MechanismData, Pin, Point

FloatArray = NDArray[np.float64]
#: Parts of a load that act along its line, and those that turn its body.
ALONG = ("force", "viscous", "spring", "gas", "by_time")
TURNING = ("torque", "turning_viscous", "torque_by_time")


class Acting:
    """Forces and torques on the bodies in positions (n, bodies, 3): ``total`` has the same shape."""

    def __init__(self, position: FloatArray) -> None:
        self.position, self.total = position, np.zeros_like(position)

    def arm(self, body: int, point: Point) -> FloatArray:
        """Return a point of a body from its centre of mass, or one of the ground, in the frame, (n, 2)."""
        if body == GROUND:
            return np.zeros((len(self.position), 2)) + point
        cos, sin = np.cos(self.position[:, body, 2]), np.sin(self.position[:, body, 2])
        return np.stack([cos * point[0] - sin * point[1], sin * point[0] + cos * point[1]], axis=-1)

    def place(self, body: int, point: Point) -> FloatArray:
        """Return where a point of a body is, (n, 2)."""
        arm = self.arm(body, point)
        return arm if body == GROUND else arm + self.position[:, body, :2]

    def push(self, body: int, arm: FloatArray, force: FloatArray) -> None:
        """Add a force (n, 2) on a body at a point (n, 2) from its centre of mass."""
        if body != GROUND:
            self.total[:, body, :2] += force
            self.total[:, body, 2] += arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]

    def turn(self, body: int, torque: FloatArray | float) -> None:
        """Add a torque (n,) on a body."""
        if body != GROUND:
            self.total[:, body, 2] += torque

    def join(self, pin: Pin, force: FloatArray) -> None:
        """Add a joint's force (n, 2) on body j, and the opposite one on body i."""
        self.push(pin.body_j, self.arm(pin.body_j, pin.point_j), force)
        self.push(pin.body_i, self.arm(pin.body_i, pin.point_i), -force)

    def direction(self, line: Line) -> FloatArray:
        """Return the direction of a line, (n, 2)."""
        return self.arm(line.body_i, (np.cos(line.angle_rad), np.sin(line.angle_rad)))

    def guide(self, line: Line, direction: FloatArray, force: FloatArray | float) -> None:
        """Add a force (n,) in a direction (n, 2) on a line's point, the opposite one on its body there."""
        pushed = np.reshape(force, (-1, 1)) * direction
        self.push(line.body_j, self.arm(line.body_j, line.point_j), pushed)
        if line.body_i != GROUND:
            arm = self.place(line.body_j, line.point_j) - self.position[:, line.body_i, :2]
            self.push(line.body_i, arm, -pushed)

    def touch(self, pin: Pin, contact: Contact) -> FloatArray:
        """Add what a joint with clearance does, and return the force (n, 2) on body j.

        Its surfaces meet in the middle of the penetration.
        """
        room = pin.clearance
        assert room is not None
        distance = np.hypot(*contact.gap_m.T)
        normal = contact.gap_m / np.where(distance > 0, distance, 1.0)[:, None]
        force, rub = -contact.normal_force_N[:, None] * normal, contact.friction_force_N
        if rub is not None:
            force = force + rub[:, None] * np.stack([-normal[:, 1], normal[:, 0]], axis=-1)
            own, bearing = (pin.body_i, pin.body_j) if pin.bearing_on_j else (pin.body_j, pin.body_i)
            half, radius = np.maximum(contact.penetration_m, 0.0) / 2, room.bearing_radius_m
            self.turn(own, (radius - room.radial_clearance_m - half) * rub)
            self.turn(bearing, -(radius + half) * rub)
        on_j = -force if pin.bearing_on_j else force
        self.join(pin, on_j)
        return np.asarray(on_j)


def reactions(
    of: MechanismData,
    position: FloatArray,
    acceleration: FloatArray,
    contacts: Mapping[str, Contact],
    parts: Mapping[str, FloatArray],
    effort: FloatArray | None,
) -> tuple[dict[str, FloatArray], dict[str, FloatArray], dict[str, FloatArray]]:
    """Return forces of joints (n, 2) and of guides (n,), and moments of guides (n,), by name.

    ``parts`` has what the loads' parts and springs do, (n,), a spring's positive where it pushes, ``effort``
    (n,) the drive's torque or force. Signs are those of ``engine.Trajectory``.
    """
    acting = Acting(position)
    forces = {pin.name: acting.touch(pin, contacts[pin.name]) for pin in of.loose}
    _add_loads(acting, of, parts)
    if effort is not None and of.drive.guide is not None:
        guide = of.guides[of.drive.guide]
        acting.guide(guide, acting.direction(guide), effort)
    elif effort is not None:
        acting.turn(of.drive.body, effort)
    inertia = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in of.bodies])
    missing = inertia * (acceleration - np.array([*of.gravity_m_s2, 0.0])) - acting.total
    found = iter(_least_squares(_units(of, position), missing, np.sqrt(inertia)).T)
    forces |= {pin.name: np.stack([next(found), next(found)], axis=-1) for pin in of.ideal}
    across = {guide.name: next(found) for guide in of.guides}
    moments = {guide.name: next(found) for guide in of.guides if not guide.turns}
    return {pin.name: forces[pin.name] for pin in of.pins}, across, moments


def _add_loads(acting: Acting, of: MechanismData, parts: Mapping[str, FloatArray]) -> None:
    for load in of.loads:
        name = of.bodies[load.body].name
        along, turning = (
            [parts[f"{name}.{part}"] for part in own if f"{name}.{part}" in parts] for own in (ALONG, TURNING)
        )
        if load.line is not None and along:
            acting.guide(load.line, acting.direction(load.line), np.sum(along, axis=0))
        acting.turn(load.body, np.sum(turning, axis=0) if turning else 0.0)
    for spring in of.springs:
        i, j = (spring.body_i, spring.point_i), (spring.body_j, spring.point_j)
        d = acting.place(*j) - acting.place(*i)
        length = np.hypot(*d.T)
        push = (parts[f"spring:{spring.name}"] / np.where(length > 0, length, 1.0))[:, None] * d
        acting.push(j[0], acting.arm(*j), push)
        acting.push(i[0], acting.arm(*i), -push)


def _units(of: MechanismData, position: FloatArray) -> list[FloatArray]:
    """Return what the unit of each unknown puts on the bodies, (n, bodies, 3) each."""
    one, found = np.ones((len(position), 1)), list[Acting]()

    def new() -> Acting:
        found.append(Acting(position))
        return found[-1]

    for pin in of.ideal:
        for axis in ((1.0, 0.0), (0.0, 1.0)):
            new().join(pin, one * axis)
    for guide in of.guides:
        along = Acting(position).direction(guide)
        new().guide(guide, np.stack([-along[:, 1], along[:, 0]], axis=-1), 1.0)
    for guide in of.guides:
        if not guide.turns:
            moment = new()
            moment.turn(guide.body_j, 1.0)
            moment.turn(guide.body_i, -1.0)
    return [acting.total for acting in found]


def _least_squares(units: Sequence[FloatArray], missing: FloatArray, root: FloatArray) -> FloatArray:
    """Return the coefficients (n, k) of units whose sum is what is missing (n, bodies, 3)."""
    n = len(missing)
    if not units:
        return np.zeros((n, 0))
    B = np.stack([(unit / root).reshape(n, -1) for unit in units], axis=-1)
    Q, R = np.linalg.qr(B)
    right = np.einsum("nij,ni->nj", Q, (missing / root).reshape(n, -1))
    return np.asarray(np.linalg.solve(R, right[..., None])[..., 0])

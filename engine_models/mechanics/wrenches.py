"""Forces and torques on every body and on the ground: what acts beside gravity, and accelerations from it.

A wrench is (force x, force y, torque), in the global frame and about the centre of mass; the ground's is
about the origin. Whatever acts on a body acts the other way round on another one or on the ground: drives,
torques of loads, and loads along a line that is not on another body act from the ground.
"""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import Contact, FloatArray, Trajectory
from engine_models.mechanics.joints import ContactForces, contact_force, directions, levers
from engine_models.mechanics.loads import load_forces, load_torques, spring_forces
from engine_models.mechanics.states import direction, point_motion
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND, Line, MechanismData, Pin, Point


class Wrenches:
    """Sums of wrenches in positions (n, bodies, 3): ``total`` (n, bodies + 1, 3) has the ground's last."""

    def __init__(self, position: FloatArray) -> None:
        n, bodies, _ = position.shape
        self.position, self._still = position, np.zeros_like(position)
        self.total = np.zeros((n, bodies + 1, 3))

    def place(self, body: int, point: Point) -> FloatArray:
        """Return where a point of a body is, (n, 2)."""
        return point_motion(body, point, self.position, self._still).place_m

    def push(self, body: int, place_m: FloatArray, force_N: FloatArray) -> None:
        """Add a force (n, 2) on a body at a place (n, 2)."""
        arm = place_m if body == GROUND else place_m - self.position[:, body, :2]
        self.total[:, body, :2] += force_N
        self.total[:, body, 2] += arm[:, 0] * force_N[:, 1] - arm[:, 1] * force_N[:, 0]

    def turn(self, body: int, other: int, torque_N_m: FloatArray | float) -> None:
        """Add a torque (n,) on a body, and the opposite one on another."""
        self.total[:, body, 2] += torque_N_m
        self.total[:, other, 2] -= torque_N_m

    def pin(self, pin: Pin, force_N: FloatArray) -> None:
        """Add a force (n, 2) on the body named later at its point, the opposite one at that of the other."""
        self.push(pin.body_j, self.place(pin.body_j, pin.point_j), force_N)
        self.push(pin.body_i, self.place(pin.body_i, pin.point_i), -force_N)

    def line(self, line: Line, force_N: FloatArray, across: bool = False) -> None:
        """Add a force (n,) along a line, or to its left, on its point, the opposite one on its body there."""
        place = self.place(line.body_j, line.point_j)
        force = force_N[:, None] * direction(line, self.position)[int(across)]
        self.push(line.body_j, place, force)
        self.push(line.body_i, place, -force)

    def contact(self, pin: Pin, contact: Contact | ContactForces) -> None:
        """Add the forces of a joint with clearance, which act where pin and bearing touch."""
        force = contact_force(contact)
        self.pin(pin, -force if pin.bearing_on_j else force)
        if contact.friction_force_N is not None and pin.clearance is not None:
            body, bearing = (pin.body_i, pin.body_j) if pin.bearing_on_j else (pin.body_j, pin.body_i)
            of_bearing, of_pin = levers(pin.clearance, contact.penetration_m)
            self.total[:, body, 2] += of_pin * contact.friction_force_N
            self.total[:, bearing, 2] -= of_bearing * contact.friction_force_N

    def loads(self, of: MechanismData, time_s: FloatArray, velocity: FloatArray) -> None:
        """Add loads and springs at times (n,) and velocities (n, bodies, 3)."""
        forces = load_forces(of, time_s, self.position, velocity)
        torques = load_torques(of, time_s, velocity)
        for load in of.loads:
            body = f"{of.bodies[load.body].name}."
            if load.line is not None:
                self.line(load.line, sum_of(forces, body, len(time_s)))
            self.turn(load.body, GROUND, sum_of(torques, body, len(time_s)))
        pulls = spring_forces(of, self.position, velocity)
        for spring in of.springs:
            i, j = self.place(spring.body_i, spring.point_i), self.place(spring.body_j, spring.point_j)
            pull = pulls[spring.name][:, None] * directions(i - j)[0]
            self.push(spring.body_j, j, pull)
            self.push(spring.body_i, i, -pull)

    def drive(self, of: MechanismData, effort: FloatArray) -> None:
        """Add the torque in N m, or the force in N along a guide, of the drive, (n,)."""
        if of.drive.guide is None:
            self.turn(of.drive.body, GROUND, effort)
        else:
            self.line(of.guides[of.drive.guide], effort)


def sum_of(parts: Mapping[str, FloatArray], begin: str, n: int) -> FloatArray:
    """Return the sum of parts (n,) whose names begin so."""
    return np.asarray(sum((part for name, part in parts.items() if name.startswith(begin)), np.zeros(n)))


def wrenches(scene: Scene, run: Trajectory) -> FloatArray:
    """Return all that acts in a run, weight left out, on the bodies and on the ground: (n, bodies + 1, 3)."""
    of, acting = scene.mechanism, Wrenches(run.position)
    acting.loads(of, run.time_s, run.velocity)
    for pin in of.pins:
        if pin.name in run.contacts:
            acting.contact(pin, run.contacts[pin.name])
        else:
            acting.pin(pin, run.joint_force_N[pin.name])
    for guide in of.guides:
        acting.line(guide, run.guide_force_N[guide.name], across=True)
        if guide.name in run.guide_moment_N_m:
            acting.turn(guide.body_j, guide.body_i, run.guide_moment_N_m[guide.name])
    if run.driver_torque_N_m is not None:
        acting.drive(of, run.driver_torque_N_m)
    return acting.total


def inertias(of: MechanismData) -> FloatArray:
    """Return mass, mass and inertia of every body, (bodies, 3)."""
    return np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in of.bodies])


def accelerations(of: MechanismData, acting: FloatArray) -> FloatArray:
    """Return the accelerations (n, bodies, 3) of bodies on which such wrenches act, and gravity."""
    return np.asarray(acting[:, :-1] / inertias(of) + np.array([*of.gravity_m_s2, 0.0]))

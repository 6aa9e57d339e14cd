"""A scene as an Exudyn model, with nothing in it that the scene does not need.

The absolute model has planar bodies and constraints for its ideal joints; implicit solvers run it. What a
guide of the ground carries at a fixed angle is a mass on that guide's coordinate, and what an ideal pin of
the ground carries a rotor of one angle: neither needs a constraint or costs a multiplier. The tree model has
no constraint at all: the ideal joints are those of kinematic trees, and a prescribed speed is kept by a
flywheel. Explicit solvers run it. A joint with clearance is a contact in both. All coordinates that Exudyn
solves for are displacements from the assembled start.

Springs, constant and viscous torques, and constant, viscous and elastic forces along a coordinate are
Exudyn's own objects. All else is a Python function that Exudyn calls: one of generalised forces for the
loads, and one of the speed or the acceleration for a drive that changes its speed.
"""

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.contact import native_law
from engine_models.exudyn.kinematics import generalised, link_rows
from engine_models.exudyn.tree import Branch, branches_of, driven_link, turned
from engine_models.mechanics.start import checked_start
from engine_models.mechanics.states import JointGap, pin_gap
from engine_models.minimal import equations as eq
from engine_models.minimal.forces import Forces
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contact_laws import exponent_of, minimum_impact_speed_of, stiffness_of
from reference_solver.mechanism.data import GROUND, ConstantSpeed, Course, Guide, Point

items: Any = itemInterface  # its constructors carry no types
#: With this inertia in kg m^2, or this mass in kg, what is driven is changed in its speed by no mechanism's
#: torque or force, not by a rounding.
HEAVY = 1e15
KINDS = {"x": exu.JointType.PrismaticX, "y": exu.JointType.PrismaticY, "turn": exu.JointType.RevoluteZ}


@dataclass(frozen=True)
class Model:
    """An assembled Exudyn model: the container that owns it, its branches, and sensors by what they measure.

    ``motion`` are those of all branches' coordinates, of their rates and of their accelerations;
    ``histories`` those of the contacts, by joint. ``start`` (links,) are the coordinates at t = 0.
    """

    container: exu.SystemContainer
    mbs: exu.MainSystem
    branches: list[Branch]
    motion: list[list[int]]
    histories: dict[str, int]
    start: FloatArray
    forces: Forces


def build_model(scene: Scene, tree: bool = False) -> Model:
    """Return the assembled absolute model, or the tree model where ideal joints close no loop."""
    container, (position, velocity), of = exu.SystemContainer(), checked_start(scene), scene.mechanism
    built = _Building(container.AddSystem(), scene, tree, position, velocity)
    histories: dict[str, int] = {}
    links = {link.name for branch in built.branches for link in branch.links}
    for pin in of.pins:
        ends = [(pin.body_j, pin.point_j), (pin.body_i, pin.point_i)]
        if pin.clearance is not None:
            gap = pin_gap(pin, position[None], velocity[None])
            pin_first = [built.marker(*end) for end in ends[:: -1 if pin.bearing_on_j else 1]]
            history = built.add_contact(pin_first, scene.clearances[pin.name], gap)
            histories[pin.name] = built.sensor(history, "Coordinates")
        elif pin.name not in links:
            markers = [built.marker(*end) for end in ends]
            built.mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))
    for guide in of.guides:
        if guide.name not in links:
            built.constrain(guide, position)
    built.add_loads(position)
    if of.drive.prescribes:
        built.add_drive()
    built.mbs.Assemble()
    start = np.concatenate([branch.start for branch in built.branches])
    return Model(container, built.mbs, built.branches, built.motion, histories, start, built.forces)


class _Building:
    """A system with the bodies of a scene at their start, (bodies, 3) each; more is added to it."""

    def __init__(
        self, mbs: exu.MainSystem, scene: Scene, tree: bool, position: FloatArray, velocity: FloatArray
    ) -> None:
        self.mbs, self.of, self.tree, self.forces = mbs, scene.mechanism, tree, Forces(scene)
        self.branches, self._places = branches_of(self.of, tree, position, velocity)
        self._driven = [driven_link(self.of, branch.links) for branch in self.branches]
        self._nodes, self._carriers = list[Any](), list[Any]()
        for branch, driven in zip(self.branches, self._driven, strict=True):
            node, carrier = (self._add_tree if branch.kind == "tree" else self._add_single)(branch, driven)
            self._nodes.append(node)
            self._carriers.append(carrier)
            if branch.kind != "tree":
                self._add_weight(branch, carrier)
        quantities = "Coordinates", "Coordinates_t", "Coordinates_tt"
        self.motion = [[self.sensor(node, quantity) for node in self._nodes] for quantity in quantities]

    def sensor(self, node: Any, quantity: str) -> int:
        """Add and return a sensor of a node's coordinates or their rates."""
        kind = getattr(exu.OutputVariableType, quantity)
        return int(
            self.mbs.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))
        )

    def _inertias(self, branch: Branch, driven: int | None) -> list[tuple[float, float]]:
        """Return mass and inertia of the links, with the flywheel's where the tree model has one."""
        bodies = [None if link.body is None else self.of.bodies[link.body] for link in branch.links]
        found = [(0.0, 0.0) if body is None else (body.mass_kg, body.inertia_kg_m2) for body in bodies]
        if self.tree and self.of.drive.prescribes and driven is not None:
            mass, inertia = found[driven]
            turns = self.of.drive.guide is None
            found[driven] = (mass, inertia + HEAVY) if turns else (HEAVY, inertia)
        return found

    def _add_single(self, branch: Branch, driven: int | None) -> tuple[Any, Any]:
        """Add a body with coordinates of its own; return its node and its object."""
        link, (mass, inertia) = branch.links[-1], self._inertias(branch, driven)[-1]
        state = {"referenceCoordinates": branch.start, "initialVelocities": branch.rates}
        place = [*link.offset_m, 0.0]
        if branch.kind == "free":
            node = self.mbs.AddNode(items.NodeRigidBody2D(**state))
            body = items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node)
        elif branch.kind == "mass":
            node, turn = self.mbs.AddNode(items.Node1D(**state)), _matrix(link.angle_rad)
            body = items.ObjectMass1D(
                mass=mass, nodeNumber=node, referencePosition=place, referenceRotation=turn
            )
        else:
            node = self.mbs.AddNode(items.Node1D(**state))
            inertia += mass * (link.centre_m[0] ** 2 + link.centre_m[1] ** 2)
            body = items.ObjectRotationalMass1D(inertia=inertia, nodeNumber=node, referencePosition=place)
        return node, self.mbs.AddObject(body)

    def _add_weight(self, branch: Branch, carrier: Any) -> None:
        """Add the weight of a body; across its guide, outside its one equation, a mass has none."""
        link, (x, y) = branch.links[-1], self.of.gravity_m_s2
        u = turned(link.angle_rad, (1.0, 0.0))
        if x * u[0] + y * u[1] if branch.kind == "mass" else x or y:
            mass = self.of.bodies[link.body or 0].mass_kg
            at = items.MarkerBodyPosition(bodyNumber=carrier, localPosition=[*link.centre_m, 0.0])
            weight = [mass * x, mass * y, 0.0]
            load = items.LoadForceVector(markerNumber=self.mbs.AddMarker(at), loadVector=weight)
            self.mbs.AddLoad(load)

    def _add_tree(self, branch: Branch, driven: int | None) -> tuple[Any, Any]:
        """Add a tree; return its node and its object."""
        links, count = branch.links, len(branch.links)
        node = self.mbs.AddNode(
            items.NodeGenericODE2(
                referenceCoordinates=branch.start,
                initialCoordinates=[0.0] * count,
                initialCoordinates_t=branch.rates,
                numberOfODE2Coordinates=count,
            )
        )
        matrices: Any = exu.Matrix3DList  # their constructors carry no arguments
        vectors: Any = exu.Vector3DList
        inertias = self._inertias(branch, driven)
        tree = items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[KINDS[link.axis] for link in links],
            linkParents=[link.parent for link in links],
            jointTransformations=matrices([_matrix(link.angle_rad) for link in links]),
            jointOffsets=vectors([[*link.offset_m, 0.0] for link in links]),
            linkMasses=[mass for mass, _ in inertias],
            linkInertiasCOM=matrices([np.diag([0.0, 0.0, inertia]) for _, inertia in inertias]),
            linkCOMs=vectors([[*link.centre_m, 0.0] for link in links]),
            gravity=[*self.of.gravity_m_s2, 0.0],
        )
        return node, self.mbs.AddObject(tree)

    def marker(self, body: int, point: Point = (0.0, 0.0)) -> Any:
        """Add a marker with position and orientation at a point of a body, or of the ground."""
        if body == GROUND:
            ground = self.mbs.AddObject(items.ObjectGround())
            place = [*point, 0.0]
            return self.mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=ground, localPosition=place))
        b, k = self._places[body]
        place = [*self.branches[b].links[k].place(point), 0.0]
        if self.branches[b].kind == "tree":
            marker = items.MarkerKinematicTreeRigid(
                objectNumber=self._carriers[b], linkNumber=k, localPosition=place
            )
        else:
            marker = items.MarkerBodyRigid(bodyNumber=self._carriers[b], localPosition=place)
        return self.mbs.AddMarker(marker)

    def coordinate(self, branch: int, link: int) -> Any:
        """Add a marker of a coordinate."""
        return self.mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=self._nodes[branch], coordinate=link))

    def _still(self) -> Any:
        """Add a marker of a coordinate of the ground."""
        node = self.mbs.AddNode(items.NodePointGround())
        return self.mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))

    def constrain(self, guide: Guide, position: FloatArray) -> None:
        """Add the constraint of a guide, which keeps its body's angle at the start, (bodies, 3)."""
        i, j = guide.body_i, guide.body_j
        line, pin = self.marker(i, guide.point_i), self.marker(j, guide.point_j)
        along = guide.angle_rad + self._turned(i)
        if guide.turns:
            # Exudyn projects on the normal of the second marker, which has to be that of the line.
            joint = items.ObjectJointPrismatic2D(
                markerNumbers=[pin, line], normalMarker1=_across(along), constrainRotation=False
            )
        else:
            angle_i = 0.0 if i == GROUND else position[i, 2]
            apart = position[j, 2] - self._turned(j) - (angle_i - self._turned(i))
            axis = [*turned(along, (1.0, 0.0)), 0.0]
            joint = items.ObjectJointPrismatic2D(
                markerNumbers=[line, pin], axisMarker0=axis, normalMarker1=_across(along - apart)
            )
        self.mbs.AddObject(joint)

    def _turned(self, body: int) -> float:
        """Return the angle of a body against its object's or link's frame."""
        if body == GROUND:
            return 0.0
        branch, k = self._places[body]
        return self.branches[branch].links[k].turned_rad

    def add_contact(self, markers: list[Any], clearance: Clearance, start: JointGap) -> Any:
        """Add the contact of pin, a sphere, and bearing, a hollow one, from one state of its gap.

        Returns:
            The node of its history: gap (negative in contact), tangential speed (of the centres, which the
            first step corrects), approach speed of the latest touch, and a plastic depth that no law here
            uses. A contact that is closed at the start touches there.
        """
        c, bearing_radius, law = (
            clearance.radial_clearance_m,
            clearance.bearing_radius_m,
            native_law(clearance),
        )
        friction = clearance.friction
        (gap,), (rate,) = start.gap_m, start.rate_m_s
        distance = float(np.hypot(*gap))
        normal = gap / distance if distance > 0 else np.zeros(2)
        approach, across = normal @ rate, normal[0] * rate[1] - normal[1] * rate[0]
        begin = [c - distance, abs(across), max(approach, 0.0) if distance > c else 0.0, 0.0]
        node = items.NodeGenericData(initialCoordinates=begin, numberOfDataCoordinates=len(begin))
        history = self.mbs.AddNode(node)
        contact = items.ObjectContactSphereSphere(
            markerNumbers=markers,
            nodeNumber=history,
            spheresRadii=[bearing_radius - c, bearing_radius],
            isHollowSphere1=True,
            contactStiffness=stiffness_of(clearance),
            contactStiffnessExponent=exponent_of(clearance),
            contactDamping=law.damping_N_s_m,
            impactModel=law.impact_model,
            restitutionCoefficient=law.restitution,
            minimumImpactVelocity=minimum_impact_speed_of(clearance),
            dynamicFriction=0.0 if friction is None else friction.coefficient,
            frictionProportionalZone=1.0 if friction is None else friction.regularisation_speed_m_s,
        )
        self.mbs.AddObject(contact)
        return history

    def add_loads(self, position: FloatArray) -> None:
        """Add all parts of loads, springs and the torque of a drive that prescribes no motion."""
        p = self.forces.p.copy()
        eq.block(p, eq.SCALARS)[0, [eq.GX, eq.GY]] = 0.0
        lines = {self.of.bodies[load.body].name: load.line for load in self.of.loads}
        left = set[int]()
        for name, row in zip(self.forces.parts, eq.block(p, eq.PARTS), strict=True):
            constant, damper, stiffness, free = row[eq.CONSTANT : eq.FREE + 1].tolist()
            i, j = int(row[1]), int(row[4])
            line = lines.get(name.partition(".")[0])
            own = self._coordinate_of(line) if row[0] == eq.LINE and isinstance(line, Guide) else None
            if max(row[eq.BY_ANGLE : eq.BY_RATE + 1]) >= 0.0 or (row[0] == eq.LINE and own is None):
                left |= {i, j, int(row[eq.OF_BODY])}
                continue
            if row[0] == eq.PULL:
                self._add_spring([(i, tuple(row[2:4])), (j, tuple(row[5:7]))], damper, stiffness, free)
            elif row[0] == eq.TURN:
                self._add_torque(j, constant, damper)
            elif own is not None:
                branch, k, sign = own
                at, offset = self.coordinate(branch, k), sign * free - self.branches[branch].start[k]
                self.mbs.AddLoad(items.LoadCoordinate(markerNumber=at, load=sign * constant))
                spring = items.ObjectConnectorCoordinateSpringDamper(
                    markerNumbers=[self._still(), at], stiffness=stiffness, damping=damper, offset=offset
                )
                self.mbs.AddObject(spring)
            row[eq.CONSTANT : eq.FREE + 1] = 0.0
        if left:
            self._add_function(p, left, position)

    def _coordinate_of(self, guide: Guide) -> tuple[int, int, float] | None:
        """Return branch, link and sign of the coordinate that is the way along a guide, if there is one."""
        for b, branch in enumerate(self.branches):
            for k, link in enumerate(branch.links):
                if (link.name, link.axis) == (guide.name, "x"):
                    return b, k, -1.0 if link.body == guide.body_i else 1.0
        return None

    def _add_spring(self, ends: list[Any], damper: float, stiffness: float, free: float) -> None:
        """Add a spring and its damper; without either length or damper it has a force at length 0 too."""
        sides = [self.marker(*end) for end in ends]
        if free or damper:
            item = items.ObjectConnectorSpringDamper(
                markerNumbers=sides, referenceLength=free, stiffness=stiffness, damping=damper
            )
        else:
            item = items.ObjectConnectorCartesianSpringDamper(
                markerNumbers=sides, stiffness=[stiffness, stiffness, 0.0]
            )
        self.mbs.AddObject(item)

    def _add_torque(self, body: int, constant: float, damper: float) -> None:
        if constant:
            torque = [0.0, 0.0, constant]
            self.mbs.AddLoad(items.LoadTorqueVector(markerNumber=self.marker(body), loadVector=torque))
        if damper:
            sides = [self.marker(GROUND), self.marker(body)]
            self.mbs.AddObject(
                items.ObjectConnectorTorsionalSpringDamper(markerNumbers=sides, damping=damper)
            )

    def _add_function(self, p: FloatArray, bodies: set[int], position: FloatArray) -> None:
        """Add the loads in p on bodies as a function of Python.

        No node that is not needed: implicit solvers difference these forces by every coordinate.
        """
        used = sorted({self._places[body][0] for body in bodies if body != GROUND})
        links = link_rows([self.branches[branch] for branch in used])
        start = np.concatenate([self.branches[branch].start for branch in used])
        at, out = np.zeros((3, position.size)), np.empty(len(start))
        at[0] = position.ravel()

        def force(_: exu.MainSystem, t: float, __: int, q: Any, rates: Any) -> FloatArray:
            generalised(p, links, t, start + q, np.asarray(rates), at, out)
            return out

        force(self.mbs, 0.0, 0, 0.0 * start, 0.0 * start)  # compiled before the run
        count = len(start), len(start)
        self.mbs.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=[self._nodes[branch] for branch in used],
                massMatrix=np.zeros(count),
                forceUserFunction=force,
            )
        )

    def add_drive(self) -> None:
        """Add what prescribes a speed: a constraint of the absolute model, in a tree a flywheel's torque.

        The trapezoidal rule integrates a heavy mass that a changing speed is held against, as
        Exudyn takes a speed that is a function of time alone for one without acceleration as it computes the
        accelerations at the start, and the rule keeps that error for ever. So the mass has the acceleration
        of the start at all times, of which no step makes an error, and the function the rest. It would keep
        an error of order one from every kink in the acceleration too, and a table has one at every entry:
        there the mass has all of the speed, by a force of time.
        """
        drive, mbs, p = self.of.drive, self.mbs, self.forces.p
        branch, link = next((b, k) for b, k in enumerate(self._driven) if k is not None)
        driven, constant = self.coordinate(branch, link), isinstance(drive.law, ConstantSpeed)
        _, speed, acceleration = eq.driven(p, 0.0)

        def push(_: exu.MainSystem, t: float, __: float) -> float:
            return HEAVY * eq.driven(p, t)[2]

        def rest(_: exu.MainSystem, t: float, *__: Any) -> float:
            return eq.driven(p, t)[1] - acceleration * t

        if self.tree:
            if drive.guide is not None:  # the flywheel's weight
                u = turned(self.of.guides[drive.guide].angle_rad, (1.0, 0.0))
                weight = HEAVY * float(np.dot(u, self.of.gravity_m_s2))
                mbs.AddLoad(items.LoadCoordinate(markerNumber=driven, load=-weight))
            if not constant:
                mbs.AddLoad(items.LoadCoordinate(markerNumber=driven, load=0.0, loadUserFunction=push))
            return
        beside: dict[str, Any] = {"offset": speed}
        other = None
        if not constant:
            by_table = isinstance(drive.law, Course)
            node = mbs.AddNode(items.Node1D(initialVelocities=[speed if by_table else 0.0]))
            mbs.AddObject(items.ObjectMass1D(mass=HEAVY, nodeNumber=node))
            other = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
            by_time = {"loadUserFunction": push} if by_table else {}
            load = 0.0 if by_table else HEAVY * acceleration
            mbs.AddLoad(items.LoadCoordinate(markerNumber=other, load=load, **by_time))
            beside = {} if by_table else {"offsetUserFunction_t": rest}
        sides = [self._still() if other is None else other, driven]
        mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=sides, velocityLevel=True, **beside))


def _matrix(angle_rad: float) -> FloatArray:
    """Return the rotation about z by an angle, (3, 3)."""
    x, y = turned(angle_rad, (1.0, 0.0)), turned(angle_rad, (0.0, 1.0))
    return np.array([[x[0], y[0], 0.0], [x[1], y[1], 0.0], [0.0, 0.0, 1.0]])


def _across(angle_rad: float) -> list[float]:
    """Return the unit vector to the left of a line at an angle."""
    return [*turned(angle_rad, (0.0, 1.0)), 0.0]

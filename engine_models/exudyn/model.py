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

from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.contact import native_law
from engine_models.exudyn.motion import link_rows
from engine_models.exudyn.tree import Branch, branches_of, turned, way_of
from engine_models.mechanics.start import checked_start
from engine_models.mechanics.states import pin_gap
from engine_models.scene.scene import Scene
from reference_solver.mechanism import data, loads
from reference_solver.mechanism.contacts import exponent_of, minimum_impact_speed_of, stiffness_of
from reference_solver.mechanism.data import GROUND, Ends, Guide, Pin, Point, Spring
from reference_solver.mechanism.mechanism import loads_of
from reference_solver.mechanism.motions import going_on, moved

items: Any = itemInterface  # its constructors carry no types
#: With this inertia in kg m^2, or this mass in kg, what is driven is changed in its speed by no mechanism's
#: torque or force, not by a rounding.
HEAVY = 1e15
TYPES = {"x": exu.JointType.PrismaticX, "y": exu.JointType.PrismaticY, "turn": exu.JointType.RevoluteZ}


class Model:
    """An assembled Exudyn system, the absolute model or the tree model where ideal joints close no loop.

    ``motion`` are the sensors of all ``branches``' coordinates, of their rates and of their accelerations;
    ``histories`` those of the contacts, by joint. ``start`` (links,) are the coordinates at t = 0.
    """

    def __init__(self, scene: Scene, tree: bool) -> None:
        self._container, (position, velocity) = exu.SystemContainer(), checked_start(scene)
        self.mbs, self.of = self._container.AddSystem(), scene.mechanism
        self.branches, self._places = branches_of(self.of, tree, np.stack([position, velocity]))
        self.start = np.concatenate([branch.start for branch in self.branches])
        self._ground = self.mbs.AddObject(items.ObjectGround())
        self._nodes, self._carriers = list[Any](), list[Any]()
        driven = self._driven() if self.of.drive.prescribes else None
        for number, branch in enumerate(self.branches):
            bodies = [None if link.body is None else self.of.bodies[link.body] for link in branch.links]
            inertias = [body.inertia_kg_m2 if body else 0.0 for body in bodies]
            if tree and self.of.drive.guide is None and driven is not None and driven[0] == number:
                inertias[driven[1]] += HEAVY
            add = self._add_tree if branch.kind == "tree" else self._add_single
            node, carrier = add(branch, inertias)
            self._nodes.append(node)
            self._carriers.append(carrier)
        quantities = "Coordinates", "Coordinates_t", "Coordinates_tt"
        self.motion = [[self._sensor(node, quantity) for node in self._nodes] for quantity in quantities]
        links = {link.name for branch in self.branches for link in branch.links}
        for pin in self.of.ideal:
            if pin.name not in links:
                self.mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=self._markers(pin)))
        histories = {pin.name: self._add_contact(scene, pin, position, velocity) for pin in self.of.loose}
        self.histories = {name: self._sensor(node, "Coordinates") for name, node in histories.items()}
        for guide in self.of.guides:
            if guide.name not in links:
                self._constrain(guide, position)
        self._add_loads(position)
        if driven is not None:
            self._add_drive(tree, *driven)
        self.mbs.Assemble()

    def _sensor(self, node: Any, quantity: str) -> int:
        kind = getattr(exu.OutputVariableType, quantity)
        sensor = items.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True)
        return int(self.mbs.AddSensor(sensor))

    def _driven(self) -> tuple[int, int]:
        """Return branch and link of the coordinate that is driven."""
        drive = self.of.drive
        if drive.guide is not None and (found := way_of(self.branches, self.of.guides[drive.guide])):
            return found
        branch, link = self._places[drive.body]
        while self.branches[branch].links[link].axis != "turn":
            link = self.branches[branch].links[link].parent
        return branch, link

    def _add_single(self, branch: Branch, inertias: list[float]) -> tuple[Any, Any]:
        """Add a body with coordinates of its own, and its weight; return its node and its object."""
        link, (x, y) = branch.links[-1], self.of.gravity_m_s2
        body, place = self.of.bodies[link.body or 0], [*link.offset_m, 0.0]
        state = {"referenceCoordinates": branch.start, "initialVelocities": branch.rates}
        if branch.kind == "free":
            node = self.mbs.AddNode(items.NodeRigidBody2D(**state))
            item = items.ObjectRigidBody2D(mass=body.mass_kg, inertia=inertias[-1], nodeNumber=node)
        elif branch.kind == "mass":
            node = self.mbs.AddNode(items.Node1D(**state))
            turn = {"referencePosition": place, "referenceRotation": _matrix(link.angle_rad)}
            item = items.ObjectMass1D(mass=body.mass_kg, nodeNumber=node, **turn)
        else:
            node = self.mbs.AddNode(items.Node1D(**state))
            inertia = inertias[-1] + body.mass_kg * (link.centre_m[0] ** 2 + link.centre_m[1] ** 2)
            item = items.ObjectRotationalMass1D(inertia=inertia, nodeNumber=node, referencePosition=place)
        carrier, u = self.mbs.AddObject(item), turned(link.angle_rad, (1.0, 0.0))
        if x * u[0] + y * u[1] if branch.kind == "mass" else x or y:  # across its guide a mass has no weight
            at = items.MarkerBodyPosition(bodyNumber=carrier, localPosition=[*link.centre_m, 0.0])
            weight = [body.mass_kg * x, body.mass_kg * y, 0.0]
            load = items.LoadForceVector(markerNumber=self.mbs.AddMarker(at), loadVector=weight)
            self.mbs.AddLoad(load)
        return node, carrier

    def _add_tree(self, branch: Branch, inertias: list[float]) -> tuple[Any, Any]:
        """Add a tree; return its node and its object."""
        links, count = branch.links, len(branch.links)
        state = {"referenceCoordinates": branch.start, "initialCoordinates_t": branch.rates}
        at_zero = {"initialCoordinates": [0.0] * count, "numberOfODE2Coordinates": count}
        node = self.mbs.AddNode(items.NodeGenericODE2(**state, **at_zero))
        matrices: Any = exu.Matrix3DList  # their constructors carry no arguments
        vectors: Any = exu.Vector3DList
        masses = [0.0 if link.body is None else self.of.bodies[link.body].mass_kg for link in links]
        tree = items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[TYPES[link.axis] for link in links],
            linkParents=[link.parent for link in links],
            jointTransformations=matrices([_matrix(link.angle_rad) for link in links]),
            jointOffsets=vectors([[*link.offset_m, 0.0] for link in links]),
            linkMasses=masses,
            linkInertiasCOM=matrices([np.diag([0.0, 0.0, inertia]) for inertia in inertias]),
            linkCOMs=vectors([[*link.centre_m, 0.0] for link in links]),
            gravity=[*self.of.gravity_m_s2, 0.0],
        )
        return node, self.mbs.AddObject(tree)

    def _marker(self, body: int, point: Point = (0.0, 0.0)) -> Any:
        """Add a marker with position and orientation at a point of a body, or of the ground."""
        branch, k = (-1, 0) if body == GROUND else self._places[body]
        place = [*(point if body == GROUND else self.branches[branch].links[k].place(point)), 0.0]
        if body != GROUND and self.branches[branch].kind == "tree":
            on = {"objectNumber": self._carriers[branch], "linkNumber": k}
            return self.mbs.AddMarker(items.MarkerKinematicTreeRigid(**on, localPosition=place))
        carrier = self._ground if body == GROUND else self._carriers[branch]
        return self.mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=carrier, localPosition=place))

    def _markers(self, between: Ends) -> list[Any]:
        """Add markers at the point of body j and at that of body i."""
        return [self._marker(between.body_j, between.point_j), self._marker(between.body_i, between.point_i)]

    def _coordinate(self, node: Any, coordinate: int = 0) -> Any:
        """Add a marker of a coordinate of a node."""
        return self.mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))

    def _still(self) -> Any:
        """Add a marker of a coordinate of the ground."""
        return self._coordinate(self.mbs.AddNode(items.NodePointGround()))

    def _constrain(self, guide: Guide, position: FloatArray) -> None:
        """Add the constraint of a guide, which keeps its body's angle at the start, (bodies, 3).

        Exudyn projects on the normal of the second marker, which has to be that of the line.
        """
        angles = {GROUND: 0.0, **dict(enumerate(position[:, 2].tolist()))}
        line = guide.angle_rad + angles[guide.body_i]
        for body, (branch, link) in self._places.items():
            angles[body] -= self.branches[branch].links[link].turned_rad  # now those of their frames
        joint = items.ObjectJointPrismatic2D(
            markerNumbers=self._markers(guide),
            axisMarker0=[*turned(line - angles[guide.body_j], (1.0, 0.0)), 0.0],
            normalMarker1=[*turned(line - angles[guide.body_i], (0.0, 1.0)), 0.0],
            constrainRotation=not guide.turns,
        )
        self.mbs.AddObject(joint)

    def _add_contact(self, scene: Scene, pin: Pin, position: FloatArray, velocity: FloatArray) -> Any:
        """Add the contact of pin, a sphere, and bearing, a hollow one.

        Returns:
            The node of its history: gap (negative in contact), tangential speed (of the centres, which the
            first step corrects), approach speed of the latest touch, and a plastic depth that no law here
            uses. A contact that is closed at the start touches there.
        """
        clearance = scene.clearances[pin.name]
        c, radius, friction = clearance.radial_clearance_m, clearance.bearing_radius_m, clearance.friction
        impact_model, restitution = native_law(clearance)
        (gap,), (rate,) = pin_gap(pin, position[None], velocity[None])
        distance = float(np.hypot(*gap))
        normal = gap / distance if distance > 0 else np.zeros(2)
        approach, across = normal @ rate, normal[0] * rate[1] - normal[1] * rate[0]
        begin = [c - distance, abs(across), max(approach, 0.0) if distance > c else 0.0, 0.0]
        node = items.NodeGenericData(initialCoordinates=begin, numberOfDataCoordinates=len(begin))
        history = self.mbs.AddNode(node)
        contact = items.ObjectContactSphereSphere(
            markerNumbers=self._markers(pin)[:: -1 if pin.bearing_on_j else 1],
            nodeNumber=history,
            spheresRadii=[radius - c, radius],
            isHollowSphere1=True,
            contactStiffness=stiffness_of(clearance),
            contactStiffnessExponent=exponent_of(clearance),
            contactDamping=clearance.damping_N_s_m or 0.0,
            impactModel=impact_model,
            restitutionCoefficient=restitution,
            minimumImpactVelocity=minimum_impact_speed_of(clearance),
            dynamicFriction=0.0 if friction is None else friction.coefficient,
            frictionProportionalZone=1.0 if friction is None else friction.regularisation_speed_m_s,
        )
        self.mbs.AddObject(contact)
        return history

    def _add_loads(self, position: FloatArray) -> None:
        """Add all parts of loads, springs and the torque of a drive that prescribes no motion."""
        lines = {self.of.bodies[load.body].name: load.line for load in self.of.loads}
        called = dict[str, loads.Force | loads.Torque]()
        for name, load in loads_of(self.of).items():
            if isinstance(load, Spring):
                self._add_spring(load)
                continue
            numbers, line = _numbers(load.law), lines.get(name.partition(".")[0])
            coordinate = way_of(self.branches, line) if isinstance(line, Guide) else None
            if numbers is None or (isinstance(load, loads.Force) and coordinate is None):
                called[name] = load
                continue
            constant, damper, stiffness, free = numbers
            spring: dict[str, Any] = {"stiffness": stiffness, "damping": damper}
            if isinstance(load, loads.Torque):
                sides, torque = [self._marker(load.against), self._marker(load.body)], [0.0, 0.0, constant]
                steady = items.LoadTorqueVector(markerNumber=sides[1], loadVector=torque)
                if stiffness:
                    node, offset = self._twisted(load.against, load.body, position)
                    spring |= {"nodeNumber": node, "offset": offset + free}
                connector = items.ObjectConnectorTorsionalSpringDamper
            elif coordinate is not None:
                branch, link = coordinate
                sign = -1.0 if self.branches[branch].links[link].body == load.body_i else 1.0
                sides = [self._still(), self._coordinate(self._nodes[branch], link)]
                steady = items.LoadCoordinate(markerNumber=sides[1], load=sign * constant)
                spring["offset"] = sign * free - self.branches[branch].start[link]
                connector = items.ObjectConnectorCoordinateSpringDamper
            if constant:
                self.mbs.AddLoad(steady)
            if stiffness or damper:
                self.mbs.AddObject(connector(markerNumbers=sides, **spring))
        if called:
            self._add_function(called, position)

    def _add_spring(self, spring: Spring) -> None:
        """Add a spring; one without free length and damper has a force at length 0 too."""
        sides, stiffness = self._markers(spring)[::-1], spring.stiffness_N_m
        if spring.free_length_m or spring.damping_N_s_m:
            of = {"referenceLength": spring.free_length_m, "damping": spring.damping_N_s_m}
            item = items.ObjectConnectorSpringDamper(markerNumbers=sides, stiffness=stiffness, **of)
        else:
            along = [stiffness, stiffness, 0.0]
            item = items.ObjectConnectorCartesianSpringDamper(markerNumbers=sides, stiffness=along)
        self.mbs.AddObject(item)

    def _twisted(self, i: int, j: int, position: FloatArray) -> tuple[Any, float]:
        """Return the node that counts turns of body j against body i, and what their frames are turned by."""
        bodies = [(sign, body) for sign, body in ((1.0, j), (-1.0, i)) if body != GROUND]
        links = [
            (sign, body, self.branches[b].links[k]) for sign, body in bodies for b, k in [self._places[body]]
        ]
        offset = -sum(sign * link.turned_rad for sign, _, link in links)
        begin = [offset + sum(sign * float(position[body, 2]) for sign, body, _ in links)]
        node = items.NodeGenericData(initialCoordinates=begin, numberOfDataCoordinates=1)
        return self.mbs.AddNode(node), offset

    def _add_function(self, called: dict[str, loads.Force | loads.Torque], position: FloatArray) -> None:
        """Add loads as a function of Python.

        No node that is not needed: implicit solvers difference these forces by every coordinate.
        """
        from engine_models.exudyn.called import generalised, numbers_of  # which imports Numba

        p, used = numbers_of(self.of, called), set[int]()
        for load in called.values():
            ends = {load.body, load.against} if isinstance(load, loads.Torque) else {load.body_i, load.body_j}
            ends |= {load.law.crank} if isinstance(load.law, loads.ByAngle) else set()
            used |= {self._places[body][0] for body in ends - {GROUND}}
        links = link_rows([self.branches[branch] for branch in sorted(used)])
        start = np.concatenate([self.branches[branch].start for branch in sorted(used)])
        at, out = np.zeros((3, position.size)), np.empty(len(start))
        at[0] = position.ravel()

        def force(_: exu.MainSystem, t: float, __: int, q: Any, rates: Any) -> FloatArray:
            generalised(p, links, t, start + q, np.asarray(rates), at, out)
            return out

        force(self.mbs, 0.0, 0, 0.0 * start, 0.0 * start)  # compiled before the run
        nodes, mass = [self._nodes[branch] for branch in sorted(used)], np.zeros((len(start), len(start)))
        item = items.ObjectGenericODE2(nodeNumbers=nodes, massMatrix=mass, forceUserFunction=force)
        self.mbs.AddObject(item)

    def _add_drive(self, tree: bool, branch: int, link: int) -> None:
        """Add what prescribes a speed: a constraint of the absolute model, in a tree a flywheel's torque.

        A changing speed is held against a heavy mass. The ground would do, with all of the speed as a
        function of time beside it, which is exact at every step. But Exudyn takes that for a speed without
        acceleration as it computes the accelerations at the start, and the trapezoidal rule keeps that error
        for ever. So the mass has the acceleration of the start at all times, of which no step makes an error.
        It would also keep an error of order one from every kink in the acceleration, and a table has one at
        every entry: there the mass has all of the speed, by a force of time.
        """
        drive, mbs = self.of.drive, self.mbs
        assert isinstance(drive.law, data.Motion)
        motion = going_on(drive.law, drive.clock_s)
        driven, by_table = self._coordinate(self._nodes[branch], link), isinstance(drive.law, data.Course)
        _, speed, acceleration = map(float, moved(motion, 0.0))

        def push(_: exu.MainSystem, t: float, __: float) -> float:
            return HEAVY * float(moved(motion, t)[2])

        def rest(_: exu.MainSystem, t: float, *__: Any) -> float:
            return float(moved(motion, t)[1]) - acceleration * t

        if tree:
            if drive.guide is not None:  # else the flywheel is in the link's inertia; this one has no weight
                mass = np.zeros(2 * [len(self.branches[branch].links)])
                mass[link, link] = HEAVY
                mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=[self._nodes[branch]], massMatrix=mass))
            if not isinstance(drive.law, data.ConstantSpeed):
                mbs.AddLoad(items.LoadCoordinate(markerNumber=driven, load=0.0, loadUserFunction=push))
            return
        if isinstance(drive.law, data.ConstantSpeed):
            other, beside = self._still(), dict[str, Any](offset=speed)
        else:
            node = mbs.AddNode(items.Node1D(initialVelocities=[speed if by_table else 0.0]))
            mbs.AddObject(items.ObjectMass1D(mass=HEAVY, nodeNumber=node))
            other = self._coordinate(node)
            load = {"loadUserFunction": push} if by_table else {"load": HEAVY * acceleration}
            mbs.AddLoad(items.LoadCoordinate(markerNumber=other, **load))
            beside = {} if by_table else {"offsetUserFunction_t": rest}
        sides = [other, driven]
        mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=sides, velocityLevel=True, **beside))


def _matrix(angle_rad: float) -> FloatArray:
    """Return the rotation about z by an angle, (3, 3)."""
    x, y = turned(angle_rad, (1.0, 0.0)), turned(angle_rad, (0.0, 1.0))
    return np.array([[x[0], y[0], 0.0], [x[1], y[1], 0.0], [0.0, 0.0, 1.0]])


def _numbers(law: loads.Law) -> tuple[float, float, float, float] | None:
    """Return constant, damping, stiffness and free place of a law of these, None of any other."""
    match law:
        case loads.Constant(size):
            return size, 0.0, 0.0, 0.0
        case loads.Damping(damping):
            return 0.0, damping, 0.0, 0.0
        case loads.Restoring(stiffness, free):
            return 0.0, 0.0, stiffness, free
        case data.Motor(stall, speed):
            return stall, stall / speed, 0.0, 0.0
    return None

"""A scene as an Exudyn model, with nothing in it that the scene does not need.

The absolute model has planar bodies and constraints for its ideal joints; implicit solvers run it. What a
guide of the ground carries at a fixed angle is a mass on that guide's coordinate, and what an ideal pin of
the ground carries a rotor of one angle: neither needs a constraint or costs a multiplier. The tree model has
no constraint at all: the ideal joints are those of a kinematic tree, and a prescribed speed is kept by a
flywheel. Explicit solvers run it. A joint with clearance is a contact in both. All coordinates that Exudyn
solves for are displacements from the assembled start.
"""

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.contact import add_contact
from engine_models.exudyn.drive import FLYWHEEL_KG_M2, HEAVY_KG, add_speed
from engine_models.exudyn.kinematic_tree import (
    Branch,
    absolute_branches,
    driven_link,
    tree_branches,
    turned,
)
from engine_models.exudyn.loads import add_loads
from engine_models.exudyn.motion import Part
from engine_models.mechanics.start_check import checked_start
from engine_models.mechanics.states import pin_gap
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import GROUND, Guide, MechanismData, Point, Spring, Torque

items: Any = itemInterface  # its constructors carry no types


@dataclass(frozen=True)
class Model:
    """An assembled Exudyn model: the container that owns it, and the sensors by what they measure.

    ``joint_forces`` are those of the revolute joints, each on the body named later. ``driver`` measures minus
    the torque, or the force along a guide, and is None without the constraint of a prescribed speed.
    ``histories`` are those of the contacts, by joint. ``reference`` (bodies, 3) is the start. Only the tree
    model has no constraint, ``tree`` being true. ``by_balance``: Exudyn does not tell all forces, and all
    follow from the accelerations, which are recorded.
    """

    container: exu.SystemContainer
    mbs: exu.MainSystem
    reference: FloatArray
    parts: tuple[Part, ...]
    joint_forces: dict[str, int]
    driver: int | None
    histories: dict[str, int]
    tree: bool
    by_balance: bool


def build_model(scene: Scene, tree: bool = False) -> Model:
    """Return the assembled absolute model, or the tree model where ideal joints close no loop."""
    container, (position, velocity), of = exu.SystemContainer(), checked_start(scene), scene.mechanism
    mbs = container.AddSystem()
    branches = (tree_branches if tree else absolute_branches)(of, position, velocity)
    links = {link.name for branch in branches for link in branch.links}
    # A guide that is a constraint does not tell its moment, nor does a tree any force.
    constrained = [guide for guide in of.guides if guide.name not in links]
    by_balance = tree or bool(constrained) or any(branch.kind == "tree" for branch in branches)
    bodies = Bodies(mbs, of, tree, by_balance)
    for branch in branches:
        bodies.add(branch)
    forces: dict[str, int] = {}
    histories: dict[str, int] = {}
    for pin in of.pins:
        if pin.name in links:
            continue
        # The first marker is on the body whose force the sensor is to give; of a contact it is the pin's.
        markers = [bodies.marker(pin.body_j, pin.point_j), bodies.marker(pin.body_i, pin.point_i)]
        if pin.clearance is not None:
            clearance, start = scene.clearances[pin.name], pin_gap(pin, position[None], velocity[None])
            history = add_contact(mbs, markers[:: -1 if pin.bearing_on_j else 1], clearance, start)
            histories[pin.name] = node_sensor(mbs, history, "Coordinates")
        else:
            connector = mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))
            forces[pin.name] = force_sensor(mbs, connector)
    for guide in constrained:
        bodies.constrain(guide, position)
    for spring in of.springs:
        bodies.add_spring(spring)
    add_loads(mbs, of, tuple(bodies.parts), position, flywheel=tree)
    driver = None
    if of.drive.prescribes and not tree:
        driver = force_sensor(mbs, add_speed(mbs, scene, *bodies.driven()))
    if isinstance(of.drive.law, Torque) and isinstance(of.drive.law.torque_N_m, float):
        torque = [0.0, 0.0, of.drive.law.torque_N_m]
        mbs.AddLoad(items.LoadTorqueVector(markerNumber=bodies.marker(of.drive.body), loadVector=torque))
    mbs.Assemble()
    return Model(container, mbs, position, tuple(bodies.parts), forces, driver, histories, tree, by_balance)


class Bodies:
    """The bodies of a system: its ``parts``, and for every body its branch, its object and its link."""

    def __init__(self, mbs: exu.MainSystem, of: MechanismData, tree: bool, accelerations: bool) -> None:
        self.parts: list[Part] = []
        self._mbs, self._of, self._tree, self._accelerations = mbs, of, tree, accelerations
        self._where: dict[int, tuple[Branch, Any, int]] = {}

    def add(self, branch: Branch) -> None:
        """Add a branch at its start, and the weights of its bodies."""
        node, carrier = (self._add_tree if branch.kind == "tree" else self._add_single)(branch)
        own = {link.body: k for k, link in enumerate(branch.links) if link.body is not None}
        self._where |= {body: (branch, carrier, k) for body, k in own.items()}
        quantities = ["Coordinates", "Coordinates_t"]
        if self._accelerations or branch.kind == "rotor":
            quantities.append("Coordinates_tt")
        sensors = tuple(node_sensor(self._mbs, node, quantity) for quantity in quantities)
        self.parts.append(Part(node, branch.links, branch.start, sensors))
        if branch.kind != "tree":
            self._add_weight(*own)

    def _inertias(self, branch: Branch, link: int) -> tuple[float, float]:
        """Return mass and inertia of a link, with the flywheel's where the tree model has one."""
        of, body, mass, inertia = self._of, branch.links[link].body, 0.0, 0.0
        if body is not None:
            mass, inertia = of.bodies[body].mass_kg, of.bodies[body].inertia_kg_m2
        if not (self._tree and of.drive.prescribes and link == driven_link(of, branch.links)):
            return mass, inertia
        return (mass, inertia + FLYWHEEL_KG_M2) if of.drive.guide is None else (HEAVY_KG, inertia)

    def _add_single(self, branch: Branch) -> tuple[Any, Any]:
        """Add a body with coordinates of its own; return its node and its object."""
        mbs, link = self._mbs, branch.links[-1]
        mass, inertia = self._inertias(branch, len(branch.links) - 1)
        state = {"referenceCoordinates": branch.start, "initialVelocities": branch.rates}
        place = [*link.offset_m, 0.0]
        if branch.kind == "free":
            node = mbs.AddNode(items.NodeRigidBody2D(**state))
            body = items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node)
        elif branch.kind == "mass":
            node = mbs.AddNode(items.Node1D(**state))
            turn = _matrix(link.angle_rad)
            body = items.ObjectMass1D(
                mass=mass, nodeNumber=node, referencePosition=place, referenceRotation=turn
            )
        else:
            node = mbs.AddNode(items.Node1D(**state))
            inertia += mass * (link.centre_m[0] ** 2 + link.centre_m[1] ** 2)
            body = items.ObjectRotationalMass1D(inertia=inertia, nodeNumber=node, referencePosition=place)
        return node, mbs.AddObject(body)

    def _add_weight(self, body: int) -> None:
        """Add a body's weight; across its guide, outside its one equation, a mass has none."""
        branch, carrier, k = self._where[body]
        mass, _ = self._inertias(branch, k)
        x, y = self._of.gravity_m_s2
        u = turned(branch.links[k].angle_rad, (1.0, 0.0))
        acts = (x or y) if branch.kind != "mass" else x * u[0] + y * u[1]
        if acts:
            place = [*branch.links[k].centre_m, 0.0]
            at = self._mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=carrier, localPosition=place))
            weight = [mass * x, mass * y, 0.0]
            self._mbs.AddLoad(items.LoadForceVector(markerNumber=at, loadVector=weight))

    def _add_tree(self, branch: Branch) -> tuple[Any, Any]:
        """Add a tree; return its node and its object."""
        links, count = branch.links, len(branch.links)
        node = self._mbs.AddNode(
            items.NodeGenericODE2(
                referenceCoordinates=branch.start,
                initialCoordinates=[0.0] * count,
                initialCoordinates_t=branch.rates,
                numberOfODE2Coordinates=count,
            )
        )
        matrices: Any = exu.Matrix3DList  # their constructors carry no arguments
        vectors: Any = exu.Vector3DList
        kinds = {
            "x": exu.JointType.PrismaticX,
            "y": exu.JointType.PrismaticY,
            "turn": exu.JointType.RevoluteZ,
        }
        inertias = [self._inertias(branch, k) for k in range(count)]
        tree = items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[kinds[link.joint] for link in links],
            linkParents=[link.parent for link in links],
            jointTransformations=matrices([_matrix(link.angle_rad) for link in links]),
            jointOffsets=vectors([[*link.offset_m, 0.0] for link in links]),
            linkMasses=[mass for mass, _ in inertias],
            linkInertiasCOM=matrices([np.diag([0.0, 0.0, inertia]) for _, inertia in inertias]),
            linkCOMs=vectors([[*link.centre_m, 0.0] for link in links]),
            gravity=[*self._of.gravity_m_s2, 0.0],
        )
        return node, self._mbs.AddObject(tree)

    def marker(self, body: int, point: Point = (0.0, 0.0)) -> Any:
        """Add a marker with position and orientation at a point of a body, or of the ground."""
        if body == GROUND:
            ground = self._mbs.AddObject(items.ObjectGround())
            place = [*point, 0.0]
            return self._mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=ground, localPosition=place))
        branch, carrier, k = self._where[body]
        place = [*branch.links[k].place(point), 0.0]
        if branch.kind == "tree":
            marker = items.MarkerKinematicTreeRigid(objectNumber=carrier, linkNumber=k, localPosition=place)
        else:
            marker = items.MarkerBodyRigid(bodyNumber=carrier, localPosition=place)
        return self._mbs.AddMarker(marker)

    def constrain(self, guide: Guide, position: FloatArray) -> None:
        """Add the constraint of a guide, which keeps its body's angle at the start, (bodies, 3)."""
        i, j = guide.body_i, guide.body_j
        line = self.marker(i, guide.point_i)
        pin = self.marker(j, guide.point_j)
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
        self._mbs.AddObject(joint)

    def _turned(self, body: int) -> float:
        """Return the angle of a body against its object's or link's frame."""
        if body == GROUND:
            return 0.0
        branch, _, k = self._where[body]
        return branch.links[k].turned_rad

    def add_spring(self, spring: Spring) -> None:
        """Add a spring and its damper; without either length or damper it has a force at length 0 too."""
        sides = [self.marker(spring.body_i, spring.point_i), self.marker(spring.body_j, spring.point_j)]
        k, length, c = spring.stiffness_N_m, spring.free_length_m, spring.damping_N_s_m
        if length or c:
            item = items.ObjectConnectorSpringDamper(
                markerNumbers=sides, referenceLength=length, stiffness=k, damping=c
            )
        else:
            item = items.ObjectConnectorCartesianSpringDamper(markerNumbers=sides, stiffness=[k, k, 0.0])
        self._mbs.AddObject(item)

    def driven(self) -> tuple[Any, int]:
        """Return the node of what is driven and the number of its coordinate there."""
        found = ((part.node, driven_link(self._of, part.links)) for part in self.parts)
        return next((node, link) for node, link in found if link is not None)


def _matrix(angle_rad: float) -> FloatArray:
    """Return the rotation about z by an angle, (3, 3)."""
    x, y = turned(angle_rad, (1.0, 0.0)), turned(angle_rad, (0.0, 1.0))
    return np.array([[x[0], y[0], 0.0], [x[1], y[1], 0.0], [0.0, 0.0, 1.0]])


def _across(angle_rad: float) -> list[float]:
    """Return the unit vector to the left of a line at an angle."""
    return [*turned(angle_rad, (0.0, 1.0)), 0.0]


def node_sensor(mbs: exu.MainSystem, node: Any, quantity: str) -> Any:
    """Add a sensor of a node's coordinates, their rates or their accelerations."""
    variable = getattr(exu.OutputVariableType, quantity)
    return mbs.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=variable, storeInternal=True))


def force_sensor(mbs: exu.MainSystem, connector: Any) -> Any:
    """Add a sensor of a constraint's force."""
    force = exu.OutputVariableType.Force
    return mbs.AddSensor(
        items.SensorObject(objectNumber=connector, outputVariableType=force, storeInternal=True)
    )

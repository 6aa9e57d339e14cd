"""A scene as an Exudyn model, with nothing in it that the scene does not need.

The absolute model has planar bodies and a constraint for every ideal joint; implicit solvers run it. The
slider is a mass on its own guide coordinate, so the guide needs no constraint and costs no multiplier. The
tree model has no constraint at all: the ideal joints are those of a kinematic tree, and a prescribed crank
speed is kept by a flywheel. Explicit solvers run it. A joint with clearance is a contact in both. All
coordinates that Exudyn solves for are displacements from the assembled start.
"""

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.contact import add_contact
from engine_models.exudyn.drive import FLYWHEEL_KG_M2, add_speed
from engine_models.exudyn.kinematic_tree import TreeLink, tree_links, tree_start
from engine_models.exudyn.loads import add_loads
from engine_models.exudyn.motion import Part
from engine_models.mechanics.joints import CRANK, SLIDER, clearances, ends, joint_gap
from engine_models.mechanics.start_check import checked_start
from engine_models.scene.scene import Scene

items: Any = itemInterface  # its constructors carry no types


@dataclass(frozen=True)
class Model:
    """An assembled Exudyn model: the container that owns it, and the sensors by what they measure.

    ``joint_forces`` are those of the absolute model's ideal joints, each on the body further from the crank
    pivot. ``driver`` measures minus the torque on the crank and is None without the constraint of a
    prescribed speed. ``histories`` are those of the contacts, by joint. ``reference`` (bodies, 3) is the
    start. Only the tree model has no constraint, ``tree`` being true.
    """

    container: exu.SystemContainer
    mbs: exu.MainSystem
    reference: FloatArray
    parts: tuple[Part, ...]
    joint_forces: dict[str, int]
    driver: int | None
    histories: dict[str, int]
    tree: bool


@dataclass(frozen=True)
class Bodies:
    """The parts of a system, and for every body of the scene the object that it is, or is a link of."""

    mbs: exu.MainSystem
    parts: tuple[Part, ...]
    objects: dict[int, Any]

    def marker(self, body: int | None, place_m: float = 0.0) -> Any:
        """Add a marker with position and orientation at ``place_m`` from a body's centre of mass.

        Without a body it is on the ground, from the origin.
        """
        for number, link in enumerate(self.parts[0].links):
            if body is not None and link.body == body:
                at = [link.centre_m + place_m, 0.0, 0.0]
                marker = items.MarkerKinematicTreeRigid(
                    objectNumber=self.objects[body], linkNumber=number, localPosition=at
                )
                return self.mbs.AddMarker(marker)
        carrier = self.mbs.AddObject(items.ObjectGround()) if body is None else self.objects[body]
        marker = items.MarkerBodyRigid(bodyNumber=carrier, localPosition=[place_m, 0.0, 0.0])
        return self.mbs.AddMarker(marker)


def build_model(scene: Scene, tree: bool = False) -> Model:
    """Return the assembled absolute model, or the tree model of a scene with clearance."""
    container, (position, velocity) = exu.SystemContainer(), checked_start(scene)
    mbs = container.AddSystem()
    bodies = _add_bodies(mbs, scene, position, velocity, tree)
    forces: dict[str, int] = {}
    histories: dict[str, int] = {}
    for joint, sides in ends(scene).items():
        clearance = clearances(scene).get(joint)
        if tree and clearance is None:
            continue
        # The first marker is on the body whose force the sensor is to give.
        markers = [bodies.marker(*side) for side in sides]
        if clearance is not None:
            start = joint_gap(scene, joint, position[None], velocity[None])
            history = add_contact(mbs, markers, clearance, start)
            histories[joint] = _node_sensor(mbs, history, "Coordinates")
        else:
            connector = mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))
            forces[joint] = _force_sensor(mbs, connector)
    add_loads(mbs, scene, bodies.parts, position, flywheel=tree)
    driver = None
    if scene.speed_is_prescribed and not tree:
        driver = _force_sensor(mbs, add_speed(mbs, scene, bodies.parts[CRANK].node))
    if scene.drive.kind == "torque":
        torque = [0.0, 0.0, scene.drive.torque_N_m]
        mbs.AddLoad(items.LoadTorqueVector(markerNumber=bodies.marker(CRANK), loadVector=torque))
    mbs.Assemble()
    return Model(container, mbs, position, bodies.parts, forces, driver, histories, tree)


def _add_bodies(
    mbs: exu.MainSystem, scene: Scene, position: FloatArray, velocity: FloatArray, tree: bool
) -> Bodies:
    """Add all bodies at their start, each (bodies, 3), with their weights; those in chains as one tree."""
    links = tree_links(scene) if tree else ()
    inertias = [part.inertia_kg_m2 for part in scene.bodies]
    if tree and scene.speed_is_prescribed:
        inertias[CRANK] += FLYWHEEL_KG_M2
    parts: list[Part] = []
    objects: dict[int, Any] = {}
    quantities = ("Coordinates", "Coordinates_t", *(["Coordinates_tt"] if tree else []))

    def add_part(node: Any, start: FloatArray, **what: Any) -> None:
        sensors = tuple(_node_sensor(mbs, node, quantity) for quantity in quantities)
        parts.append(Part(node, start, sensors, **what))

    if links:
        start, rates = tree_start(links, position, velocity)
        node, chains = _add_tree(mbs, scene, links, inertias, start, rates)
        add_part(node, start, links=links)
        objects |= {link.body: chains for link in links if link.body is not None}
    for body, what in enumerate(scene.bodies):
        if body in objects:
            continue
        if body == SLIDER:
            at = position[body, :1]
            node = mbs.AddNode(items.Node1D(referenceCoordinates=at, initialVelocities=velocity[body, :1]))
            # Its weight acts across its guide, outside its one equation.
            objects[body] = mbs.AddObject(items.ObjectMass1D(mass=what.mass_kg, nodeNumber=node))
        else:
            at = position[body]
            node = mbs.AddNode(
                items.NodeRigidBody2D(referenceCoordinates=at, initialVelocities=velocity[body])
            )
            objects[body] = mbs.AddObject(
                items.ObjectRigidBody2D(mass=what.mass_kg, inertia=inertias[body], nodeNumber=node)
            )
            _add_weight(mbs, scene, objects[body])
        add_part(node, at, body=body)
    return Bodies(mbs, tuple(parts), objects)


def _add_weight(mbs: exu.MainSystem, scene: Scene, body: Any) -> None:
    if scene.gravity_m_s2 != 0:
        mass = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        load = [0.0, -scene.gravity_m_s2, 0.0]
        mbs.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=load))


def _add_tree(
    mbs: exu.MainSystem,
    scene: Scene,
    links: tuple[TreeLink, ...],
    inertias: list[float],
    start: FloatArray,
    rates: FloatArray,
) -> tuple[Any, Any]:
    """Add a tree at its coordinates and rates at the start, each (links,); return its node and its object."""
    count = len(links)
    node = mbs.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=start,
            initialCoordinates=[0.0] * count,
            initialCoordinates_t=rates,
            numberOfODE2Coordinates=count,
        )
    )
    matrices: Any = exu.Matrix3DList  # their constructors carry no arguments
    vectors: Any = exu.Vector3DList
    kinds = {"x": exu.JointType.PrismaticX, "y": exu.JointType.PrismaticY, "turn": exu.JointType.RevoluteZ}
    masses = [0.0 if link.body is None else scene.bodies[link.body].mass_kg for link in links]
    about_z = [0.0 if link.body is None else inertias[link.body] for link in links]
    tree = items.ObjectKinematicTree(
        nodeNumber=node,
        jointTypes=[kinds[link.joint] for link in links],
        linkParents=[link.parent for link in links],
        jointTransformations=matrices([np.eye(3)] * count),
        jointOffsets=vectors([[link.offset_m, 0.0, 0.0] for link in links]),
        linkMasses=masses,
        linkInertiasCOM=matrices([np.diag([0.0, 0.0, inertia]) for inertia in about_z]),
        linkCOMs=vectors([[link.centre_m, 0.0, 0.0] for link in links]),
        gravity=[0.0, -scene.gravity_m_s2, 0.0],
    )
    return node, mbs.AddObject(tree)


def _node_sensor(mbs: exu.MainSystem, node: Any, quantity: str) -> Any:
    variable = getattr(exu.OutputVariableType, quantity)
    return mbs.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=variable, storeInternal=True))


def _force_sensor(mbs: exu.MainSystem, connector: Any) -> Any:
    force = exu.OutputVariableType.Force
    return mbs.AddSensor(
        items.SensorObject(objectNumber=connector, outputVariableType=force, storeInternal=True)
    )

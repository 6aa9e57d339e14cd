"""A scene as an Exudyn model, with nothing in it that the scene does not need.

The absolute model has planar bodies and constraints for its ideal joints; implicit solvers run it. The
slider is a mass on its own guide coordinate and the crank, where O is ideal, a rotor of one angle: neither
the guide nor O needs a constraint or costs a multiplier. The tree model has no constraint at all: the ideal
joints are those of a kinematic tree, and a prescribed crank speed is kept by a flywheel. Explicit solvers run
it. A joint with clearance is a contact in both. All coordinates that Exudyn solves for are displacements from
the assembled start.
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
from engine_models.mechanics.joints import CRANK, SLIDER, ends, joint_gap
from engine_models.mechanics.start_check import checked_start
from engine_models.scene.scene import Scene

items: Any = itemInterface  # its constructors carry no types


@dataclass(frozen=True)
class Model:
    """An assembled Exudyn model: the container that owns it, and the sensors by what they measure.

    ``joint_forces`` are those of the absolute model's ideal joints but O, each on the body further from the
    crank pivot. ``driver`` measures minus the torque on the crank and is None without the constraint of a
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
    """The parts of a system, and for every body of the scene the object that it is, or is a link of.

    The links are those of a kinematic ``tree`` or the rotor's.
    """

    mbs: exu.MainSystem
    parts: tuple[Part, ...]
    objects: dict[int, Any]
    tree: bool

    def marker(self, body: int | None, place_m: float = 0.0) -> Any:
        """Add a marker with position and orientation at ``place_m`` from a body's centre of mass.

        Without a body it is on the ground, from the origin.
        """
        carrier = self.mbs.AddObject(items.ObjectGround()) if body is None else self.objects[body]
        links = self.parts[0].links
        number = next((k for k, link in enumerate(links) if body is not None and link.body == body), None)
        at = [place_m if number is None else links[number].centre_m + place_m, 0.0, 0.0]
        if number is not None and self.tree:
            marker = items.MarkerKinematicTreeRigid(objectNumber=carrier, linkNumber=number, localPosition=at)
        else:
            marker = items.MarkerBodyRigid(bodyNumber=carrier, localPosition=at)
        return self.mbs.AddMarker(marker)


def build_model(scene: Scene, tree: bool = False) -> Model:
    """Return the assembled absolute model, or the tree model of a scene with clearance."""
    container, (position, velocity) = exu.SystemContainer(), checked_start(scene)
    mbs = container.AddSystem()
    bodies = _add_bodies(mbs, scene, position, velocity, tree)
    forces: dict[str, int] = {}
    histories: dict[str, int] = {}
    for joint, sides in ends(scene).items():
        clearance = scene.clearances.get(joint)
        if clearance is None and (tree or joint == "O"):
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
        driver = _force_sensor(mbs, add_speed(mbs, scene, bodies.parts[CRANK]))
    if scene.drive.kind == "torque":
        torque = [0.0, 0.0, scene.drive.constant_N_m]
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

    def add_part(node: Any, start: FloatArray, body: int = -1, links: tuple[TreeLink, ...] = ()) -> None:
        quantities = ("Coordinates", "Coordinates_t", *(["Coordinates_tt"] if tree or links else []))
        sensors = tuple(_node_sensor(mbs, node, quantity) for quantity in quantities)
        parts.append(Part(node, start, sensors, body, links))

    if links:
        start, rates = tree_start(links, position, velocity)
        node, chains = _add_tree(mbs, scene, links, inertias, start, rates)
        add_part(node, start, links=links)
        objects |= {link.body: chains for link in links if link.body is not None}
    for body, what in enumerate(scene.bodies):
        if body in objects:
            continue
        at, speeds = position[body], velocity[body]
        if body == SLIDER:
            at = at[:1]
            node = mbs.AddNode(items.Node1D(referenceCoordinates=at, initialVelocities=speeds[:1]))
            # Its weight acts across its guide, outside its one equation.
            objects[body] = mbs.AddObject(items.ObjectMass1D(mass=what.mass_kg, nodeNumber=node))
            add_part(node, at, body)
        elif body == CRANK and not tree and "O" not in scene.joints_with_clearance:
            at, s = at[2:], scene.crank.centre_of_mass_m
            node = mbs.AddNode(items.Node1D(referenceCoordinates=at, initialVelocities=speeds[2:]))
            inertia = inertias[body] + what.mass_kg * s**2
            objects[body] = mbs.AddObject(items.ObjectRotationalMass1D(inertia=inertia, nodeNumber=node))
            _add_weight(mbs, scene, objects[body], what.mass_kg, s)
            add_part(node, at, links=(TreeLink(-1, "turn", body=CRANK, centre_m=s),))
        else:
            node = mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=at, initialVelocities=speeds))
            objects[body] = mbs.AddObject(
                items.ObjectRigidBody2D(mass=what.mass_kg, inertia=inertias[body], nodeNumber=node)
            )
            _add_weight(mbs, scene, objects[body], what.mass_kg, 0.0)
            add_part(node, at, body)
    return Bodies(mbs, tuple(parts), objects, tree)


def _add_weight(mbs: exu.MainSystem, scene: Scene, body: Any, mass_kg: float, place_m: float) -> None:
    """Add a body's weight, which acts at a place along its x axis."""
    if scene.weight_m_s2 != 0:
        at = mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[place_m, 0.0, 0.0]))
        weight = [0.0, -mass_kg * scene.weight_m_s2, 0.0]
        mbs.AddLoad(items.LoadForceVector(markerNumber=at, loadVector=weight))


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
        gravity=[0.0, -scene.weight_m_s2, 0.0],
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

"""The bodies of a scene in an Exudyn system: planar bodies, a slider with one coordinate, a kinematic tree.

All coordinates that Exudyn solves for are displacements from the assembled start.
"""

from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.tree import CRANK, SLIDER, TreeLink, tree_start
from engine_models.scene.scene import Scene

items: Any = itemInterface  # its constructors carry no types


@dataclass(frozen=True)
class Part:
    """A node with its coordinates at the start (c,), and its one body or the links of its tree."""

    node: Any
    start: FloatArray
    body: int = -1
    links: tuple[TreeLink, ...] = ()


@dataclass(frozen=True)
class Bodies:
    """The parts of a system, and for every body of the scene the object and the link that it is."""

    mbs: exu.MainSystem
    parts: tuple[Part, ...]
    objects: dict[int, Any]
    links: tuple[TreeLink, ...]

    def marker(self, body: int, place_m: float = 0.0) -> Any:
        """Add a marker with position and orientation at ``place_m`` from a body's centre of mass."""
        for number, link in enumerate(self.links):
            if link.body == body:
                at = [link.centre_m + place_m, 0.0, 0.0]
                marker = items.MarkerKinematicTreeRigid(
                    objectNumber=self.objects[body], linkNumber=number, localPosition=at
                )
                return self.mbs.AddMarker(marker)
        at = [place_m, 0.0, 0.0]
        return self.mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=self.objects[body], localPosition=at))


def add_bodies(
    mbs: exu.MainSystem,
    scene: Scene,
    position: FloatArray,
    velocity: FloatArray,
    links: tuple[TreeLink, ...] = (),
    flywheel_kg_m2: float = 0.0,
) -> Bodies:
    """Add all bodies at their start, each (bodies, 3), with their weights; those of the links as one tree.

    ``flywheel_kg_m2`` is added to the crank's inertia.
    """
    parts: list[Part] = []
    objects: dict[int, Any] = {}
    inertias = [part.inertia_kg_m2 for part in scene.bodies]
    inertias[CRANK] += flywheel_kg_m2
    if links:
        part, tree = _add_tree(mbs, scene, position, velocity, links, inertias)
        parts.append(part)
        objects |= {link.body: tree for link in links if link.body is not None}
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
        parts.append(Part(node, at, body))
    return Bodies(mbs, tuple(parts), objects, links)


def _add_weight(mbs: exu.MainSystem, scene: Scene, body: Any) -> None:
    if scene.gravity_m_s2 != 0:
        mass = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        load = [0.0, -scene.gravity_m_s2, 0.0]
        mbs.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=load))


def _add_tree(
    mbs: exu.MainSystem,
    scene: Scene,
    position: FloatArray,
    velocity: FloatArray,
    links: tuple[TreeLink, ...],
    inertias: list[float],
) -> tuple[Part, Any]:
    (start, rates), count = tree_start(links, position, velocity), len(links)
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
    return Part(node, start, links=links), mbs.AddObject(tree)

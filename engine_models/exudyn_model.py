"""The crank-slider as an Exudyn model: two planar bodies, a slider with one coordinate, revolute joints.

The slider is a mass on its own guide coordinate, so the guide needs no constraint and costs no multiplier.
All coordinates that Exudyn solves for are displacements from the assembled start.
"""

import math
from dataclasses import dataclass
from typing import Any

import exudyn as exu
from exudyn import itemInterface

from engine_models.assembly import assembled
from engine_models.engine import FloatArray
from engine_models.scene import Link, Scene

items: Any = itemInterface  # its constructors carry no types


@dataclass(frozen=True)
class Model:
    """An assembled Exudyn model: the container that owns it, and the sensors by what they measure.

    ``coordinates`` and ``speeds`` follow BODIES, ``joint_forces`` follows JOINTS; each force is on the body
    further from the crank pivot. ``driver`` measures minus the torque on the crank and is None without a
    constant-speed drive. ``reference`` (3, 3) is the configuration that the coordinates are counted from.
    """

    container: exu.SystemContainer
    mbs: exu.MainSystem
    reference: FloatArray
    coordinates: tuple[int, ...]
    speeds: tuple[int, ...]
    joint_forces: tuple[int, ...]
    driver: int | None


def build_model(scene: Scene) -> Model:
    """Return the assembled model of an ideal scene, with nothing in it that the scene does not need.

    The crank starts from its angle within (-pi, pi]: whole turns would only cost digits.
    """
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    angle = math.remainder(scene.start.crank_angle_rad, 2 * math.pi)
    position, velocity = assembled(scene, angle, scene.start.crank_speed_rad_s)
    links = (scene.crank, scene.rod)
    nodes = [
        mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=position[i], initialVelocities=velocity[i]))
        for i in range(len(links))
    ]
    crank, rod = (
        mbs.AddObject(items.ObjectRigidBody2D(mass=link.mass_kg, inertia=link.inertia_kg_m2, nodeNumber=node))
        for link, node in zip(links, nodes, strict=True)
    )
    nodes.append(
        mbs.AddNode(items.Node1D(referenceCoordinates=position[2, :1], initialVelocities=velocity[2, :1]))
    )
    slider = mbs.AddObject(items.ObjectMass1D(mass=scene.slider.mass_kg, nodeNumber=nodes[2]))
    joints = _add_joints(mbs, scene, crank, rod, slider)
    if scene.gravity_m_s2 != 0:  # the slider's weight acts across its guide, outside its one equation
        for body in (crank, rod):
            mass = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=body))
            weight = items.LoadMassProportional(markerNumber=mass, loadVector=[0.0, -scene.gravity_m_s2, 0.0])
            mbs.AddLoad(weight)
    driver = _add_drive(mbs, scene, nodes[0])
    model = Model(
        container=container,
        mbs=mbs,
        reference=position,
        coordinates=tuple(_node_sensor(mbs, node, "Coordinates") for node in nodes),
        speeds=tuple(_node_sensor(mbs, node, "Coordinates_t") for node in nodes),
        joint_forces=tuple(_force_sensor(mbs, joint) for joint in joints),
        driver=None if driver is None else _force_sensor(mbs, driver),
    )
    mbs.Assemble()
    return model


def _add_joints(mbs: exu.MainSystem, scene: Scene, crank: Any, rod: Any, slider: Any) -> list[Any]:
    """Add the joints O, A, B; the first marker is on the body whose force the sensor is to give."""

    def pin(body: Any, x: float = 0.0) -> Any:
        return mbs.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[x, 0.0, 0.0]))

    def ends(link: Link) -> tuple[float, float]:
        return -link.centre_of_mass_m, link.length_m - link.centre_of_mass_m

    ground = mbs.AddObject(items.ObjectGround())
    (crank_O, crank_A), (rod_A, rod_B) = ends(scene.crank), ends(scene.rod)
    pairs = (
        [pin(crank, crank_O), pin(ground)],
        [pin(rod, rod_A), pin(crank, crank_A)],
        [pin(slider), pin(rod, rod_B)],
    )
    return [mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=pair)) for pair in pairs]


def _add_drive(mbs: exu.MainSystem, scene: Scene, crank_node: Any) -> Any | None:
    """Add what drives the crank; return the constraint of a constant-speed drive, else None."""
    if scene.drive.kind == "free":
        return None
    crank_angle = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=crank_node, coordinate=2))
    if scene.drive.kind == "torque":
        mbs.AddLoad(items.LoadCoordinate(markerNumber=crank_angle, load=scene.drive.torque_N_m))
        return None
    ground_node = mbs.AddNode(items.NodePointGround())
    at_rest = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground_node, coordinate=0))
    constraint = items.ObjectConnectorCoordinate(
        markerNumbers=[at_rest, crank_angle], offset=scene.start.crank_speed_rad_s, velocityLevel=True
    )
    return mbs.AddObject(constraint)


def _node_sensor(mbs: exu.MainSystem, node: Any, quantity: str) -> Any:
    variable = getattr(exu.OutputVariableType, quantity)
    return mbs.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=variable, storeInternal=True))


def _force_sensor(mbs: exu.MainSystem, connector: Any) -> Any:
    force = exu.OutputVariableType.Force
    return mbs.AddSensor(
        items.SensorObject(objectNumber=connector, outputVariableType=force, storeInternal=True)
    )

"""A scene as an Exudyn model, with nothing in it that the scene does not need.

The absolute model has planar bodies and a constraint for every ideal joint; implicit solvers run it. The
slider is a mass on its own guide coordinate, so the guide needs no constraint and costs no multiplier. The
tree model has no constraint at all: the ideal joints are those of a kinematic tree, and a constant crank
speed is kept by a flywheel. Explicit solvers run it. A joint with clearance is a contact in both.
"""

from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
from exudyn import itemInterface

from engine_models.engine import FloatArray
from engine_models.exudyn.bodies import Bodies, Part, add_bodies
from engine_models.exudyn.contact import add_contact
from engine_models.exudyn.tree import CRANK, tree_links
from engine_models.mechanics.joints import ends, joint_gap
from engine_models.mechanics.start_check import checked_start
from engine_models.scene.scene import Scene

items: Any = itemInterface  # its constructors carry no types

#: With this inertia in kg m^2 at the crank, no torque of a mechanism changes its speed by a rounding.
FLYWHEEL_KG_M2 = 1e15


@dataclass(frozen=True)
class Model:
    """An assembled Exudyn model: the container that owns it, and the sensors by what they measure.

    ``coordinates``, ``speeds`` and, in the tree model, ``accelerations`` follow ``parts``. ``joint_forces``
    are those of the absolute model's ideal joints, each on the body further from the crank pivot. ``driver``
    measures minus the torque on the crank and is None without the constraint of a constant-speed drive.
    ``histories`` are those of the contacts, by joint. ``reference`` (bodies, 3) is the start.
    """

    container: exu.SystemContainer
    mbs: exu.MainSystem
    reference: FloatArray
    parts: tuple[Part, ...]
    coordinates: tuple[int, ...]
    speeds: tuple[int, ...]
    accelerations: tuple[int, ...] = ()
    joint_forces: dict[str, int] = field(default_factory=dict)
    driver: int | None = None
    histories: dict[str, int] = field(default_factory=dict)


def build_model(scene: Scene) -> Model:
    """Return the assembled absolute model."""
    container, (position, velocity) = exu.SystemContainer(), checked_start(scene)
    mbs = container.AddSystem()
    bodies = add_bodies(mbs, scene, position, velocity)
    forces: dict[str, int] = {}
    histories: dict[str, int] = {}
    for joint, sides in ends(scene).items():
        if joint in scene.joints_with_clearance:
            histories[joint] = _add_contact(bodies, scene, joint, position, velocity)
        else:
            # The first marker is on the body whose force the sensor is to give.
            markers = [_marker(bodies, *side) for side in sides]
            connector = mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))
            forces[joint] = _force_sensor(mbs, connector)
    driver = None
    if scene.drive.kind == "constant-speed":
        driver = _force_sensor(mbs, _add_speed(mbs, scene, bodies.parts[CRANK].node))
    _add_torque(scene, bodies)
    model = Model(
        container=container,
        mbs=mbs,
        reference=position,
        parts=bodies.parts,
        coordinates=tuple(_node_sensor(mbs, part.node, "Coordinates") for part in bodies.parts),
        speeds=tuple(_node_sensor(mbs, part.node, "Coordinates_t") for part in bodies.parts),
        joint_forces=forces,
        driver=driver,
        histories=histories,
    )
    mbs.Assemble()
    return model


def build_tree_model(scene: Scene) -> Model:
    """Return the assembled tree model of a scene with clearance."""
    container, (position, velocity) = exu.SystemContainer(), checked_start(scene)
    mbs = container.AddSystem()
    flywheel = FLYWHEEL_KG_M2 if scene.drive.kind == "constant-speed" else 0.0
    bodies = add_bodies(mbs, scene, position, velocity, tree_links(scene), flywheel)
    histories = {
        joint: _add_contact(bodies, scene, joint, position, velocity) for joint in scene.joints_with_clearance
    }
    _add_torque(scene, bodies)
    coordinates, speeds, accelerations = (
        tuple(_node_sensor(mbs, part.node, quantity) for part in bodies.parts)
        for quantity in ("Coordinates", "Coordinates_t", "Coordinates_tt")
    )
    model = Model(
        container, mbs, position, bodies.parts, coordinates, speeds, accelerations, histories=histories
    )
    mbs.Assemble()
    return model


def _add_contact(bodies: Bodies, scene: Scene, joint: str, position: FloatArray, velocity: FloatArray) -> Any:
    """Add a joint with clearance; return its history's sensor."""
    pin, bearing = (_marker(bodies, *end) for end in ends(scene)[joint])
    start = joint_gap(scene, joint, position[None], velocity[None])
    history = add_contact(bodies.mbs, pin, bearing, getattr(scene.clearance, joint), start)
    return _node_sensor(bodies.mbs, history, "Coordinates")


def _marker(bodies: Bodies, body: int | None, place_m: float) -> Any:
    if body is not None:
        return bodies.marker(body, place_m)
    ground = bodies.mbs.AddObject(items.ObjectGround())
    return bodies.mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=ground, localPosition=[place_m, 0.0, 0.0]))


def _add_torque(scene: Scene, bodies: Bodies) -> None:
    if scene.drive.kind == "torque":
        torque = [0.0, 0.0, scene.drive.torque_N_m]
        load = items.LoadTorqueVector(markerNumber=bodies.marker(CRANK), loadVector=torque)
        bodies.mbs.AddLoad(load)


def _add_speed(mbs: exu.MainSystem, scene: Scene, crank_node: Any) -> Any:
    """Add and return the constraint that keeps the crank's speed."""
    crank_angle = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=crank_node, coordinate=2))
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

"""Exudyn on its own: planar bodies and joints, and the tree of links with a contact of spheres."""

import time
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from scipy.interpolate import CubicSpline

from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import (
    CRANK_CENTRE_M,
    CRANK_KG,
    CRANK_M,
    GRAVITY,
    ROD_CENTRE_M,
    ROD_KG,
    ROD_M,
    SLIDER_KG,
    Answer,
)

items: Any = itemInterface  # its constructors carry no types
#: Where touch and release are located to, as a penetration.
EVENT_GAP_M = 1e-10
#: The fewest steps of a run whose tolerance decides.
LONGEST = 100
VARIABLES = exu.OutputVariableType


def _settings(end_s: float, steps: int, samples: int) -> Any:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = end_s / samples
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, end_s
    return settings


def _ideal(inertias: tuple[float, float], speed: float, driven: bool) -> tuple[Any, Any, Any]:
    """Return a model of planar bodies and joints, and the sensors of the slider and of the drive's torque."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    turn = -speed * CRANK_M / ROD_M
    links = (
        (CRANK_KG, inertias[0], CRANK_CENTRE_M, CRANK_CENTRE_M * speed, speed),
        (ROD_KG, inertias[1], CRANK_M + ROD_CENTRE_M, CRANK_M * speed + ROD_CENTRE_M * turn, turn),
    )
    nodes, bodies = [], []
    for mass, inertia, x, up, rate in links:
        node = items.NodeRigidBody2D(referenceCoordinates=[x, 0, 0], initialVelocities=[0, up, rate])
        nodes.append(mbs.AddNode(node))
        body = items.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=nodes[-1])
        bodies.append(mbs.AddObject(body))
        at = mbs.AddMarker(items.MarkerBodyMass(bodyNumber=bodies[-1]))
        mbs.AddLoad(items.LoadMassProportional(markerNumber=at, loadVector=[0, -GRAVITY, 0]))
    nodes.append(mbs.AddNode(items.Node1D(referenceCoordinates=[CRANK_M + ROD_M])))
    bodies.append(mbs.AddObject(items.ObjectMass1D(mass=SLIDER_KG, nodeNumber=nodes[-1])))
    crank, rod, slider, ground = *bodies, mbs.AddObject(items.ObjectGround())
    for pin in (
        ((ground, 0.0), (crank, -CRANK_CENTRE_M)),
        ((crank, CRANK_M - CRANK_CENTRE_M), (rod, -ROD_CENTRE_M)),
        ((rod, ROD_M - ROD_CENTRE_M), (slider, 0.0)),
    ):
        sides = [items.MarkerBodyRigid(bodyNumber=body, localPosition=[x, 0, 0]) for body, x in pin]
        mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=[mbs.AddMarker(side) for side in sides]))
    told = [
        items.SensorNode(nodeNumber=nodes[-1], outputVariableType=VARIABLES.Coordinates, storeInternal=True)
    ]
    if driven:
        fixed = mbs.AddNode(items.NodePointGround())
        sides = [
            items.MarkerNodeCoordinate(nodeNumber=n, coordinate=c) for n, c in ((fixed, 0), (nodes[0], 2))
        ]
        drive = items.ObjectConnectorCoordinate(
            markerNumbers=[mbs.AddMarker(side) for side in sides], velocityLevel=True, offset=speed
        )
        drive = mbs.AddObject(drive)
        told.append(
            items.SensorObject(objectNumber=drive, outputVariableType=VARIABLES.Force, storeInternal=True)
        )
    sensors = [mbs.AddSensor(sensor) for sensor in told]
    mbs.Assemble()
    return container, mbs, sensors


def _solved(mbs: Any, settings: Any) -> tuple[float, int]:
    began = time.perf_counter()
    assert mbs.SolveDynamic(settings)
    seconds = time.perf_counter() - began
    return seconds, int(mbs.sys["dynamicSolver"].it.currentStepIndex) - 1  # of the next step


def _trapezoidal(end_s: float, steps: int, samples: int) -> Any:
    settings = _settings(end_s, steps, samples)
    settings.timeIntegration.solverType = exu.DynamicSolverType.TrapezoidalIndex2
    newton = settings.timeIntegration.newton
    newton.useModifiedNewton = newton.modifiedNewtonJacUpdatePerStep = True
    newton.numericalDifferentiation.relativeEpsilon = 1e-8
    return settings


def ideal_free(steps: int, samples: int) -> Answer:
    """Return the slider's position by the trapezoidal rule."""
    _container, mbs, (slider,) = _ideal(problem.FREE_INERTIAS, problem.FREE_SPEED, driven=False)
    done = _solved(mbs, _trapezoidal(problem.FREE_END_S, steps, samples))
    return Answer(*done, CRANK_M + ROD_M + mbs.GetSensorStoredData(slider)[:, 1])


def ideal_driven(steps: int, samples: int) -> Answer:
    """Return the drive's torque by the trapezoidal rule."""
    _container, mbs, (_, drive) = _ideal(problem.DRIVEN_INERTIAS, problem.DRIVEN_SPEED, driven=True)
    done = _solved(mbs, _trapezoidal(problem.DRIVEN_END_S, steps, samples))
    return Answer(*done, -mbs.GetSensorStoredData(drive)[:, 1])


def clearance_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position by DOPRI5, from event to event, with the links as a kinematic tree."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    turn = -problem.FREE_SPEED * CRANK_M / ROD_M
    node = mbs.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0, 0.0],
            initialCoordinates=[0.0, 0.0],
            initialCoordinates_t=[problem.FREE_SPEED, turn - problem.FREE_SPEED],
            numberOfODE2Coordinates=2,
        )
    )
    inertias = [np.diag([0.0, 0.0, inertia]) for inertia in problem.FREE_INERTIAS]
    matrices: Any = exu.Matrix3DList  # their constructors carry no arguments
    vectors: Any = exu.Vector3DList
    tree = mbs.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[exu.JointType.RevoluteZ] * 2,
            linkParents=[-1, 0],
            jointTransformations=matrices([np.eye(3)] * 2),
            jointOffsets=vectors([[0.0, 0.0, 0.0], [CRANK_M, 0.0, 0.0]]),
            linkMasses=[CRANK_KG, ROD_KG],
            linkInertiasCOM=matrices(inertias),
            linkCOMs=vectors([[CRANK_CENTRE_M, 0.0, 0.0], [ROD_CENTRE_M, 0.0, 0.0]]),
            gravity=[0.0, -GRAVITY, 0.0],
        )
    )
    guide = mbs.AddNode(items.Node1D(referenceCoordinates=[CRANK_M + ROD_M]))
    slider = mbs.AddObject(items.ObjectMass1D(mass=SLIDER_KG, nodeNumber=guide))
    pin = items.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=1, localPosition=[ROD_M, 0.0, 0.0])
    ring = items.MarkerBodyRigid(bodyNumber=slider)
    history = items.NodeGenericData(
        initialCoordinates=[problem.CLEARANCE_M, 0.0, 0.0, 0.0], numberOfDataCoordinates=4
    )
    mbs.AddObject(
        items.ObjectContactSphereSphere(
            markerNumbers=[mbs.AddMarker(pin), mbs.AddMarker(ring)],
            nodeNumber=mbs.AddNode(history),
            spheresRadii=[problem.BEARING_M - problem.CLEARANCE_M, problem.BEARING_M],
            isHollowSphere1=True,
            contactStiffness=problem.STIFFNESS,
            contactStiffnessExponent=1.5,
            impactModel=1,
            restitutionCoefficient=(1 + problem.RESTITUTION**2) / 2,
            minimumImpactVelocity=1e-4,
        )
    )
    told = items.SensorNode(nodeNumber=guide, outputVariableType=VARIABLES.Coordinates, storeInternal=True)
    sensor = mbs.AddSensor(told)
    mbs.Assemble()
    settings = _settings(problem.CLEARANCE_END_S, LONGEST, samples)
    settings.solution.sensors.writePeriod = 0.0 if samples > 1 else problem.CLEARANCE_END_S
    integration = settings.timeIntegration
    integration.solverType, integration.minimumStepSize = exu.DynamicSolverType.DOPRI5, 1e-100
    integration.absoluteTolerance, integration.relativeTolerance = tolerance, 0.0
    integration.discontinuous.iterationTolerance = problem.STIFFNESS * EVENT_GAP_M
    integration.stepSizeSafety = 0.9
    integration.explicit.computeEndOfStepAccelerations = False
    done = _solved(mbs, settings)
    rows = mbs.GetSensorStoredData(sensor)
    return Answer(*done, CRANK_M + ROD_M + _at(np.linspace(0.0, problem.CLEARANCE_END_S, samples + 1), rows))


def _at(times: Any, rows: Any) -> Any:
    """Return what a sensor told, between its rows by a cubic spline."""
    rows = rows[np.concatenate([[True], np.diff(rows[:, 0]) > 0])]
    return CubicSpline(rows[:, 0], rows[:, 1])(times) if len(rows) > 4 else rows[:, 1]

"""A prescribed speed in Exudyn: a constraint of the absolute model, and what a flywheel needs in a tree."""

import math
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.exudyn.symbolic import piecewise, symbolic, user_function
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.scene.scene import Scene
from reference_solver.mechanism.curves import curve_of
from reference_solver.mechanism.data import ConstantSpeed, Course, DriveData, Fluctuation, Ramp

items: Any = itemInterface  # its constructors carry no types

#: With this inertia in kg m^2, or this mass in kg, what is driven is changed in its speed by no mechanism's
#: torque or force, not by a rounding.
FLYWHEEL_KG_M2 = HEAVY_KG = 1e15


def add_speed(mbs: exu.MainSystem, scene: Scene, node: Any, coordinate: int) -> Any:
    """Add and return the constraint that keeps the speed of a node's coordinate, which is driven."""
    drive = scene.mechanism.drive
    driven = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
    if isinstance(drive.law, ConstantSpeed):
        ground_node = mbs.AddNode(items.NodePointGround())
        other = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground_node, coordinate=0))
        beside: dict[str, Any] = {"offset": drive.law.speed}
    else:
        other, beside = _add_changing(mbs, scene)
    sides = [other, driven]
    return mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=sides, velocityLevel=True, **beside))


def _add_changing(mbs: exu.MainSystem, scene: Scene) -> tuple[Any, dict[str, Any]]:
    """Add what a changing speed is held against; return its marker, and the speed beside its own.

    It is a heavy mass, pushed by a force. The ground would do, with all of the speed as a function of time
    beside it, which is exact at every step. But Exudyn takes that for a speed without acceleration as it
    computes the accelerations at the start, and the trapezoidal rule keeps that error for ever. So the mass
    has the acceleration of the start at all times, of which no step makes an error. It would also keep an
    error of order one from every kink in the acceleration, and a table has one at every entry: there the
    mass has all of the speed, by a force of time.
    """
    drive, motion, t = scene.mechanism.drive, crank_motion(scene), symbolic.Real("t", 0.0)
    assert motion is not None
    unused = [symbolic.Real(name, 0.0) for name in ("itemNumber", "parameter")]
    beside: dict[str, Any] = {}
    if isinstance(drive.law, Course):
        own_speed, force = motion.start_speed_rad_s, HEAVY_KG * acceleration(drive, t)
        function = user_function(mbs, "LoadCoordinate", "loadUserFunction", [t, *unused[1:]], force)
        push: dict[str, Any] = {"load": 0.0, "loadUserFunction": function}
    else:
        own_speed, begin = 0.0, float(motion.acceleration_rad_s2(np.zeros(1))[0])
        push, rest = {"load": HEAVY_KG * begin}, speed(drive, t) - begin * t
        function = user_function(mbs, "ObjectConnectorCoordinate", "offsetUserFunction_t", [t, *unused], rest)
        beside = {"offsetUserFunction_t": function}
    node = mbs.AddNode(items.Node1D(initialVelocities=[own_speed]))
    mbs.AddObject(items.ObjectMass1D(mass=HEAVY_KG, nodeNumber=node))
    marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    mbs.AddLoad(items.LoadCoordinate(markerNumber=marker, **push))
    return marker, beside


def speed(drive: DriveData, t: Any) -> Any:
    """Return the speed of a ramp or a fluctuation as an expression of the time since the start."""
    law, clock = drive.law, t + drive.clock_s
    if isinstance(law, Ramp):
        x = _share(law, clock)
        return law.first + (law.last - law.first) * (x * x * x * (10 + x * (6 * x - 15)))
    assert isinstance(law, Fluctuation)
    return law.mean + law.amplitude * symbolic.sin(2 * math.pi * law.frequency_Hz * clock + law.phase_rad)


def acceleration(drive: DriveData, t: Any) -> Any:
    """Return the acceleration of a changing speed as an expression of the time, as ``speed`` does."""
    law, clock = drive.law, t + drive.clock_s
    if isinstance(law, Ramp):
        x = _share(law, clock)
        return 30 * (law.last - law.first) / law.duration_s * (x * x * (1 - x) * (1 - x))
    if isinstance(law, Fluctuation):
        rate = 2 * math.pi * law.frequency_Hz
        return law.amplitude * rate * symbolic.cos(rate * clock + law.phase_rad)
    assert isinstance(law, Course)
    return piecewise(clock, curve_of(law.table).derivative(2))


def _share(law: Ramp, clock: Any) -> Any:
    """Return how much of the ramp's time is over, from 0 to 1."""
    return symbolic.min(clock / law.duration_s, symbolic.Real(1.0))

"""The crank's prescribed speed in Exudyn: a constraint of the absolute model, and what a flywheel needs."""

import math
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface

from engine_models.exudyn.motion import Part
from engine_models.exudyn.symbolic import piecewise, symbolic, user_function
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.scene.drives import FluctuatingDrive, RampDrive, TableDrive
from engine_models.scene.scene import Scene

items: Any = itemInterface  # its constructors carry no types

#: With this inertia in kg m^2 at the crank, no torque of a mechanism changes its speed by a rounding; nor
#: does it change the speed of so heavy a mass, in kg.
FLYWHEEL_KG_M2 = HEAVY_KG = 1e15


def add_speed(mbs: exu.MainSystem, scene: Scene, crank: Part) -> Any:
    """Add and return the constraint that keeps the speed of the crank, whose last coordinate is its angle."""
    angle = len(crank.start) - 1
    crank_angle = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=crank.node, coordinate=angle))
    if scene.drive.kind == "constant-speed":
        ground_node = mbs.AddNode(items.NodePointGround())
        other = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground_node, coordinate=0))
        beside: dict[str, Any] = {"offset": scene.start.crank_speed_rad_s}
    else:
        other, beside = _add_changing(mbs, scene)
    sides = [other, crank_angle]
    return mbs.AddObject(items.ObjectConnectorCoordinate(markerNumbers=sides, velocityLevel=True, **beside))


def _add_changing(mbs: exu.MainSystem, scene: Scene) -> tuple[Any, dict[str, Any]]:
    """Add what a crank of changing speed is held against; return its marker, and the speed beside its own.

    It is a heavy mass, pushed by a force. The ground would do, with all of the speed as a function of time
    beside it, which is exact at every step. But Exudyn takes that for a speed without acceleration as it
    computes the accelerations at the start, and the trapezoidal rule keeps that error for ever. So the mass
    has the acceleration of the start at all times, of which no step makes an error. It would also keep an
    error of order one from every kink in the acceleration, and a table has one at every entry: there the
    mass has all of the speed, by a force of time.
    """
    motion, t = crank_motion(scene), symbolic.Real("t", 0.0)
    assert motion is not None
    unused = [symbolic.Real(name, 0.0) for name in ("itemNumber", "parameter")]
    beside: dict[str, Any] = {}
    if isinstance(scene.drive, TableDrive):
        own_speed, force = motion.start_speed_rad_s, HEAVY_KG * acceleration(scene, t)
        function = user_function(mbs, "LoadCoordinate", "loadUserFunction", [t, *unused[1:]], force)
        push: dict[str, Any] = {"load": 0.0, "loadUserFunction": function}
    else:
        own_speed, begin = 0.0, float(motion.acceleration_rad_s2(np.zeros(1))[0])
        push, rest = {"load": HEAVY_KG * begin}, speed(scene, t) - begin * t
        function = user_function(mbs, "ObjectConnectorCoordinate", "offsetUserFunction_t", [t, *unused], rest)
        beside = {"offsetUserFunction_t": function}
    node = mbs.AddNode(items.Node1D(initialVelocities=[own_speed]))
    mbs.AddObject(items.ObjectMass1D(mass=HEAVY_KG, nodeNumber=node))
    marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    mbs.AddLoad(items.LoadCoordinate(markerNumber=marker, **push))
    return marker, beside


def speed(scene: Scene, t: Any) -> Any:
    """Return the speed in rad/s of a ramp or a fluctuation as an expression of the time since the start."""
    drive, clock, own = scene.drive, t + (scene.start.time_s or 0.0), scene.start.crank_speed_rad_s
    if isinstance(drive, RampDrive):
        x = _share(drive, clock)
        return own + (drive.final_speed - own) * (x * x * x * (10 + x * (6 * x - 15)))
    assert isinstance(drive, FluctuatingDrive)
    phase = 2 * math.pi * drive.frequency_Hz * clock + drive.phase_rad
    return own + drive.amplitude * symbolic.sin(phase)


def acceleration(scene: Scene, t: Any) -> Any:
    """Return the crank's angular acceleration in rad/s^2 as an expression of the time, as ``speed`` does."""
    drive, clock, own = scene.drive, t + (scene.start.time_s or 0.0), scene.start.crank_speed_rad_s
    if isinstance(drive, RampDrive):
        x = _share(drive, clock)
        steepness = 30 * (drive.final_speed - own) / drive.ramp_time_s
        return steepness * (x * x * (1 - x) * (1 - x))
    if isinstance(drive, FluctuatingDrive):
        rate = 2 * math.pi * drive.frequency_Hz
        return drive.amplitude * rate * symbolic.cos(rate * clock + drive.phase_rad)
    assert isinstance(drive, TableDrive)
    return piecewise(clock, drive.spline().derivative(2))


def _share(drive: RampDrive, clock: Any) -> Any:
    """Return how much of the ramp's time is over, from 0 to 1."""
    return symbolic.min(clock / drive.ramp_time_s, symbolic.Real(1.0))

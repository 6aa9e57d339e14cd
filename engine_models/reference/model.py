"""The scene as a mechanism of the reference solver: joints O, A, B, then the guide, then a driver."""

import math
import sys
from typing import TYPE_CHECKING

import numpy as np

from engine_models.engine import SimulationFailed
from engine_models.mechanics.contact_law import exponent_of, minimum_impact_speed_of, stiffness_of
from engine_models.mechanics.joints import CRANK, ROD, SLIDER
from engine_models.scene.drives import FluctuatingDrive, MotorDrive, RampDrive, TableDrive, TorqueDrive
from engine_models.scene.scene import Clearance, Friction, Link, Scene
from reference_solver.mechanism import mechanism, motions
from reference_solver.mechanism.contact_laws import DAMPING_FACTORS, ContactLaw, FrictionLaw, RigidWall
from reference_solver.mechanism.tables import PiecewiseCubic

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


def mechanism_of(scene: Scene) -> mechanism.Mechanism:
    """Return the mechanism; a joint with clearance has no rows, and is a contact."""
    joints = _joints(scene)
    return mechanism.Mechanism(
        bodies=tuple(mechanism.Body(part.mass_kg, part.inertia_kg_m2) for part in scene.bodies),
        constraints=(
            *(joint for joint, clearance in joints if clearance is None),
            *(_guide() if scene.is_crank_slider else ()),
            *_driver(scene),
        ),
        loads=tuple(loads_of(scene).values()),
        gravity_m_s2=scene.gravity_m_s2,
        contacts=tuple(_contact(joint, clearance) for joint, clearance in joints if clearance is not None),
    )


def loads_of(scene: Scene) -> dict[str, mechanism.Load]:
    """Return the mechanism's loads in their order: "drive", and the parts of the slider's by their names."""
    drive, loads = scene.drive, dict[str, mechanism.Load]()
    if isinstance(drive, TorqueDrive):
        loads["drive"] = mechanism.Torque(CRANK, drive.torque_N_m)
    elif isinstance(drive, MotorDrive):
        loads["drive"] = mechanism.MotorTorque(CRANK, drive.stall_torque_N_m, drive.no_load_speed_rad_s)
    load, along = scene.load.slider, (SLIDER, 0.0)
    if load is None:
        return loads
    if load.force_N:
        loads["force"] = mechanism.ConstantForce(*along, load.force_N)
    if load.viscous_N_s_m:
        loads["viscous"] = mechanism.LineDamper(*along, load.viscous_N_s_m)
    if load.spring_N_m:
        loads["spring"] = mechanism.LineSpring(*along, load.spring_N_m, load.free_position_m or 0.0)
    if load.gas:
        loads["gas"] = mechanism.GasForce(*along, CRANK, _pieces(load.gas.spline(), 2 * math.pi))
    return loads


def _guide() -> tuple[mechanism.Constraint, ...]:
    """Return the slider's guide, on the x axis: it does not turn."""
    slot = mechanism.Slot(mechanism.GROUND, (0.0, 0.0), SLIDER, (0.0, 0.0), 0.0)
    return slot, mechanism.SameAngle(mechanism.GROUND, SLIDER)


def _driver(scene: Scene) -> tuple[mechanism.Constraint, ...]:
    """Return the driver of a prescribed speed, by the time since the run's start."""
    drive, speed, clock = scene.drive, scene.start.crank_speed_rad_s, scene.start.time_s or 0.0
    motion: motions.Motion
    if isinstance(drive, RampDrive):
        motion = motions.Ramp(speed, drive.final_speed_rad_s, drive.ramp_time_s, -clock)
    elif isinstance(drive, FluctuatingDrive):
        rate = 2 * math.pi * drive.frequency_Hz
        phase = math.remainder(drive.phase_rad + rate * clock, 2 * math.pi)
        motion = motions.Fluctuation(speed, drive.amplitude_rad_s, rate, phase)
    elif isinstance(drive, TableDrive):
        spline = drive.spline()
        motion = motions.Course(_pieces(spline, x=-clock, y=-float(spline(clock))))
    else:
        constant = scene.speed_is_prescribed
        return (mechanism.PrescribedSpeed(CRANK, speed),) if constant else ()
    return (mechanism.PrescribedMotion(CRANK, motion),)


def _pieces(spline: "CubicSpline", period: float = 0.0, x: float = 0.0, y: float = 0.0) -> PiecewiseCubic:
    """Return a cubic spline moved by x and y."""
    rows = np.column_stack([spline.x[:-1] + x, spline.c[::-1].T])
    rows[:, 1] += y
    return PiecewiseCubic(tuple(rows.ravel().tolist()), period)


def _joints(scene: Scene) -> list[tuple[mechanism.RevoluteJoint, Clearance | None]]:
    """Return the joints O, A, B with their clearances; a bearing is on the body nearer the crank pivot."""

    def pins(link: Link) -> tuple[mechanism.Point, mechanism.Point]:
        return (-link.centre_of_mass_m, 0.0), (link.length_m - link.centre_of_mass_m, 0.0)

    crank_O, crank_A = pins(scene.crank)
    pivot = (mechanism.RevoluteJoint(mechanism.GROUND, (0.0, 0.0), CRANK, crank_O), scene.clearance.O)
    if scene.rod is None:
        return [pivot]
    rod_A, rod_B = pins(scene.rod)
    return [
        pivot,
        (mechanism.RevoluteJoint(CRANK, crank_A, ROD, rod_A), scene.clearance.A),
        (mechanism.RevoluteJoint(ROD, rod_B, SLIDER, (0.0, 0.0)), scene.clearance.B),
    ]


def _contact(joint: mechanism.RevoluteJoint, clearance: Clearance) -> mechanism.ClearanceJoint:
    return mechanism.ClearanceJoint(
        joint.body_i,
        joint.point_i,
        joint.body_j,
        joint.point_j,
        clearance.radial_clearance_m,
        clearance.bearing_radius_m,
        _law(clearance),
        _friction(clearance.friction),
    )


def _law(clearance: Clearance) -> ContactLaw | RigidWall:
    if clearance.law == "rigid":
        return RigidWall(clearance.restitution or 0.0, clearance.minimum_impact_speed_m_s or 0.0)
    factor, stiffness = DAMPING_FACTORS.get(clearance.law), stiffness_of(clearance)
    if not math.isfinite(stiffness):
        field = (
            "young_modulus_Pa" if clearance.radial_clearance_m > sys.float_info.min else "radial_clearance_m"
        )
        expected, value = "one whose stiffness is no overflow", getattr(clearance, field)
        raise SimulationFailed(f"{field}: expected {expected}, got {value:g}")
    return ContactLaw(
        stiffness,
        exponent_of(clearance),
        0.0 if factor is None or clearance.restitution is None else factor(clearance.restitution),
        clearance.damping_N_s_m or 0.0,
        minimum_impact_speed_of(clearance),
        clearance.may_pull,
    )


def _friction(friction: Friction | None) -> FrictionLaw | None:
    if friction is None:
        return None
    dead_band = friction.dead_band_speed_m_s or 0.0
    return FrictionLaw(friction.law, friction.coefficient, friction.regularisation_speed_m_s, dead_band)

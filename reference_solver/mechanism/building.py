"""The mechanism that the equations are of, from its data by names: pins, then guides, then the driver."""

import math
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from reference_solver.mechanism import data, mechanism, motions
from reference_solver.mechanism.contact_laws import (
    NORMAL_LAWS,
    ContactLaw,
    FrictionLaw,
    RigidWall,
    damping_factor_of,
    exponent_of,
    minimum_impact_speed_of,
    stiffness_of,
)
from reference_solver.mechanism.curves import curve_of
from reference_solver.mechanism.data import MechanismData
from reference_solver.mechanism.tables import PiecewiseCubic

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

TURN = 2 * math.pi


def mechanism_of(of: MechanismData) -> mechanism.Mechanism:
    """Return the mechanism; a joint with clearance has no rows, and is a contact.

    Raises:
        ValueError: the stiffness of a contact overflows.
    """
    named = [*_constraints(of)]
    x, y = of.gravity_m_s2
    return mechanism.Mechanism(
        bodies=tuple(mechanism.Body(body.mass_kg, body.inertia_kg_m2) for body in of.bodies),
        constraints=tuple(constraint for _, constraint in named),
        loads=tuple(loads_of(of).values()),
        gravity_m_s2=-y,
        contacts=tuple(_contact(pin, pin.clearance) for pin in of.pins if pin.clearance is not None),
        gravity_x_m_s2=x,
        names=tuple(name for name, _ in named),
    )


def _constraints(of: MechanismData) -> Iterator[tuple[str, mechanism.Constraint]]:
    """Yield the constraints in the order of their rows, with the names of their joints."""
    for pin in of.ideal:
        yield pin.name, mechanism.RevoluteJoint(pin.body_i, pin.point_i, pin.body_j, pin.point_j)
    for guide in of.guides:
        ends = guide.body_i, guide.point_i, guide.body_j, guide.point_j
        yield guide.name, mechanism.Slot(*ends, guide.angle_rad)
        if not guide.turns:
            yield guide.name, mechanism.SameAngle(guide.body_i, guide.body_j)
    if (driver := _driver(of)) is not None:
        yield "drive", driver


def _driver(of: MechanismData) -> mechanism.Constraint | None:
    """Return the driver of a prescribed motion, by the time since the run's start."""
    drive = of.drive
    if not drive.prescribes:
        return None
    if isinstance(drive.law, data.ConstantSpeed) and drive.guide is None:
        return mechanism.PrescribedSpeed(drive.body, drive.law.speed)
    motion = motion_of(drive)
    assert motion is not None
    if drive.guide is None:
        return mechanism.PrescribedMotion(drive.body, motion)
    line = of.guides[drive.guide]
    ends = line.body_i, line.point_i, line.body_j, line.point_j
    return mechanism.PrescribedSlide(*ends, line.angle_rad, motion)


def motion_of(drive: data.DriveData) -> motions.Motion | None:
    """Return the motion that a drive prescribes, by the time since the run's start; None of a torque."""
    law, clock = drive.law, drive.clock_s
    match law:
        case data.ConstantSpeed():
            return motions.Steady(law.speed)
        case data.Ramp():
            return motions.Ramp(law.first, law.last, law.duration_s, -clock)
        case data.Fluctuation():
            rate = TURN * law.frequency_Hz
            phase = math.remainder(law.phase_rad + rate * clock, TURN)
            return motions.Fluctuation(law.mean, law.amplitude, rate, phase)
        case data.Course():
            curve = curve_of(law.table)
            return motions.Course(pieces_of(curve, x=-clock, y=-float(curve(clock))))
    return None


def loads_of(of: MechanismData) -> dict[str, mechanism.Load]:
    """Return the loads in their order: "drive", "BODY.force" and the other parts, "spring:NAME"."""
    loads, clock = dict[str, mechanism.Load](), of.drive.clock_s
    if (drive := _torque(of.drive)) is not None:
        loads["drive"] = drive
    for load in of.loads:
        parts = {**dict(_forces(load, clock)), **dict(_torques(load, clock))}
        loads |= {f"{of.bodies[load.body].name}.{part}": own for part, own in parts.items()}
    for spring in of.springs:
        ends = spring.body_i, spring.point_i, spring.body_j, spring.point_j
        numbers = spring.stiffness_N_m, spring.damping_N_s_m, spring.free_length_m
        loads[f"spring:{spring.name}"] = mechanism.SpringDamper(*ends, *numbers)
    return loads


def _torque(drive: data.DriveData) -> mechanism.Load | None:
    law, body = drive.law, drive.body
    if isinstance(law, data.Torque):
        if isinstance(law.torque_N_m, data.Table):
            return mechanism.TorqueByTime(body, pieces_of(curve_of(law.torque_N_m), x=-drive.clock_s))
        return mechanism.Torque(body, law.torque_N_m)
    if isinstance(law, data.Motor):
        if law.table is not None:
            return mechanism.TorqueBySpeed(body, _held(pieces_of(curve_of(law.table)), law.table))
        return mechanism.MotorTorque(body, law.stall_torque_N_m, law.no_load_speed_rad_s)
    return None


def _held(table: PiecewiseCubic, of: data.Table) -> PiecewiseCubic:
    """Return a table with its end values beyond its ends."""
    before = (of.x[0] - (of.x[-1] - of.x[0]), of.y[0], 0.0, 0.0, 0.0)
    beyond = (of.x[-1], of.y[-1], 0.0, 0.0, 0.0)
    return PiecewiseCubic((*before, *table.rows, *beyond))


def _forces(load: data.Load, clock: float) -> Iterator[tuple[str, mechanism.Load]]:
    """Yield the forces along a load's line by their names."""
    line = load.line
    if line is None:
        return
    along = line.body_i, line.point_i, line.body_j, line.point_j, line.angle_rad
    if load.force_N:
        yield "force", mechanism.ConstantForce(*along, load.force_N)
    if load.viscous_N_s_m:
        yield "viscous", mechanism.LineDamper(*along, load.viscous_N_s_m)
    if load.spring_N_m:
        yield "spring", mechanism.LineSpring(*along, load.spring_N_m, load.free_position_m)
    if load.gas is not None:
        table = load.gas.table
        yield "gas", mechanism.GasForce(*along, load.gas.body, pieces_of(curve_of(table), table.period))
    if load.force_by_time is not None:
        yield "by_time", mechanism.ForceByTime(*along, pieces_of(curve_of(load.force_by_time), x=-clock))


def _torques(load: data.Load, clock: float) -> Iterator[tuple[str, mechanism.Load]]:
    """Yield the torques of a load by their names."""
    if load.torque_N_m:
        yield "torque", mechanism.Torque(load.body, load.torque_N_m)
    if load.viscous_N_m_s:
        yield "turning_viscous", mechanism.TurningDamper(load.body, load.viscous_N_m_s)
    if load.torque_by_time is not None:
        table = pieces_of(curve_of(load.torque_by_time), x=-clock)
        yield "torque_by_time", mechanism.TorqueByTime(load.body, table)


def pieces_of(curve: "PPoly", period: float = 0.0, x: float = 0.0, y: float = 0.0) -> PiecewiseCubic:
    """Return a curve's pieces moved by x and y."""
    rows = np.column_stack([curve.x[:-1] + x, curve.c[::-1].T])
    rows[:, 1] += y
    return PiecewiseCubic(tuple(rows.ravel().tolist()), period)


def _contact(pin: data.Pin, room: data.ClearanceData) -> mechanism.ClearanceJoint:
    bearing, own = (pin.body_i, pin.point_i), (pin.body_j, pin.point_j)
    ends = (*own, *bearing) if pin.bearing_on_j else (*bearing, *own)
    law, friction = _law(room), _friction(room.friction)
    return mechanism.ClearanceJoint(*ends, room.radial_clearance_m, room.bearing_radius_m, law, friction)


def _law(room: data.ClearanceData) -> ContactLaw | RigidWall:
    if room.law == "rigid":
        return RigidWall(room.restitution or 0.0, room.minimum_impact_speed_m_s or 0.0)
    stiffness = stiffness_of(room)
    if not math.isfinite(stiffness):
        field = "young_modulus_Pa" if room.radial_clearance_m > sys.float_info.min else "radial_clearance_m"
        expected, value = "one whose stiffness is no overflow", getattr(room, field)
        raise OverflowError(f"{field}: expected {expected}, got {value:g}")
    return ContactLaw(
        stiffness,
        exponent_of(room),
        damping_factor_of(room),
        room.damping_N_s_m or 0.0,
        minimum_impact_speed_of(room),
        room.may_pull,
        room.law if room.law in NORMAL_LAWS else "dissipative",
    )


def _friction(friction: data.FrictionData | None) -> FrictionLaw | None:
    if friction is None:
        return None
    dead_band = friction.dead_band_speed_m_s or 0.0
    return FrictionLaw(friction.law, friction.coefficient, friction.regularisation_speed_m_s, dead_band)

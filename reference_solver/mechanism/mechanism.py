"""A planar mechanism as the equations have it: its parts in the order of their rows and forces.

Coordinates q stack (x, y, phi) of every body's centre of mass.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from reference_solver.mechanism import data
from reference_solver.mechanism.constraints import Constraint, Driver, PrescribedMotion, PrescribedSlide
from reference_solver.mechanism.contacts import ClearanceJoint, joint_of
from reference_solver.mechanism.data import Body, DriveData, MechanismData
from reference_solver.mechanism.loads import (
    ConstantForce,
    ForceByTime,
    GasForce,
    LineDamper,
    LineSpring,
    Load,
    MotorTorque,
    Torque,
    TorqueBySpeed,
    TorqueByTime,
    TurningDamper,
)
from reference_solver.mechanism.motions import (
    PiecewiseCubic,
    curve_of,
    going_on,
    has_knots,
    knots_s,
    pieces_of,
)
from reference_solver.tape import Array, array

#: The least mass of a body beside the heaviest one.
LIGHTEST = 1e-11


@dataclass(frozen=True)
class Mechanism:
    """Bodies, constraints in the order of their rows in [B], loads, gravity along -y and x, and contacts."""

    bodies: tuple[Body, ...]
    constraints: tuple[Constraint, ...]
    loads: tuple[Load, ...] = ()
    gravity_m_s2: float = 0.0
    contacts: tuple[ClearanceJoint, ...] = ()
    gravity_x_m_s2: float = 0.0

    @property
    def masses(self) -> Array:
        """The diagonal (n,) of [M]."""
        return array([m for body in self.bodies for m in (body.mass_kg, body.mass_kg, body.inertia_kg_m2)])

    @property
    def prescribed(self) -> tuple[data.Motion, ...]:
        """The prescribed motions."""
        return tuple(c.motion for c in self.constraints if isinstance(c, Driver))

    @property
    def by_time(self) -> tuple[PiecewiseCubic, ...]:
        """The functions of loads that go by the time."""
        forces = tuple(load.force_N for load in self.loads if isinstance(load, ForceByTime))
        return forces + tuple(load.torque_N_m for load in self.loads if isinstance(load, TorqueByTime))

    @property
    def has_knots(self) -> bool:
        """Whether motions or loads may have times for steps to land on."""
        return bool(self.by_time) or any(map(has_knots, self.prescribed))

    def knots_s(self, longest_step_s: float) -> list[float]:
        """Return times, rising, for steps to land on: where motions and loads are not smooth, or quick."""
        motions = {t for motion in self.prescribed for t in knots_s(motion, longest_step_s)}
        return sorted(motions | {t for table in self.by_time for t in table.knots})

    @property
    def knots_by_angle(self) -> tuple[tuple[float, float, int, int], ...]:
        """Angles in rad at which loads are not smooth: see ``run.KNOT_RECORD``."""
        return tuple(
            (x, load.force_N.period, 3 * load.crank + 2, int(load.force_N.straight))
            for load in self.loads
            if isinstance(load, GasForce)
            for x in load.force_N.knots
        )

    def name_of(self, constraint: int) -> str:
        """Return the name of a constraint, or its kind with its number."""
        part = self.constraints[constraint]
        return getattr(part, "name", "") or f"{type(part).__name__} {constraint}"


def mechanism_of(of: MechanismData) -> Mechanism:
    """Return the mechanism: rows of pins, then guides, then the driver; pins with clearance are contacts.

    Raises:
        OverflowError: the stiffness of a contact is none.
    """
    (x, y), driver = of.gravity_m_s2, driver_of(of)
    return Mechanism(
        of.bodies,
        (*of.ideal, *of.guides, *([] if driver is None else [driver])),
        tuple(loads_of(of).values()),
        -y,
        tuple(joint_of(pin) for pin in of.loose),
        x,
    )


def driver_of(of: MechanismData) -> Driver | None:
    """Return the driver of a prescribed motion, by the time since the run's start."""
    law, guide = of.drive.law, of.drive.guide
    if not isinstance(law, data.Motion):
        return None
    motion = going_on(law, of.drive.clock_s)
    if guide is None:
        return PrescribedMotion(of.drive.body, motion)
    return PrescribedSlide(*along(of.guides[guide]), motion)


def loads_of(of: MechanismData) -> dict[str, Load]:
    """Return the loads in their order: "drive", "BODY.force" and the other parts, "spring:NAME"."""
    loads = dict(_torque(of.drive))
    for load in of.loads:
        loads |= {
            f"{of.bodies[load.body].name}.{part}": each for part, each in _parts(load, of.drive.clock_s)
        }
    return loads | {f"spring:{spring.name}": spring for spring in of.springs}


def _torque(drive: DriveData) -> Iterator[tuple[str, Load]]:
    match drive.law:
        case data.Torque(data.Table() as table):
            yield "drive", TorqueByTime(drive.body, _by_time(table, drive.clock_s))
        case data.Torque(float() | int() as torque):
            yield "drive", Torque(drive.body, torque)
        case data.Motor(table=data.Table() as table):
            yield "drive", TorqueBySpeed(drive.body, _held(table))
        case data.Motor(stall, speed):
            yield "drive", MotorTorque(drive.body, stall, speed)


def _parts(load: data.Load, clock_s: float) -> Iterator[tuple[str, Load]]:
    """Yield the parts of a load by their names."""
    if load.line is not None:
        line = along(load.line)
        if load.force_N:
            yield "force", ConstantForce(*line, load.force_N)
        if load.viscous_N_s_m:
            yield "viscous", LineDamper(*line, load.viscous_N_s_m)
        if load.spring_N_m:
            yield "spring", LineSpring(*line, load.spring_N_m, load.free_position_m)
        if load.gas is not None:
            table = load.gas.table
            yield "gas", GasForce(*line, load.gas.body, pieces_of(curve_of(table), table.period))
        if load.force_by_time is not None:
            yield "by_time", ForceByTime(*line, _by_time(load.force_by_time, clock_s))
    if load.torque_N_m:
        yield "torque", Torque(load.body, load.torque_N_m)
    if load.viscous_N_m_s:
        yield "turning_viscous", TurningDamper(load.body, load.viscous_N_m_s)
    if load.torque_by_time is not None:
        yield "torque_by_time", TorqueByTime(load.body, _by_time(load.torque_by_time, clock_s))


def along(line: data.Line) -> tuple[int, data.Point, int, data.Point, float]:
    """Return the fields of a line, of which drivers and loads along it are made."""
    return line.body_i, line.point_i, line.body_j, line.point_j, line.angle_rad


def _by_time(table: data.Table, clock_s: float) -> PiecewiseCubic:
    return pieces_of(curve_of(table), x=-clock_s)


def _held(table: data.Table) -> PiecewiseCubic:
    """Return a table with its end values beyond its ends."""
    before = (table.x[0] - (table.x[-1] - table.x[0]), table.y[0], 0.0, 0.0, 0.0)
    beyond = (table.x[-1], table.y[-1], 0.0, 0.0, 0.0)
    return PiecewiseCubic((*before, *pieces_of(curve_of(table)).rows, *beyond))


def light(bodies: Sequence[Body]) -> str | None:
    """Return in words which body is too light for the arithmetic beside the heaviest one, if one is."""
    least, most = (choose(bodies, key=lambda body: body.mass_kg) for choose in (min, max))
    if least.mass_kg >= LIGHTEST * most.mass_kg:
        return None
    limit, name = LIGHTEST * most.mass_kg, least.name or "one"
    return f"expected bodies of at least {limit:.3g} kg beside one of {most.mass_kg:g} kg, got {name} of " + (
        f"{least.mass_kg:g} kg: what moves it is lost in rounding"
    )

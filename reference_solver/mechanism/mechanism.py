"""A planar mechanism as the equations have it: its parts in the order of their rows and forces.

Coordinates q stack (x, y, phi) of every body's centre of mass.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from reference_solver.mechanism import data, loads
from reference_solver.mechanism.constraints import Constraint, Driver, PrescribedMotion, PrescribedSlide
from reference_solver.mechanism.contacts import ClearanceJoint, joint_of
from reference_solver.mechanism.data import Body, MechanismData
from reference_solver.mechanism.loads import ByAngle, ByTime, Force, Load, Torque
from reference_solver.mechanism.motions import PiecewiseCubic, curve_of, going_on, knots_s, pieces_of
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
    def forces(self) -> tuple[Force | Torque, ...]:
        """The loads that are no springs between two points."""
        return tuple(load for load in self.loads if not isinstance(load, data.Spring))

    def knots_s(self, longest_step_s: float = 0.0) -> list[float]:
        """Return times, rising, for steps to land on: where motions and loads are not smooth, or quick."""
        tables = [load.law.table for load in self.forces if isinstance(load.law, ByTime)]
        motions = {t for motion in self.prescribed for t in knots_s(motion, longest_step_s)}
        return sorted(motions | {t for table in tables for t in table.knots})

    @property
    def knots_by_angle(self) -> tuple[tuple[float, float, int], ...]:
        """Angles in rad at which loads are not smooth: see ``run.KNOT_RECORD``."""
        laws = [load.law for load in self.forces if isinstance(load.law, ByAngle)]
        return tuple((x, law.table.period, 3 * law.crank + 2) for law in laws for x in law.table.knots)

    def name_of(self, constraint: int) -> str:
        """Return the name of a constraint, or its kind with its number."""
        part = self.constraints[constraint]
        return getattr(part, "name", "") or f"{type(part).__name__} {constraint}"


def mechanism_of(of: MechanismData) -> Mechanism:
    """Return the mechanism: rows of pins, then guides, then the driver; pins with clearance are contacts.

    Raises:
        OverflowError: the stiffness of a contact is none.
    """
    (x, y), law, guide, driver = of.gravity_m_s2, of.drive.law, of.drive.guide, list[Driver]()
    if isinstance(law, data.Motion):
        motion = going_on(law, of.drive.clock_s)  # by the time since the run's start
        if guide is None:
            driver = [PrescribedMotion(of.drive.body, motion)]
        else:
            driver = [PrescribedSlide(*along(of.guides[guide]), motion)]
    parts, contacts = tuple(loads_of(of).values()), tuple(joint_of(pin) for pin in of.loose)
    return Mechanism(of.bodies, (*of.ideal, *of.guides, *driver), parts, -y, contacts, x)


def loads_of(of: MechanismData) -> dict[str, Load]:
    """Return the loads: "drive", "BODY.PART", "spring:NAME", "torsion:NAME.spring" and its damper beside."""
    drive, clock_s, by_name = of.drive, of.drive.clock_s, dict[str, Load]()
    match drive.law:
        case data.Torque(data.Table() as table):
            by_name["drive"] = Torque(drive.body, _by_time(table, clock_s))
        case data.Torque(float() | int() as torque):
            by_name["drive"] = Torque(drive.body, loads.Constant(torque))
        case data.Motor(table=data.Table() as table):  # with its end values beyond its ends
            before = (table.x[0] - (table.x[-1] - table.x[0]), table.y[0], 0.0, 0.0, 0.0)
            rows = *before, *pieces_of(curve_of(table)).rows, table.x[-1], table.y[-1], 0.0, 0.0, 0.0
            by_name["drive"] = Torque(drive.body, loads.BySpeed(PiecewiseCubic(rows)))
        case data.Motor() as motor:
            by_name["drive"] = Torque(drive.body, motor)
    for load in of.loads:
        gas, line, name = load.gas, load.line, of.bodies[load.body].name
        forces = {
            "force": loads.Constant(load.force_N) if load.force_N else None,
            "viscous": loads.Damping(load.viscous_N_s_m) if load.viscous_N_s_m else None,
            "spring": loads.Restoring(load.spring_N_m, load.free_position_m) if load.spring_N_m else None,
            "gas": ByAngle(pieces_of(curve_of(gas.table), gas.table.period), gas.body) if gas else None,
            "by_time": _by_time(load.force_by_time, clock_s) if load.force_by_time else None,
        }
        torques = {
            "torque": loads.Constant(load.torque_N_m) if load.torque_N_m else None,
            "turning_viscous": loads.Damping(load.viscous_N_m_s) if load.viscous_N_m_s else None,
            "torque_by_time": _by_time(load.torque_by_time, clock_s) if load.torque_by_time else None,
        }
        if line is not None:
            by_name |= {f"{name}.{part}": Force(*along(line), law) for part, law in forces.items() if law}
        by_name |= {f"{name}.{part}": Torque(load.body, law) for part, law in torques.items() if law}
    by_name |= {f"spring:{spring.name}": spring for spring in of.springs}
    for it in of.torsions:
        spring = loads.Restoring(it.stiffness_N_m_rad, it.free_angle_rad)
        by_name[f"torsion:{it.name}.spring"] = Torque(it.body_j, spring, it.body_i)
        if it.damping_N_m_s:
            by_name[f"torsion:{it.name}"] = Torque(it.body_j, loads.Damping(it.damping_N_m_s), it.body_i)
    return by_name


def along(line: data.Line) -> tuple[int, data.Point, int, data.Point, float]:
    """Return the fields of a line, of which drivers and loads along it are made."""
    return line.body_i, line.point_i, line.body_j, line.point_j, line.angle_rad


def _by_time(table: data.Table, clock_s: float) -> ByTime:
    return ByTime(pieces_of(curve_of(table), x=-clock_s))


def light(bodies: Sequence[Body]) -> str | None:
    """Return in words which body is too light for the arithmetic beside the heaviest one, if one is."""
    least, most = (choose(bodies, key=lambda body: body.mass_kg) for choose in (min, max))
    if least.mass_kg >= LIGHTEST * most.mass_kg:
        return None
    limit, name = LIGHTEST * most.mass_kg, least.name or "one"
    return f"expected bodies of at least {limit:.3g} kg beside one of {most.mass_kg:g} kg, got {name} of " + (
        f"{least.mass_kg:g} kg: what moves it is lost in rounding"
    )

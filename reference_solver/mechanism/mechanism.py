"""A planar mechanism as data: bodies, revolute joints, guides, drivers and loads.

Coordinates q stack (x, y, phi) of every body's centre of mass. Points are given in the frame of their body,
whose origin is the centre of mass; points on GROUND are in the global frame. A body is named by its index.
"""

from dataclasses import dataclass, field
from numbers import Integral

from reference_solver.checks import POSITIVE, require, require_below, require_finite, require_positive
from reference_solver.mechanism.contact_laws import ContactLaw, FrictionLaw, RigidWall
from reference_solver.mechanism.data import GROUND as GROUND
from reference_solver.mechanism.data import Point as Point
from reference_solver.mechanism.motions import Motion
from reference_solver.mechanism.tables import PiecewiseCubic


@dataclass(frozen=True)
class Body:
    """A rigid body; inertia in kg m^2 about the centre of mass."""

    mass_kg: float
    inertia_kg_m2: float

    def __post_init__(self) -> None:
        require_positive(self, "mass_kg", "inertia_kg_m2")


@dataclass(frozen=True)
class Ends:
    """What lies between two points: one of body i and one of body j."""

    body_i: int
    point_i: Point
    body_j: int
    point_j: Point


@dataclass(frozen=True)
class RevoluteJoint(Ends):
    """Two rows of [B]: a point of body j stays on a point of body i.

    g = p_j - p_i in m, of these points in the global frame. The multipliers are the force in N on body j.
    """


@dataclass(frozen=True)
class Slot(Ends):
    """One row of [B]: a point of body j stays on a line of body i, its guide.

    The line passes through the point of body i at ``angle_rad`` from the body's x axis. g = n.(p_j - p_i) in
    m, with n 90 degrees counter-clockwise of the line. The multiplier is the force in N on body j along n.
    """

    angle_rad: float


@dataclass(frozen=True)
class SameAngle:
    """One row of [B]: body j turns as body i does, as a slider does on a straight guide of body i.

    g = phi_j - phi_j(0) - (phi_i - phi_i(0)) in rad. The multiplier is the moment in N m on body j.
    """

    body_i: int
    body_j: int


@dataclass(frozen=True)
class PrescribedSpeed:
    """One row of [B]: the body turns at a constant speed.

    g = phi - phi(0) - speed t in rad. The multiplier is the torque in N m on the body.
    """

    body: int
    speed_rad_s: float


@dataclass(frozen=True)
class PrescribedMotion:
    """One row of [B]: the body turns as a function of time says.

    g = phi - phi(0) - (the angle turned since t = 0) in rad. The multiplier is the torque in N m on the body.
    """

    body: int
    motion: Motion


@dataclass(frozen=True)
class PrescribedSlide(Ends):
    """One row of [B]: a point of body j moves along a line of body i as a function of time says.

    The line is that of ``AlongLine``, and so is s: g = s - s(0) - (the way since t = 0) in m. Nothing keeps
    the point on the line. The multiplier is the driver's force in N on body j along the line.
    """

    angle_rad: float
    motion: Motion


@dataclass(frozen=True)
class MasslessLink(Ends):
    """One row of [B]: two points keep their distance, as a pin that follows the wall of its bearing.

    g = (d.d - length^2)/2 in m^2, with d from the point of body i to that of body j. The force on body j is
    lambda d, lambda in N/m: the link pushes the points together while lambda < 0.
    """

    length_m: float

    def __post_init__(self) -> None:
        length = self.length_m
        require("MasslessLink.length_m", length, 0 < length < float("inf"), POSITIVE)  # a tape's value, too


@dataclass(frozen=True)
class Torque:
    """A constant torque on a body, counter-clockwise positive."""

    body: int
    torque_N_m: float


@dataclass(frozen=True)
class MotorTorque:
    """A torque on a body that falls with its speed: stall torque (1 - speed/no-load speed)."""

    body: int
    stall_torque_N_m: float
    no_load_speed_rad_s: float

    def __post_init__(self) -> None:
        speed = self.no_load_speed_rad_s
        require("MotorTorque.no_load_speed_rad_s", speed, speed != 0, "a finite number other than 0")


@dataclass(frozen=True)
class TurningDamper:
    """A damper of a body's turning: a torque of -c phi'."""

    body: int
    damping_N_m_s: float


@dataclass(frozen=True)
class TorqueByTime:
    """A torque on a body by the time in s since the run's start, of a function without jumps."""

    body: int
    torque_N_m: PiecewiseCubic

    def __post_init__(self) -> None:
        require_once("TorqueByTime.torque_N_m", self.torque_N_m)


@dataclass(frozen=True)
class TorqueBySpeed:
    """A torque on a body by its speed in rad/s, as a motor's table has it.

    No step is cut where the function has a kink: there RK4 and error control lose their order for a step.
    """

    body: int
    torque_N_m: PiecewiseCubic

    def __post_init__(self) -> None:
        require_once("TorqueBySpeed.torque_N_m", self.torque_N_m)


@dataclass(frozen=True)
class AlongLine(Ends):
    """What acts on a point of body j along a line of body i, a guide's, and turns with it.

    The line passes through the point of body i at ``angle_rad`` from the body's x axis, with u along it:
    s = u.(p_j - p_i). A force F is F u on body j at p_j, and on body i, at the place of p_j, -F u.
    """

    angle_rad: float


@dataclass(frozen=True)
class ConstantForce(AlongLine):
    """A constant force."""

    force_N: float


@dataclass(frozen=True)
class ForceByTime(AlongLine):
    """A force by the time in s since the run's start, of a function without jumps."""

    force_N: PiecewiseCubic

    def __post_init__(self) -> None:
        require_once("ForceByTime.force_N", self.force_N)


@dataclass(frozen=True)
class LineSpring(AlongLine):
    """A spring that pulls the point to s = ``free_position_m``."""

    stiffness_N_m: float
    free_position_m: float


@dataclass(frozen=True)
class LineDamper(AlongLine):
    """A damper of s: viscous friction of a guide."""

    damping_N_s_m: float


@dataclass(frozen=True)
class GasForce(AlongLine):
    """A force that goes by the angle of another body, the crank of a cylinder."""

    crank: int
    force_N: PiecewiseCubic


@dataclass(frozen=True)
class SpringDamper(Ends):
    """A linear spring and damper between two points; tension is positive in the formula of its force.

    The force along the line is k (l - free length) + c l', pulling the points together.
    """

    stiffness_N_m: float
    damping_N_s_m: float
    free_length_m: float


@dataclass(frozen=True)
class ClearanceJoint(Ends):
    """A pin of body j at ``point_j`` in a bearing of body i at ``point_i``, of ``bearing_radius_m`` R_i.

    Its law says how the bearing's wall answers: it gives, and is a contact, or it is rigid. A pin that
    follows a rigid wall has one row of [B], g = (d.d - c^2)/2 in m^2, that of a ``MasslessLink`` as long as
    the radial clearance c. Friction on a rigid wall holds as it is while the pin follows it; in impacts,
    which are over at once and leave no speed to regularise, its coefficient is Coulomb's.
    """

    radial_clearance_m: float
    bearing_radius_m: float
    law: ContactLaw | RigidWall
    friction: FrictionLaw | None = None

    def __post_init__(self) -> None:
        require_positive(self, "bearing_radius_m", "radial_clearance_m")
        require_below(self, "radial_clearance_m", "bearing_radius_m")

    @property
    def rigid(self) -> bool:
        """Whether the wall is rigid."""
        return isinstance(self.law, RigidWall)

    @property
    def compliance(self) -> ContactLaw:
        """Return the law of a wall that gives."""
        assert isinstance(self.law, ContactLaw)
        return self.law

    @property
    def wall(self) -> RigidWall:
        """Return the law of a rigid wall."""
        assert isinstance(self.law, RigidWall)
        return self.law


def require_once(name: str, table: PiecewiseCubic) -> None:
    """Raise ValueError for a table that repeats: where it begins anew no step would end."""
    require(f"{name}.period", table.period, table.period == 0, "0")


Constraint = (
    RevoluteJoint | Slot | SameAngle | PrescribedSpeed | PrescribedMotion | PrescribedSlide | MasslessLink
)
Load = (
    Torque
    | MotorTorque
    | TurningDamper
    | TorqueByTime
    | TorqueBySpeed
    | SpringDamper
    | ConstantForce
    | ForceByTime
    | LineSpring
    | LineDamper
    | GasForce
)


@dataclass(frozen=True)
class Mechanism:
    """Bodies, constraints in the order of their rows in [B], loads, gravity along -y and x, and contacts.

    ``names``, those of all constraints in order or none, are for messages.
    """

    bodies: tuple[Body, ...]
    constraints: tuple[Constraint, ...]
    loads: tuple[Load, ...] = ()
    gravity_m_s2: float = 0.0
    contacts: tuple[ClearanceJoint, ...] = ()
    gravity_x_m_s2: float = 0.0
    names: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if not self.bodies:
            raise ValueError("bodies: expected at least one body, got none")
        require_finite("gravity_m_s2", self.gravity_m_s2)
        require_finite("gravity_x_m_s2", self.gravity_x_m_s2)
        named, rows = len(self.names), len(self.constraints)
        require("names", named, named in (0, rows), f"as many as there are constraints ({rows}) or none")
        for part in (*self.constraints, *self.loads, *self.contacts):
            require_finite(type(part).__name__, part)
            for name, value in vars(part).items():
                valid, wanted = True, "two finite numbers"
                if name.startswith("point"):
                    valid = len(value) == 2
                elif name in ("body", "crank", "body_i", "body_j"):
                    lowest = GROUND if name.startswith("body_") else 0
                    valid = isinstance(value, Integral) and value in range(lowest, len(self.bodies))
                    wanted = f"a body index from {lowest} to {len(self.bodies) - 1}"
                if not valid:
                    require(f"{type(part).__name__}.{name}", value, False, wanted)

    @property
    def prescribed(self) -> tuple[Motion, ...]:
        """The prescribed motions that are functions of time."""
        return tuple(c.motion for c in self.constraints if isinstance(c, PrescribedMotion | PrescribedSlide))

    @property
    def by_time(self) -> tuple[PiecewiseCubic, ...]:
        """The functions of loads that go by the time."""
        return tuple(
            load.force_N if isinstance(load, ForceByTime) else load.torque_N_m
            for load in self.loads
            if isinstance(load, ForceByTime | TorqueByTime)
        )

    @property
    def has_knots(self) -> bool:
        """Whether motions or loads may have times for steps to land on."""
        return bool(self.by_time) or any(motion.has_knots for motion in self.prescribed)

    def knots_s(self, longest_step_s: float) -> tuple[float, ...]:
        """Return times, rising, for steps to land on: where motions and loads are not smooth, or quick."""
        motions = {t for motion in self.prescribed for t in motion.knots_s(longest_step_s)}
        loads = {t for table in self.by_time for t in table.knots}
        return tuple(sorted(motions | loads))

    def name_of(self, constraint: int) -> str:
        """Return the name of a constraint, or its kind with its number."""
        kind = type(self.constraints[constraint]).__name__
        return self.names[constraint] if self.names else f"{kind} {constraint}"

    @property
    def gas(self) -> tuple[GasForce, ...]:
        """The loads that go by another body's angle."""
        return tuple(load for load in self.loads if isinstance(load, GasForce))

    @property
    def knots_by_angle(self) -> tuple[tuple[float, float, int, int], ...]:
        """Angles in rad at which loads are not smooth: see ``run.KNOT_RECORD``."""
        return tuple(
            (x, load.force_N.period, 3 * load.crank + 2, int(load.force_N.straight))
            for load in self.gas
            for x in load.force_N.knots
        )

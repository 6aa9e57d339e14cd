"""What a planar mechanism consists of: the data from which every engine builds it. No formulas.

SI units. Bodies are numbered in the order of the file; ``GROUND`` stands for the frame. A point is given in
the axes of its body, from its centre of mass; one of the ground in the global frame. Angles are
counter-clockwise, from the x axis of the body or the frame.
"""

from dataclasses import dataclass, field
from typing import Any, Final, Literal

Point = tuple[float, float]

#: Stands for the frame wherever a body is asked for.
GROUND: Final = -1

Interpolation = Literal["spline", "linear"]
#: Laws whose exponent is 1 unless another is given, and the exponent of the others.
LINEAR_LAWS, HERTZ_EXPONENT = ("linear", "kelvin-voigt"), 1.5


@dataclass(frozen=True)
class Body:
    """A rigid body; its inertia is about the centre of mass."""

    mass_kg: float
    inertia_kg_m2: float
    name: str = field(default="", compare=False)


@dataclass(frozen=True)
class FrictionLaw:
    """Friction in a joint with clearance; the dead band belongs to Ambrosio's law (see ``contacts``)."""

    law: Literal["saturated-linear", "ambrosio", "tanh"]
    coefficient: float
    regularisation_speed_m_s: float
    dead_band_speed_m_s: float = 0.0


@dataclass(frozen=True)
class ClearanceData:
    """The room of a pin in its bearing, and the law of its wall, as a file has it (see ``contacts``)."""

    radial_clearance_m: float
    bearing_radius_m: float
    law: str
    stiffness: float | None = None
    young_modulus_Pa: float | None = None
    poisson_ratio: float | None = None
    exponent: float | None = None
    damping_N_s_m: float | None = None
    restitution: float | None = None
    minimum_impact_speed_m_s: float | None = None
    may_pull: bool = False
    friction: FrictionLaw | None = None


@dataclass(frozen=True)
class Ends:
    """What lies between two points: one of body i and one of body j."""

    body_i: int
    point_i: Point
    body_j: int
    point_j: Point


@dataclass(frozen=True)
class Pin(Ends):
    """A revolute joint: body j, the one named later, has a point where body i has one.

    With clearance the bearing is on body i, or on body j if ``bearing_on_j``. The joint's force acts on body
    j, and its gap leads from the bearing to the pin, whichever has the bearing.
    """

    name: str = field(default="", compare=False)
    clearance: ClearanceData | None = None
    bearing_on_j: bool = False


@dataclass(frozen=True)
class Line(Ends):
    """A line of body i through ``point_i``, at ``angle_rad`` from its x axis, and a point of body j.

    The way along it is that of the point from ``point_i``.
    """

    angle_rad: float


@dataclass(frozen=True)
class Guide(Line):
    """A point of body j stays on a line of body i. Body j turns with body i, unless it ``turns`` freely."""

    name: str = field(default="", compare=False)
    turns: bool = False


@dataclass(frozen=True)
class Spring(Ends):
    """A linear spring and damper between a point of body i and one of body j.

    The force along the line is k (l - free length) + c l', pulling the points together.
    """

    stiffness_N_m: float
    damping_N_s_m: float
    free_length_m: float
    name: str = field(default="", compare=False)


@dataclass(frozen=True)
class Torsion:
    """A torsion spring and a rotational damper between body i and body j.

    With a = phi_j - phi_i the torque on body j is -k (a - free angle) - c a', and the opposite on body i.
    """

    body_i: int
    body_j: int
    stiffness_N_m_rad: float
    damping_N_m_s: float
    free_angle_rad: float
    name: str = field(default="", compare=False)


@dataclass(frozen=True)
class Table:
    """Values y over x: a cubic spline, or straight lines. It repeats after a ``period`` other than 0.

    Without ``end_slopes`` (or with None of one end) the third derivative of a spline does not jump at the
    point next to an end; its slope is 0 at an end whose two values are equal.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    interpolation: Interpolation = "spline"
    end_slopes: tuple[float | None, float | None] | None = None
    period: float = 0.0


@dataclass(frozen=True)
class GasData:
    """A force in N along a line over the angle of a body in rad, which repeats."""

    body: int
    table: Table


@dataclass(frozen=True)
class Load:
    """What acts on a body beside its weight: forces along a line on its body j, and torques on it.

    The constant force, a damper -c s', a spring -k (s - ``free_position_m``), gas, and a table over time go
    by the way s along the line; the force on body i is the opposite one, at the same place.
    """

    body: int
    line: Line | None = None
    force_N: float = 0.0
    viscous_N_s_m: float = 0.0
    spring_N_m: float = 0.0
    free_position_m: float = 0.0
    gas: GasData | None = None
    force_by_time: Table | None = None
    torque_N_m: float = 0.0
    viscous_N_m_s: float = 0.0
    torque_by_time: Table | None = None


@dataclass(frozen=True)
class ConstantSpeed:
    """What is driven keeps its speed in rad/s or m/s."""

    speed: float


@dataclass(frozen=True)
class Ramp:
    """The speed goes from one to another within a time from ``start_s`` on, and stays there.

    It is w0 + (w1 - w0) x^3 (10 - 15 x + 6 x^2), x the part of the time that has passed: C'' is continuous.
    """

    first: float
    last: float
    duration_s: float
    start_s: float = 0.0


@dataclass(frozen=True)
class Fluctuation:
    """The speed is ``mean`` + ``amplitude`` sin(2 pi ``frequency_Hz`` t + ``phase_rad``)."""

    mean: float
    amplitude: float
    frequency_Hz: float
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Course:
    """The angle in rad, or the way in m, goes by a table over time, counted from its value at the start.

    The solver's own has the table's pieces (see ``motions.PiecewiseCubic``).
    """

    table: Any


@dataclass(frozen=True)
class Torque:
    """A torque in N m: constant, or by a table over time."""

    torque_N_m: float | Table


@dataclass(frozen=True)
class Motor:
    """A torque linear in the speed through both points, or by a table over the speed in rad/s."""

    stall_torque_N_m: float = 0.0
    no_load_speed_rad_s: float = 0.0
    table: Table | None = None


#: Laws that prescribe a motion, and all.
Motion = ConstantSpeed | Ramp | Fluctuation | Course
DriveLaw = Motion | Torque | Motor


@dataclass(frozen=True)
class DriveData:
    """What drives a body, or where ``guide`` is a number, the body of that guide along it; None: nothing.

    Times of the law are those of the clock, which reads ``clock_s`` as a run begins.
    """

    body: int
    guide: int | None = None
    law: DriveLaw | None = None
    clock_s: float = 0.0

    @property
    def prescribes(self) -> bool:
        """Whether the drive keeps a motion whatever it takes."""
        return isinstance(self.law, Motion)


@dataclass(frozen=True)
class MechanismData:
    """A planar mechanism; gravity is an acceleration (x, y) in m/s^2."""

    bodies: tuple[Body, ...]
    pins: tuple[Pin, ...]
    guides: tuple[Guide, ...] = ()
    springs: tuple[Spring, ...] = ()
    torsions: tuple[Torsion, ...] = ()
    loads: tuple[Load, ...] = ()
    drive: DriveData = DriveData(0)
    gravity_m_s2: Point = (0.0, 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return tuple(body.name for body in self.bodies)

    @property
    def loose(self) -> tuple[Pin, ...]:
        """The pins with clearance."""
        return tuple(pin for pin in self.pins if pin.clearance is not None)

    @property
    def ideal(self) -> tuple[Pin, ...]:
        """The pins without clearance."""
        return tuple(pin for pin in self.pins if pin.clearance is None)

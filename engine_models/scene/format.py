"""The parts of a scene's file, a class each: what they take, and what in one of them does not fit together.

A joint is a pin of the same name in two or more bodies, or in a body and the ground, each in axes of its own.
A place is one number, on the x axis of the body, or a pair of numbers. A number whose field's name has a unit
may be text with another one: ``"50 mm"``.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.plain_words import BadInput, expect, one_of, refusals, shown, unknown
from engine_models.scene.units import in_own_units
from reference_solver.mechanism import data
from reference_solver.mechanism.contacts import DAMPING_FACTORS, NORMAL_LAWS
from reference_solver.mechanism.data import HERTZ_EXPONENT, LINEAR_LAWS, Interpolation
from reference_solver.mechanism.motions import curve_of

Value = TypeVar("Value")
Kind = TypeVar("Kind", bound="SceneData")

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
#: Within less time nothing happens, and steps are lost below the least numbers there are.
Duration = Annotated[float, Field(gt=0, ge=1e-100)]
#: Beyond this an angle's own spacing is more than 1e-10 rad, and a whole turn is not known that well either.
LARGEST_ANGLE_RAD = 1e6
Angle = Annotated[float, Field(ge=-LARGEST_ANGLE_RAD, le=LARGEST_ANGLE_RAD)]
#: Columns of a table; a list in a file.
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Angles = Annotated[tuple[Angle, ...], Field(strict=False)]
#: The name of a body, a pin, a guide or a spring.
PartName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$"),
    expect("a name of letters, digits, _ and -, a letter first"),
]
Pair = Annotated[tuple[float, float], Field(strict=False)]
#: A place in a body's own axes.
Place = Annotated[float | Pair, expect("a finite number or a list of two")]
#: What a drive's clock may read at the start: later, its own spacing is more than 1e-12 s.
Clock = Annotated[float, Field(ge=0, le=1e4)]
#: Names begin cells of CSV files, and spreadsheets run what begins as a formula does.
Name = Annotated[
    str,
    Field(pattern=r"^[^\s=+\-@＝＋－＠]"),
    expect("a string that is not empty and begins with neither a blank nor =, +, - or @"),
]
Gravity = Annotated[NonNegative | Pair, expect("a finite number >= 0 or a list of two")]
Observe = Annotated[str, expect('a name and what of it, as "B.x", "B.y", "body.angle" or "guide.along"')]

TURN = 2 * math.pi
#: A revolution in a table may be off by as much as five typed digits are, in rad; its forces by rounding.
REVOLUTION_RAD, CLOSES = 1e-4, 1e-9
#: What is slower is constant for as long as anybody waits.
LOWEST_FREQUENCY_HZ = 1e-9
#: Speeds of straight lines that differ by less than this part of the fastest are one, but for typed digits.
SAME_SPEED = 1e-6
#: The units of the slopes at a table's ends, by the first of these columns that it has.
SLOPES = {
    "position_m": "m/s",
    "angle_rad": "rad/s",
    "force_N": "N/s",
    "speed_rad_s": "N m s/rad",
    "torque_N_m": "N m/s",
}
#: How many points each takes: a cubic spline without conditions at its ends, and a straight line.
FEWEST_POINTS: dict[Interpolation, int] = {"spline": 4, "linear": 2}

#: Laws with a damping, and all laws: those of a function of their own, and those of a factor a(e), are named
#: where the solver has them.
DAMPED_LAWS = ("kelvin-voigt", *sorted(NORMAL_LAWS.keys() - {"dissipative"}))
LAWS = ("linear", "hertz", *DAMPED_LAWS, *DAMPING_FACTORS, "rigid")
if TYPE_CHECKING:
    ContactLaw = str
else:
    ContactLaw = Literal[LAWS]
FrictionLaw = Literal["saturated-linear", "ambrosio", "tanh"]
_FRICTION_LAWS = one_of([shown(law) for law in get_args(FrictionLaw)])


class Parts(dict[str, Value]):
    """Parts or numbers by their names, as a scene has them, which can be hashed as scenes can."""

    def __hash__(self) -> int:  # type: ignore[override]
        """Return a hash of all names and parts."""
        return hash(tuple(self.items()))


#: A mapping of names to parts or numbers in a file.
Named = Annotated[dict[PartName, Value], AfterValidator(Parts)]
#: Places by the names of pins, of whom it has one at least.
Places = Annotated[Named[Place], expect("places by the names of pins, as { A = 0.1 }")]


class SceneError(BadInput):
    """A scene was refused; each of the reasons names the field, what was expected and what came."""

    def __init__(self, *reasons: str) -> None:
        self.reasons = reasons
        super().__init__("; ".join(reasons))


def refuse(field: str, expected: str, came: object) -> NoReturn:
    """Raise a ValueError in the words of ``plain_words``."""
    number = isinstance(came, int | float) and not isinstance(came, bool)
    got = "nothing" if came is None else f"{came:g}" if number else shown(came)
    raise ValueError(f"{field}: expected {expected}, got {got}")


def require(holds: bool, field: str, expected: str, came: object) -> None:
    """Refuse a field unless a condition on it holds."""
    if not holds:
        refuse(field, expected, came)


def require_presence(needed: bool, field: str, came: object, when: str) -> None:
    """Refuse a number that is missing where it is needed, or there where it has no use."""
    require((came is not None) == needed, field, f"{'a number' if needed else 'nothing'} {when}", came)


def require_known(path: str, name: str, choices: Iterable[str], what: str) -> None:
    """Refuse a name that is none of the choices."""
    choices = list(choices)
    if name not in choices:
        expected = f"{what} ({', '.join(choices)})" if choices else f"{what}, of which there is none"
        raise ValueError(unknown(path, name, choices, expected))


class SceneData(BaseModel):
    """Base of all parts of a scene: immutable, strict about types, unknown keys and non-finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _has_numbers_in_own_units(cls, data: object) -> object:
        if not isinstance(data, Mapping):
            return data
        slopes = next((unit for column, unit in SLOPES.items() if data.get(column) is not None), "rad/s")
        exponent = data.get("exponent") or (1 if data.get("law") in LINEAR_LAWS else HERTZ_EXPONENT)
        return in_own_units(data, end_slopes=slopes, stiffness=f"N/m^{exponent}")

    @classmethod
    def checked(cls: type[Kind], data: Mapping[str, Any]) -> Kind:
        """Return what a mapping of its fields describes, each a value or a mapping in its turn.

        Raises:
            SceneError: it is none.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise SceneError(*refusals(error, cls)) from None

    def as_written(self) -> dict[str, Any]:
        """Return the fields as a file has them, those of parts in mappings."""
        return self.model_dump(exclude_none=True)

    @check_arguments
    def model_copy(self: Kind, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Kind:  # noqa: ARG002
        """Return a copy with other values in some fields, checked as if it had been read from a file.

        Raises:
            SceneError: with them it is none.
        """
        return self.checked(self.as_written() | dict(update or {}))


class Table(SceneData):
    """Columns of numbers, with a cubic spline between them, or straight lines."""

    interpolation: Interpolation | None = None

    def table(self, x_name: str, y_name: str, period: float = 0.0) -> data.Table:
        """Return a column over another."""
        slopes = getattr(self, "end_slopes", None)
        ends = None if slopes is None else (slopes[0], slopes[1])
        interpolation = self.interpolation or "spline"
        return data.Table(getattr(self, x_name), getattr(self, y_name), interpolation, ends, period)

    def require_table(self, x_name: str, y_name: str) -> None:
        """Refuse columns that are missing, too short, of other lengths, or do not rise; and bad slopes."""
        x: Sequence[float] | None = getattr(self, x_name)
        y: Sequence[float] | None = getattr(self, y_name)
        by: Interpolation = self.interpolation or "spline"
        if x is None or y is None:
            refuse(x_name if x is None else y_name, "a list of numbers", None)
        require(len(x) >= FEWEST_POINTS[by], x_name, f"at least {FEWEST_POINTS[by]} numbers", len(x))
        require(len(y) == len(x), y_name, f"as many numbers as {x_name} has, {len(x)}", len(y))
        for place, (before, after) in enumerate(pairwise(x), 1):
            require(after > before, f"{x_name}.{place}", f"a number > {before:g}, the one before", after)
            expected = f"a number neither at {before:g} nor endlessly far from it"
            require(_has_cubic(after - before, y[place] - y[place - 1]), f"{x_name}.{place}", expected, after)
        if (slopes := getattr(self, "end_slopes", None)) is not None:
            require(by == "spline", "end_slopes", "nothing with interpolation = 'linear'", slopes)
            require(len(slopes) == 2, "end_slopes", "two numbers, of the first and the last end", len(slopes))

    def require_no_table(self, column: str, *names: str) -> None:
        """Refuse what belongs to a table where there is none."""
        for name in names:
            came = getattr(self, name)
            require(came is None, name, f"nothing without a list {column}", came)


def _has_cubic(step: float, rise: float) -> bool:
    """Return whether coefficients of a cubic that rises so far within a step are finite numbers."""
    try:
        return math.isfinite(step**3) and math.isfinite((1.0 + abs(rise)) / step**3)
    except (OverflowError, ZeroDivisionError):
        return False


# Bodies, guides, springs


class Ground(SceneData):
    """Pins of the frame, in the global frame."""

    pins_m: Places


class Body(SceneData):
    """A rigid body; its inertia is about its centre of mass."""

    pins_m: Places
    mass_kg: Positive
    inertia_kg_m2: Positive
    centre_of_mass_m: Place = 0.0


class Guide(SceneData):
    """A pin of a body on a straight line of another, or of the ground.

    The line passes through a place of what it is ``on`` at an angle from its x axis. The body keeps its angle
    against that, unless it ``turns``: then it is a pin in a slot.
    """

    body: PartName
    pin: PartName
    on: PartName = "ground"
    through_m: Place = 0.0
    angle_rad: Angle = 0.0
    turns: bool = False


class Spring(SceneData):
    """A linear spring, and a damper, between two pins named ``body.pin``."""

    between: Annotated[tuple[str, str], Field(strict=False), expect('two pins, as ["ground.O", "body.A"]')]
    stiffness_N_m: Positive
    free_length_m: NonNegative
    damping_N_s_m: NonNegative | None = None


# Clearances


class Friction(SceneData):
    """Friction in a joint with clearance; the dead band belongs to Ambrosio's law alone."""

    law: Annotated[
        FrictionLaw, expect(f"{_FRICTION_LAWS}, whose force rises over regularisation_speed_m_s from rest")
    ]
    coefficient: NonNegative
    regularisation_speed_m_s: Positive
    dead_band_speed_m_s: Positive | None = None

    @model_validator(mode="after")
    def _dead_band_belongs_to_ambrosio(self) -> "Friction":
        dead_band, limit = self.dead_band_speed_m_s, self.regularisation_speed_m_s
        with_law = f"with law = '{self.law}'"
        require_presence(self.law == "ambrosio", "dead_band_speed_m_s", dead_band, with_law)
        expected = f"a number < regularisation_speed_m_s = {limit:g}"
        require(dead_band is None or dead_band < limit, "dead_band_speed_m_s", expected, dead_band)
        return self


class Clearance(SceneData):
    """A revolute joint whose pin has room in its bearing.

    ``stiffness`` is in N/m^exponent; without it, Hertz's value follows from the material that pin and bearing
    share. ``exponent`` defaults to 1 for the linear and Kelvin-Voigt laws, else to 3/2. A law of the
    dissipative family may pull on a pin that leaves fast: the force is zero there unless ``may_pull``. The
    ``bearing`` is on the ground, else on the body named first, unless its body is named.
    """

    radial_clearance_m: Positive
    bearing_radius_m: Positive
    law: ContactLaw
    stiffness: Positive | None = None
    young_modulus_Pa: Positive | None = None
    poisson_ratio: Annotated[float, Field(gt=-1, le=0.5)] | None = None
    exponent: Annotated[float, Field(ge=1)] | None = None
    damping_N_s_m: NonNegative | None = None
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    minimum_impact_speed_m_s: Positive | None = None
    may_pull: bool = False
    friction: Friction | None = None
    bearing: PartName | None = None

    @model_validator(mode="after")
    def _hangs_together(self) -> "Clearance":
        law, e, with_law = self.law, self.restitution, f"with law = '{self.law}'"
        c, radius = self.radial_clearance_m, self.bearing_radius_m
        require(c < radius, "radial_clearance_m", f"a number < bearing_radius_m = {radius:g}", c)
        by_material = law != "rigid" and self.stiffness is None
        when = f"{'without' if by_material else 'beside'} stiffness"
        if law == "rigid":
            when = with_law
            require_presence(False, "stiffness", self.stiffness, when)
        require_presence(by_material, "young_modulus_Pa", self.young_modulus_Pa, when)
        require_presence(by_material, "poisson_ratio", self.poisson_ratio, when)
        require_presence(law in DAMPED_LAWS, "damping_N_s_m", self.damping_N_s_m, with_law)
        require_presence(law in DAMPING_FACTORS or law == "rigid", "restitution", e, with_law)
        if e == 0 and law in DAMPING_FACTORS:
            try:
                DAMPING_FACTORS[law](0.0)
            except ZeroDivisionError:
                refuse("restitution", f"a number > 0 {with_law}", e)
        can_pull = not self.may_pull or law in DAMPING_FACTORS
        require(can_pull, "may_pull", f"false or nothing {with_law}", self.may_pull)
        is_linear = law in (*LINEAR_LAWS, "rigid")
        require(
            not is_linear or self.exponent in (None, 1.0),
            "exponent",
            f"1 or nothing {with_law}",
            self.exponent,
        )
        return self

    def data(self) -> data.ClearanceData:
        """Return the clearance as data of the mechanism."""
        own, law = self.model_dump(exclude={"friction", "bearing"}), None
        if (friction := self.friction) is not None:
            numbers = friction.coefficient, friction.regularisation_speed_m_s
            law = data.FrictionLaw(friction.law, *numbers, friction.dead_band_speed_m_s or 0.0)
        return data.ClearanceData(**own, friction=law)


# Loads


def period_of(angle: Sequence[float]) -> float:
    """Return the period of a table over angles in rad: one revolution or two, the one that is nearer."""
    return TURN if angle[-1] - angle[0] < 1.5 * TURN else 2 * TURN


class Gas(Table):
    """A force by the angle of a ``body``, that which is driven unless it is named, as of a cylinder.

    A periodic cubic spline, or straight lines, through a table over one revolution, or over two, whose last
    entry is the first again.
    """

    angle_rad: Angles
    force_N: Numbers
    body: PartName | None = None

    @model_validator(mode="after")
    def _closes(self) -> "Gas":
        require_period(self, "angle_rad", self.angle_rad, self.force_N)
        return self


class CrankGas(Table):
    """A force by the crank's angle: see ``[load.NAME.gas]``."""

    crank_angle_rad: Angles
    force_N: Numbers

    @model_validator(mode="after")
    def _closes(self) -> "CrankGas":
        require_period(self, "crank_angle_rad", self.crank_angle_rad, self.force_N)
        return self


def require_period(table: Table, name: str, angle: Sequence[float], force: Sequence[float]) -> None:
    """Refuse a table over angles that does not repeat after one revolution, or after two."""
    table.require_table(name, "force_N")
    period = period_of(angle)
    times = "one revolution" if period == TURN else "two revolutions"
    ends = angle[0] + TURN, angle[0] + 2 * TURN
    expected = f"one revolution or two after the first, {ends[0]:.6g} or {ends[1]:.6g}"
    is_period = abs(angle[-1] - angle[0] - period) <= REVOLUTION_RAD
    require(is_period, f"{name}.{len(angle) - 1}", expected, angle[-1])
    expected = f"a number < {angle[0] + period:.6g}, {times} after the first"
    require(angle[-2] < angle[0] + period, f"{name}.{len(angle) - 2}", expected, angle[-2])
    closes = abs(force[-1] - force[0]) <= CLOSES * max(map(abs, force))
    require(closes, f"force_N.{len(force) - 1}", f"the first one again, {force[0]:g}", force[-1])


class ByTime(Table):
    """A force in N, a torque in N m or both by the drive's clock, as a spline or straight lines."""

    time_s: Numbers
    force_N: Numbers | None = None
    torque_N_m: Numbers | None = None
    end_slopes: Numbers | None = None

    @model_validator(mode="after")
    def _is_a_table(self) -> "ByTime":
        columns = [name for name in ("force_N", "torque_N_m") if getattr(self, name) is not None]
        require(bool(columns), "force_N", "it or torque_N_m", None)
        for name in columns:
            self.require_table("time_s", name)
        one = self.end_slopes is None or len(columns) == 1
        require(one, "end_slopes", "nothing beside both force_N and torque_N_m", self.end_slopes)
        return self


class Load(SceneData):
    """Forces and torques on a body: any of them, together.

    By the way s along a line and its rate s': ``force_N`` is constant; ``viscous_N_s_m`` -c s', friction of a
    guide; ``spring_N_m`` -k (s - ``free_position_m``). On a body in a guide they act at the guide's pin along
    it, and push back on what it is on; ``guide`` names one where the body has two. On another body they act
    on the centre of mass, along ``along_rad`` from the x axis of the global frame. By the angle phi of the
    body: ``torque_N_m`` is constant, ``viscous_N_m_s`` -c phi'. ``gas`` goes by the angle of a body,
    ``by_time`` by the drive's clock.
    """

    force_N: float | None = None
    viscous_N_s_m: NonNegative | None = None
    spring_N_m: Positive | None = None
    free_position_m: float | None = None
    by_time: ByTime | None = None
    torque_N_m: float | None = None
    viscous_N_m_s: NonNegative | None = None
    guide: PartName | None = None
    along_rad: Angle | None = None
    gas: Gas | None = None

    @model_validator(mode="after")
    def _is_some(self) -> "Load":
        alone = {"free_position_m", "guide", "along_rad"}
        kinds = [name for name in type(self).model_fields if name not in alone]
        some = any(getattr(self, name) is not None for name in kinds)
        require(some, "force_N", f"it or {one_of(kinds[1:])}", None)
        sprung = self.spring_N_m is not None
        when = f"{'beside' if sprung else 'without'} spring_N_m"
        require_presence(sprung, "free_position_m", self.free_position_m, when)
        return self

    @property
    def has_forces(self) -> bool:
        """Whether anything acts along a line."""
        by_time = self.by_time is not None and self.by_time.force_N is not None
        own = (self.force_N, self.viscous_N_s_m, self.spring_N_m, self.gas)
        return by_time or any(part is not None for part in own)


# What drives a mechanism. A driver that prescribes the motion keeps it whatever it takes. Prescribed speeds
# are functions of time on the drive's clock, which reads ``start.time_s`` as a run begins. On a body they are
# in rad/s, along a guide in m/s: fields with ``_m`` and ``_m_s`` take the place of those with ``_rad`` there.


class AnyDrive(SceneData):
    """What is driven: a ``body``, the first of the file unless it is named, or a guide's body along it."""

    body: PartName | None = None
    guide: PartName | None = None

    @model_validator(mode="after")
    def _drives_one_thing(self) -> "AnyDrive":
        require(self.guide is None or self.body is None, "body", "nothing beside guide", self.body)
        return self

    def law(self, speed: float) -> data.DriveLaw | None:  # noqa: ARG002
        """Return the law of the drive, whose start has a speed in rad/s or m/s; None drives nothing."""
        return None

    def fitting(self, by_body: str, by_guide: str) -> str:
        """Return the name of the field that fits what is driven; the other one is to be absent."""
        name, other = (by_body, by_guide) if self.guide is None else (by_guide, by_body)
        came, when = getattr(self, other), "without guide" if self.guide is None else "beside guide"
        require_presence(False, other, came, when)
        takes = "a list of numbers" if "speed" not in name and "amplitude" not in name else f"a number {when}"
        require(getattr(self, name) is not None, name, takes, None)
        return name

    def require_body(self) -> None:
        """Refuse a torque along a guide."""
        expected = "nothing with a torque, which acts on a body"
        require(self.guide is None, "guide", expected, self.guide)


class FreeDrive(AnyDrive):
    """Nothing drives the mechanism."""

    kind: Literal["free"]


class ConstantSpeedDrive(AnyDrive):
    """What is driven keeps the speed that it starts with."""

    kind: Literal["constant-speed"]

    def law(self, speed: float) -> data.DriveLaw:
        """Return the law of the drive."""
        return data.ConstantSpeed(speed)


class RampDrive(AnyDrive):
    """The speed goes from the start's to another, and stays there: a start-up, or a stop.

    It is w0 + (w1 - w0) x^3 (10 - 15 x + 6 x^2) with x = t/``ramp_time_s`` up to 1: twice differentiable.
    """

    kind: Literal["ramp"]
    final_speed_rad_s: float | None = None
    final_speed_m_s: float | None = None
    ramp_time_s: Positive

    @model_validator(mode="after")
    def _has_a_speed(self) -> "RampDrive":
        self.fitting("final_speed_rad_s", "final_speed_m_s")
        return self

    def law(self, speed: float) -> data.DriveLaw:
        """Return the law of the drive."""
        final = getattr(self, self.fitting("final_speed_rad_s", "final_speed_m_s"))
        return data.Ramp(speed, final, self.ramp_time_s)


class FluctuatingDrive(AnyDrive):
    """The speed is the start's plus a sine of the clock's t.

    It is ``amplitude_rad_s`` sin(2 pi ``frequency_Hz`` t + ``phase_rad``).
    """

    kind: Literal["fluctuating"]
    amplitude_rad_s: NonNegative | None = None
    amplitude_m_s: NonNegative | None = None
    frequency_Hz: Annotated[float, Field(ge=LOWEST_FREQUENCY_HZ)]
    phase_rad: Angle = 0.0

    @model_validator(mode="after")
    def _has_an_amplitude(self) -> "FluctuatingDrive":
        self.fitting("amplitude_rad_s", "amplitude_m_s")
        return self

    def law(self, speed: float) -> data.DriveLaw:
        """Return the law of the drive."""
        amplitude = getattr(self, self.fitting("amplitude_rad_s", "amplitude_m_s"))
        return data.Fluctuation(speed, amplitude, self.frequency_Hz, self.phase_rad)


class TableDrive(AnyDrive, Table):
    """The body turns by a table: from the start's angle on, as ``angle_rad`` does from its first entry on.

    Between the entries the angle is a cubic spline of time. ``end_slopes`` are its speeds in rad/s at both
    ends. Without them it is not-a-knot there (de Boor's), but at rest at an end whose two angles are equal.
    Between straight lines the speed jumps: ``linear`` is for a constant speed alone.
    """

    kind: Literal["table"]
    time_s: Numbers
    angle_rad: Angles | None = None
    position_m: Numbers | None = None
    end_slopes: Numbers | None = None

    @model_validator(mode="after")
    def _is_a_table(self) -> "TableDrive":
        self.require_table("time_s", self.fitting("angle_rad", "position_m"))
        if self.interpolation == "linear":
            self._turns_evenly()
        return self

    def _turns_evenly(self) -> None:
        """Refuse straight lines between which the speed jumps."""
        speeds, unit = curve_of(self.course()).c[2].tolist(), "rad/s" if self.guide is None else "m/s"
        for place, (before, after) in enumerate(pairwise(speeds), 1):
            jump = f"at time_s.{place} the speed would jump from {before:.4g} to {after:.4g} {unit}"
            of = "torque" if self.guide is None else "force"
            same = abs(after - before) <= SAME_SPEED * max(map(abs, speeds))
            require(same, "interpolation", f"'spline' ({jump}, by an infinite {of})", "linear")

    def course(self) -> data.Table:
        """Return the angle in rad, or the position in m, over the drive's clock in s."""
        return self.table("time_s", self.fitting("angle_rad", "position_m"))

    def law(self, speed: float) -> data.DriveLaw:  # noqa: ARG002
        """Return the law of the drive."""
        return data.Course(self.course())


class TorqueDrive(AnyDrive, Table):
    """A torque on the body, counter-clockwise positive: constant, or by a table over the clock's time."""

    kind: Literal["torque"]
    torque_N_m: float | Numbers
    time_s: Numbers | None = None
    end_slopes: Numbers | None = None

    @model_validator(mode="after")
    def _is_a_torque(self) -> "TorqueDrive":
        self.require_body()
        if isinstance(self.torque_N_m, tuple):
            self.require_table("time_s", "torque_N_m")
        else:
            self.require_no_table("torque_N_m", "time_s", "interpolation", "end_slopes")
        return self

    def law(self, speed: float) -> data.DriveLaw:  # noqa: ARG002
        """Return the law of the drive."""
        torque = self.torque_N_m
        return data.Torque(self.table("time_s", "torque_N_m") if isinstance(torque, tuple) else torque)


class MotorDrive(AnyDrive, Table):
    """A torque by the body's speed: linear through two points and beyond them, or by a table.

    At rest it is ``stall_torque_N_m``, at ``no_load_speed_rad_s`` none; faster than that the motor brakes. A
    table of ``torque_N_m`` over ``speed_rad_s`` has its end values beyond its ends.
    """

    kind: Literal["motor"]
    stall_torque_N_m: float | None = None
    no_load_speed_rad_s: float | None = None
    speed_rad_s: Numbers | None = None
    torque_N_m: Numbers | None = None
    end_slopes: Numbers | None = None

    @model_validator(mode="after")
    def _drives(self) -> "MotorDrive":
        self.require_body()
        points = "stall_torque_N_m", "no_load_speed_rad_s"
        if self.speed_rad_s is not None or self.torque_N_m is not None:
            self.require_table("speed_rad_s", "torque_N_m")
            for name in points:
                require_presence(False, name, getattr(self, name), "beside a table")
            return self
        self.require_no_table("torque_N_m", "interpolation", "end_slopes")
        stall, speed = self.stall_torque_N_m, self.no_load_speed_rad_s
        for name in points:
            require(getattr(self, name) is not None, name, "a finite number", None)
        require(stall != 0, points[0], "a number other than 0", stall)
        assert stall is not None
        assert speed is not None
        wanted = f"a number {'>' if stall > 0 else '<'} 0, as stall_torque_N_m"
        require(speed * math.copysign(1.0, stall) > 0, points[1], wanted, speed)
        return self

    def law(self, speed: float) -> data.DriveLaw:  # noqa: ARG002
        """Return the law of the drive."""
        if self.speed_rad_s is not None:
            return data.Motor(table=self.table("speed_rad_s", "torque_N_m"))
        return data.Motor(self.stall_torque_N_m or 0.0, self.no_load_speed_rad_s or 0.0)


Drive = Annotated[
    FreeDrive | ConstantSpeedDrive | RampDrive | FluctuatingDrive | TableDrive | TorqueDrive | MotorDrive,
    Field(discriminator="kind"),
]


# Starts


class BodyState(SceneData):
    """Where a body's centre of mass is, and how fast it moves."""

    x_m: float
    y_m: float
    angle_rad: Angle
    velocity_x_m_s: float
    velocity_y_m_s: float
    angular_velocity_rad_s: float


class PlacedStart(SceneData):
    """Where the motion begins, and how fast.

    Values told are rough, unless their bodies or guides are named in ``hold``: the mechanism is put together
    as near to them as its joints allow. Without ``hold`` what is driven is held, else the first body or guide
    told. Or the state of every body is given by its name. ``time_s`` is what the drive's clock reads then.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, BodyState] = Field(init=False)

    angle_rad: Named[Angle] = Field(default_factory=Parts)
    position_m: Named[float] = Field(default_factory=Parts)
    hold: Annotated[tuple[PartName, ...], Field(strict=False)] = ()
    speed_rad_s: Named[float] = Field(default_factory=Parts)
    speed_m_s: Named[float] = Field(default_factory=Parts)
    time_s: Clock | None = None

    @property
    def states(self) -> dict[str, BodyState]:
        """The given states of bodies by their names."""
        return self.__pydantic_extra__


#: Parts of the format that no engine runs yet, with what they are.
LATER = {"film": "a lubricated bearing", "friction": "dry friction of an ideal joint"}


class Top(SceneData):
    """The top of a file, in both spellings. Gravity is a number along -y, or a pair along x and y."""

    name: Name
    end_time_s: Duration
    gravity_m_s2: Gravity = 0.0

    @model_validator(mode="before")
    @classmethod
    def _has_no_later_part(cls, data: object) -> object:
        """Refuse parts of the format that no engine runs yet, play in a guide among them."""
        if not isinstance(data, Mapping):
            return data
        expected = "nothing yet ({}: no engine runs it so far)"
        for name, what in LATER.items():
            if part := data.get(name):
                path = ".".join([name, *map(str, part)][:2]) if isinstance(part, Mapping) else name
                refuse(path, expected.format(what), {"": 0})
        rooms, guides = data.get("clearance"), data.get("guide", ["guide"] if "crank" in data else [])
        if isinstance(rooms, Mapping) and isinstance(guides, Mapping | list):
            for name in guides:
                require(name not in rooms, f"clearance.{name}", expected.format("play in a guide"), {"": 0})
        return data


class Sections(Top):
    """Any planar mechanism in motion: bodies that share pins, guides, springs, loads, a drive.

    ``observe`` is what the scene is about: a pin's x or y, a body's angle, or the way along a guide.
    ``turning`` is the body whose turns are revolutions, "" for none; it is the driven one unless it is named.
    """

    observe: Observe
    turning: str | None = None
    ground: Ground = Field(default_factory=lambda: Ground(pins_m=Parts()))
    body: Annotated[
        dict[PartName, Body],
        Field(min_length=1),
        AfterValidator(Parts),
        expect("one body at least, as [body.crank]"),
    ]
    guide: Named[Guide] = Field(default_factory=Parts)
    spring: Named[Spring] = Field(default_factory=Parts)
    load: Named[Load] = Field(default_factory=Parts)
    drive: Drive = FreeDrive(kind="free")
    clearance: Named[Clearance] = Field(default_factory=Parts)
    start: PlacedStart = Field(default_factory=PlacedStart)

    @model_validator(mode="before")
    @classmethod
    def _has_no_unknown_in_start(cls, data: object) -> object:
        """Refuse what is neither a key of the start nor a body, before it is looked at as a body's state."""
        bodies, start = (data.get("body"), data.get("start")) if isinstance(data, Mapping) else (None, None)
        if isinstance(bodies, Mapping) and isinstance(start, Mapping):
            for name in start:
                choices = [*PlacedStart.model_fields, *bodies]
                require_known(f"start.{name}", name, choices, "a key of start or a body")
        return data

    @property
    def gravity(self) -> tuple[float, float]:
        """Gravity as an acceleration (x, y) in m/s^2."""
        own = self.gravity_m_s2
        return own if isinstance(own, tuple) else (0.0, -own)

    @property
    def driven(self) -> str:
        """The name of the driven body, or guide."""
        return self.drive.guide or self.drive.body or next(iter(self.body))

    @property
    def clock_s(self) -> float:
        """What the drive's clock reads as a run begins."""
        return self.start.time_s or 0.0

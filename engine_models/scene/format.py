"""The parts of a scene's file, a class each: what they take, and what in one of them does not fit together.

A joint is a pin of the same name in two or more bodies, or in a body and the ground, each in axes of its own.
A place is one number, on the x axis of the body, or a pair of numbers. A number whose field's name has a unit
may be text with another one: ``"50 mm"``.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NoReturn, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.plain_words import BadInput, expect, one_of, refusals, shown, unknown, unknown_key
from engine_models.scene.tables import BadFile, read_columns
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
#: Beyond 1e6 an angle's own spacing is more than 1e-10 rad, and a whole turn is not known that well either.
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]
#: Columns of a table; a list in a file.
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Angles = Annotated[tuple[Angle, ...], Field(strict=False)]
#: The name of a body, a pin, a guide or a spring.
PartName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$"),
    expect("a name of letters, digits, _ and -, a letter first"),
]
#: A mapping of names to parts or numbers in a file.
Named = dict[PartName, Value]
Pair = Annotated[tuple[float, float], Field(strict=False), expect("a list of two numbers")]
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

TURN = 2 * math.pi
#: A revolution in a table may be off by as much as five typed digits are, in rad; its forces by rounding.
REVOLUTION_RAD, CLOSES = 1e-4, 1e-9
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
    """Refuse what is missing where it is needed, or there where it has no use."""
    require((came is not None) == needed, field, f"{'a value' if needed else 'nothing'} {when}", came)


def require_known(path: str, name: str, choices: Iterable[str], what: str) -> None:
    """Refuse a name that is none of the choices."""
    choices = list(choices)
    if name not in choices:
        raise ValueError(unknown(path, name, choices, f"{what} ({', '.join(choices) or 'none'})"))


class SceneData(BaseModel):
    """Base of all parts of a scene: immutable, strict about types, unknown keys and non-finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _has_known_keys_and_own_units(cls, data: object) -> object:
        if not isinstance(data, Mapping):
            return data
        known = cls.model_fields
        if cls.model_config["extra"] == "forbid" and data.keys() - known.keys():
            missing = [name for name, field in known.items() if field.is_required() and name not in data]
            reasons = [f"{name}: expected a value, got nothing" for name in missing]
            raise SceneError(*reasons, *(unknown_key(key, known) for key in data if key not in known))
        slopes = next((unit for column, unit in SLOPES.items() if data.get(column) is not None), "rad/s")
        exponent = data.get("exponent") or (1 if data.get("law") in LINEAR_LAWS else HERTZ_EXPONENT)
        return in_own_units(data, end_slopes=slopes, stiffness=f"N/m^{exponent}")

    @classmethod
    def checked(cls: type[Kind], data: Mapping[str, Any], folder: Path = Path(), **context: Any) -> Kind:
        """Return what a mapping of its fields describes; files of tables are in a folder.

        Raises:
            SceneError: it is none.
        """
        try:
            return cls.model_validate(data, context={"folder": folder, **context})
        except ValidationError as error:
            raise SceneError(*refusals(error, data)) from None

    def as_written(self) -> dict[str, Any]:
        """Return the fields that were given as a file has them, those of parts in mappings."""
        return self.model_dump(exclude_unset=True, exclude_none=True)

    @check_arguments
    def model_copy(self: Kind, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Kind:  # noqa: ARG002
        """Return a copy with other values in some fields, checked as if it had been read from a file.

        Raises:
            SceneError: with them it is none.
        """
        return self.checked(self.as_written() | dict(update or {}))


def _or_a_file(schema: dict[str, Any], kind: "type[Table]") -> None:
    """Let the JSON schema of a table have a file in place of lists."""
    lists = [name for name in schema.get("required", ()) if name in kind.COLUMNS]
    schema["properties"]["file"] = {"type": "string", "description": "a CSV file in place of lists"}
    if lists:
        schema["required"] = [name for name in schema["required"] if name not in lists]
        schema["oneOf"] = [{"required": lists}, {"required": ["file"]}]


class Table(SceneData):
    """Columns of numbers, with a cubic spline between them, or straight lines.

    ``file = "drive.csv"`` stands for the lists.
    """

    model_config = ConfigDict(json_schema_extra=_or_a_file)

    #: The columns: the first one, and others of which there is one at least.
    COLUMNS: ClassVar[tuple[str, ...]]

    interpolation: Interpolation = "spline"

    @model_validator(mode="before")
    @classmethod
    def _has_the_columns_of_its_file(cls, data: object, info: ValidationInfo) -> object:
        if not isinstance(data, Mapping) or "file" not in data:
            return data
        file, beside = data["file"], [name for name in cls.COLUMNS if name in data]
        require(not beside, "file", f"nothing beside {one_of(beside)}", file)
        is_name = isinstance(file, str) and file.isprintable() and file != ""
        require(is_name, "file", "the name of a CSV file", file)
        try:
            columns = read_columns((info.context or {}).get("folder", Path()) / file, cls.COLUMNS)
        except BadFile as reason:
            raise ValueError(f"file: {reason}") from None
        return {key: value for key, value in data.items() if key != "file"} | columns

    def table(self, x_name: str, y_name: str, period: float = 0.0) -> data.Table:
        """Return a column over another."""
        ends = getattr(self, "end_slopes", None)
        return data.Table(getattr(self, x_name), getattr(self, y_name), self.interpolation, ends, period)

    def require_table(self, x_name: str, y_name: str) -> None:
        """Refuse columns that are missing, too short, of other lengths, or do not rise; and bad slopes."""
        x: Sequence[float] | None = getattr(self, x_name)
        y: Sequence[float] | None = getattr(self, y_name)
        if x is None or y is None:
            refuse(x_name if x is None else y_name, "a list of numbers", None)
        fewest = FEWEST_POINTS[self.interpolation]
        require(len(x) >= fewest, x_name, f"at least {fewest} numbers", len(x))
        require(len(y) == len(x), y_name, f"as many numbers as {x_name} has, {len(x)}", len(y))
        for place, (before, after) in enumerate(pairwise(x), 1):
            require(after > before, f"{x_name}.{place}", f"a number > {before:g}, the one before", after)
            expected = f"a number neither at {before:g} nor endlessly far from it"
            require(_has_cubic(after - before, y[place] - y[place - 1]), f"{x_name}.{place}", expected, after)
        slopes = getattr(self, "end_slopes", None)
        is_spline = slopes is None or self.interpolation == "spline"
        require(is_spline, "end_slopes", "nothing with interpolation = 'linear'", slopes)


def _has_cubic(step: float, rise: float) -> bool:
    """Return whether coefficients of a cubic that rises so far within a step are finite numbers."""
    try:
        return math.isfinite(step**3) and math.isfinite((1.0 + abs(rise)) / step**3)
    except (OverflowError, ZeroDivisionError):
        return False


# Bodies, guides, springs


class Ground(SceneData):
    """Pins of the frame, in the global frame."""

    pins_m: Named[Place]


class Body(SceneData):
    """A rigid body; its inertia is about its centre of mass."""

    pins_m: Annotated[Named[Place], Field(min_length=1)]
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

    between: Annotated[tuple[str, str], Field(strict=False)]
    stiffness_N_m: Positive
    free_length_m: NonNegative
    damping_N_s_m: NonNegative = 0.0


# Clearances


class Friction(SceneData):
    """Friction in a joint with clearance; the dead band belongs to Ambrosio's law alone.

    The force of each law rises over ``regularisation_speed_m_s`` from rest.
    """

    law: FrictionLaw
    coefficient: NonNegative
    regularisation_speed_m_s: Positive
    dead_band_speed_m_s: Positive | None = None

    @model_validator(mode="after")
    def _dead_band_belongs_to_ambrosio(self) -> "Friction":
        dead_band, limit = self.dead_band_speed_m_s, self.regularisation_speed_m_s
        require_presence(self.law == "ambrosio", "dead_band_speed_m_s", dead_band, f"with law = '{self.law}'")
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
        law, e, c, radius = self.law, self.restitution, self.radial_clearance_m, self.bearing_radius_m
        require(c < radius, "radial_clearance_m", f"a number < bearing_radius_m = {radius:g}", c)
        when = f"with law = '{law}'"
        rigid, by_material = law == "rigid", law != "rigid" and self.stiffness is None
        require(not rigid or self.stiffness is None, "stiffness", f"nothing {when}", self.stiffness)
        stiff = when if rigid else f"{'without' if by_material else 'beside'} stiffness"
        require_presence(by_material, "young_modulus_Pa", self.young_modulus_Pa, stiff)
        require_presence(by_material, "poisson_ratio", self.poisson_ratio, stiff)
        require_presence(law in DAMPED_LAWS, "damping_N_s_m", self.damping_N_s_m, when)
        require_presence(rigid or law in DAMPING_FACTORS, "restitution", e, when)
        if e == 0 and law in DAMPING_FACTORS:
            try:
                DAMPING_FACTORS[law](0.0)
            except ZeroDivisionError:
                refuse("restitution", f"a number > 0 {when}", e)
        can_pull = not self.may_pull or law in DAMPING_FACTORS
        require(can_pull, "may_pull", f"false or nothing {when}", self.may_pull)
        fits = self.exponent in (None, 1.0) or law not in (*LINEAR_LAWS, "rigid")
        require(fits, "exponent", f"1 or nothing {when}", self.exponent)
        return self

    def data(self) -> data.ClearanceData:
        """Return the clearance as data of the mechanism."""
        friction = (
            None if self.friction is None else data.FrictionLaw(**self.friction.model_dump(exclude_none=True))
        )
        return data.ClearanceData(**self.model_dump(exclude={"friction", "bearing"}), friction=friction)


# Loads


class Cylinder(Table):
    """A force by an angle: a periodic spline, or straight lines, over one revolution, or two.

    Its last entry is the first again.
    """

    force_N: Numbers

    @property
    def by_angle(self) -> data.Table:
        """The table, which repeats after that of one revolution and two that is nearer to its length."""
        name = self.COLUMNS[0]
        angle = getattr(self, name)
        return self.table(name, "force_N", TURN if angle[-1] - angle[0] < 1.5 * TURN else 2 * TURN)

    @model_validator(mode="after")
    def _repeats(self) -> "Cylinder":
        self.require_table(*self.COLUMNS)
        name, angle, force, period = self.COLUMNS[0], self.by_angle.x, self.force_N, self.by_angle.period
        end = angle[0] + period
        is_period = abs(angle[-1] - end) <= REVOLUTION_RAD
        expected = (
            f"one revolution or two after the first, {angle[0] + TURN:.6g} or {angle[0] + 2 * TURN:.6g}"
        )
        require(is_period, f"{name}.{len(angle) - 1}", expected, angle[-1])
        expected = f"a number < {end:.6g}, where the table repeats"
        require(angle[-2] < end, f"{name}.{len(angle) - 2}", expected, angle[-2])
        closes = abs(force[-1] - force[0]) <= CLOSES * max(map(abs, force))
        require(closes, f"force_N.{len(force) - 1}", f"the first one again, {force[0]:g}", force[-1])
        return self


class Gas(Cylinder):
    """A force by the angle of a ``body``, that which is driven unless it is named, as of a cylinder."""

    COLUMNS = ("angle_rad", "force_N")

    angle_rad: Angles
    body: PartName | None = None


class ByTime(Table):
    """A force in N, a torque in N m or both by the drive's clock, as a spline or straight lines."""

    COLUMNS = ("time_s", "force_N", "torque_N_m")

    time_s: Numbers
    force_N: Numbers | None = None
    torque_N_m: Numbers | None = None
    end_slopes: Pair | None = None

    @model_validator(mode="after")
    def _is_a_table(self) -> "ByTime":
        columns = [name for name in ("force_N", "torque_N_m") if getattr(self, name) is not None]
        require(bool(columns), "force_N", "it or torque_N_m", None)
        for name in columns:
            self.require_table("time_s", name)
        one = self.end_slopes is None or len(columns) == 1
        require(one, "end_slopes", "nothing beside both force_N and torque_N_m", self.end_slopes)
        return self

    def column(self, name: str) -> data.Table | None:
        """Return a column over time, None if there is none."""
        return None if getattr(self, name) is None else self.table("time_s", name)


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
        kinds = self.model_fields_set - {"free_position_m", "guide", "along_rad"}
        some = any(getattr(self, name) is not None for name in kinds)
        require(some, "force_N", "it or another force or torque", None)
        sprung = self.spring_N_m is not None
        when = f"{'beside' if sprung else 'without'} spring_N_m"
        require_presence(sprung, "free_position_m", self.free_position_m, when)
        return self

    @property
    def has_forces(self) -> bool:
        """Whether anything acts along a line."""
        by_time = None if self.by_time is None else self.by_time.force_N
        parts = (self.force_N, self.viscous_N_s_m, self.spring_N_m, self.gas, by_time)
        return any(part is not None for part in parts)


# What drives a mechanism. A driver that prescribes the motion keeps it whatever it takes. Prescribed speeds
# are functions of time on the drive's clock, which reads ``start.time_s`` as a run begins. On a body they are
# in rad/s, along a guide in m/s: fields with ``_m`` and ``_m_s`` take the place of those with ``_rad`` there.


class AnyDrive(SceneData):
    """What is driven: a ``body``, the first of the file unless it is named, or a guide's body along it."""

    #: What a drive of a body has, and what one along a guide has in its place; none drives a body alone.
    FITTING: ClassVar[tuple[str, str] | None] = None

    kind: str
    body: PartName | None = None
    guide: PartName | None = None

    @model_validator(mode="after")
    def _drives_one_thing(self) -> "AnyDrive":
        require(self.guide is None or self.body is None, "body", "nothing beside guide", self.body)
        turns = self.kind in ("torque", "motor")
        require(
            self.guide is None or not turns,
            "guide",
            "nothing with a torque, which acts on a body",
            self.guide,
        )
        if self.FITTING is not None:
            name, when = self.fitting, "without guide" if self.guide is None else "beside guide"
            other = next(each for each in self.FITTING if each != name)
            require_presence(False, other, getattr(self, other), when)
            require_presence(True, name, getattr(self, name), when)
        return self

    @property
    def fitting(self) -> str:
        """The name of the field that fits what is driven."""
        assert self.FITTING is not None
        return self.FITTING[self.guide is not None]

    def law(self, speed: float) -> data.DriveLaw | None:  # noqa: ARG002
        """Return the law of the drive, whose start has a speed in rad/s or m/s; None drives nothing."""
        return None


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

    FITTING = ("final_speed_rad_s", "final_speed_m_s")

    kind: Literal["ramp"]
    final_speed_rad_s: float | None = None
    final_speed_m_s: float | None = None
    ramp_time_s: Positive

    def law(self, speed: float) -> data.DriveLaw:
        """Return the law of the drive."""
        return data.Ramp(speed, getattr(self, self.fitting), self.ramp_time_s)


class FluctuatingDrive(AnyDrive):
    """The speed is the start's plus a sine of the clock's t.

    It is ``amplitude_rad_s`` sin(2 pi ``frequency_Hz`` t + ``phase_rad``). What is slower than 1e-9 Hz is
    constant for as long as anybody waits.
    """

    FITTING = ("amplitude_rad_s", "amplitude_m_s")

    kind: Literal["fluctuating"]
    amplitude_rad_s: NonNegative | None = None
    amplitude_m_s: NonNegative | None = None
    frequency_Hz: Annotated[float, Field(ge=1e-9)]
    phase_rad: Angle = 0.0

    def law(self, speed: float) -> data.DriveLaw:
        """Return the law of the drive."""
        return data.Fluctuation(speed, getattr(self, self.fitting), self.frequency_Hz, self.phase_rad)


class TableDrive(AnyDrive, Table):
    """The body turns by a table: from the start's angle on, as ``angle_rad`` does from its first entry on.

    Between the entries the angle is a cubic spline of time. ``end_slopes`` are its speeds in rad/s at both
    ends. Without them it is not-a-knot there (de Boor's), but at rest at an end whose two angles are equal.
    Between straight lines the speed jumps: ``linear`` is for a constant speed alone.
    """

    COLUMNS = ("time_s", "angle_rad", "position_m")
    FITTING = ("angle_rad", "position_m")

    kind: Literal["table"]
    time_s: Numbers
    angle_rad: Angles | None = None
    position_m: Numbers | None = None
    end_slopes: Pair | None = None

    @model_validator(mode="after")
    def _moves_evenly(self) -> "TableDrive":
        """Refuse what is no table, and straight lines between which the speed jumps."""
        self.require_table("time_s", self.fitting)
        speeds = curve_of(self.course).c[2].tolist() if self.interpolation == "linear" else []
        for place, (before, after) in enumerate(pairwise(speeds), 1):
            jump = f"at time_s.{place} the speed would jump from {before:.4g} to {after:.4g}"
            same = abs(after - before) <= SAME_SPEED * max(map(abs, speeds))
            require(same, "interpolation", f"'spline' ({jump}, by an infinite force)", "linear")
        return self

    @property
    def course(self) -> data.Table:
        """The angle in rad, or the position in m, over the drive's clock in s."""
        return self.table("time_s", self.fitting)

    def law(self, speed: float) -> data.DriveLaw:  # noqa: ARG002
        """Return the law of the drive."""
        return data.Course(self.course)


class TorqueDrive(AnyDrive, Table):
    """A torque on the body, counter-clockwise positive: constant, or by a table over the clock's time."""

    COLUMNS = ("time_s", "torque_N_m")

    kind: Literal["torque"]
    torque_N_m: float | Numbers
    time_s: Numbers | None = None
    end_slopes: Pair | None = None

    @model_validator(mode="after")
    def _is_a_torque(self) -> "TorqueDrive":
        if isinstance(self.torque_N_m, tuple):
            self.require_table(*self.COLUMNS)
        else:
            require(self.time_s is None, "time_s", "nothing without a list torque_N_m", self.time_s)
        return self

    def law(self, speed: float) -> data.DriveLaw:  # noqa: ARG002
        """Return the law of the drive."""
        torque = self.torque_N_m
        return data.Torque(self.table(*self.COLUMNS) if isinstance(torque, tuple) else torque)


class MotorDrive(AnyDrive, Table):
    """A torque by the body's speed: linear through two points and beyond them, or by a table.

    At rest it is ``stall_torque_N_m``, at ``no_load_speed_rad_s`` none; faster than that the motor brakes. A
    table of ``torque_N_m`` over ``speed_rad_s`` has its end values beyond its ends.
    """

    COLUMNS = ("speed_rad_s", "torque_N_m")

    kind: Literal["motor"]
    stall_torque_N_m: float | None = None
    no_load_speed_rad_s: float | None = None
    speed_rad_s: Numbers | None = None
    torque_N_m: Numbers | None = None
    end_slopes: Pair | None = None

    @model_validator(mode="after")
    def _drives(self) -> "MotorDrive":
        by_table = self.speed_rad_s is not None or self.torque_N_m is not None
        when = f"{'beside' if by_table else 'without'} a table"
        stall, speed = self.stall_torque_N_m, self.no_load_speed_rad_s
        require_presence(not by_table, "stall_torque_N_m", stall, when)
        require_presence(not by_table, "no_load_speed_rad_s", speed, when)
        if by_table:
            self.require_table(*self.COLUMNS)
        elif stall is not None and speed is not None:
            require(stall != 0, "stall_torque_N_m", "a number other than 0", stall)
            expected = "a number of the sign of stall_torque_N_m, not 0"
            require(speed * math.copysign(1.0, stall) > 0, "no_load_speed_rad_s", expected, speed)
        return self

    def law(self, speed: float) -> data.DriveLaw:  # noqa: ARG002
        """Return the law of the drive."""
        if self.speed_rad_s is not None:
            return data.Motor(table=self.table(*self.COLUMNS))
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

    angle_rad: Named[Angle] = {}
    position_m: Named[float] = {}
    hold: Annotated[tuple[PartName, ...], Field(strict=False)] = ()
    speed_rad_s: Named[float] = {}
    speed_m_s: Named[float] = {}
    time_s: Clock = 0.0

    @property
    def states(self) -> dict[str, BodyState]:
        """The given states of bodies by their names."""
        return self.__pydantic_extra__


class Top(SceneData):
    """The top of a file, in both spellings. Gravity is a number along -y, or a pair along x and y."""

    name: Name
    end_time_s: Duration
    gravity_m_s2: Gravity = 0.0


class Sections(Top):
    """Any planar mechanism in motion: bodies that share pins, guides, springs, loads, a drive.

    ``observe`` is what the scene is about: a pin's x or y, a body's angle, or the way along a guide, as
    "B.x", "B.y", "body.angle" or "guide.along". ``turning`` is the body whose turns are revolutions, "" for
    none; it is the driven one unless it is named.
    """

    observe: str
    turning: str | None = None
    ground: Ground = Ground(pins_m={})
    body: Annotated[Named[Body], Field(min_length=1)]
    guide: Named[Guide] = {}
    spring: Named[Spring] = {}
    load: Named[Load] = {}
    drive: Drive = FreeDrive(kind="free")
    clearance: Named[Clearance] = {}
    start: PlacedStart = PlacedStart()

    @model_validator(mode="before")
    @classmethod
    def _has_parts_of_its_own(cls, data: object) -> object:
        """Refuse parts that no engine runs yet, and what is neither a key of the start nor a body."""
        if not isinstance(data, Mapping):
            return data
        names = {part: [*data[part]] for part in data if isinstance(data[part], Mapping)}
        later = [(part, name) for part in ("film", "friction") for name in names.get(part, ())]
        later += [
            ("clearance", name) for name in names.get("clearance", ()) if name in names.get("guide", ())
        ]
        for part, name in later:
            refuse(f"{part}.{name}", "nothing yet, which no engine runs so far", data[part][name])
        for name in names.get("start", ()):
            known = [*PlacedStart.model_fields, *names.get("body", ())]
            require_known(f"start.{name}", name, known, "a key of start or a body")
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

"""The parts of a scene's file, a class each: what they take, and what in one of them does not fit together.

A joint is a pin of the same name in two or more bodies, or in a body and the ground, each in axes of its own.
A place is one number, on the x axis of the body, or a pair of numbers. A number whose field's name has a unit
may be text with another one: ``"50 mm"``.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, model_validator

from engine_models.scene.plain_words import BadInput, expect, one_of, refusals, shown, unknown_key
from engine_models.scene.tables import read_columns
from engine_models.scene.units import in_own_units
from reference_solver.mechanism import data
from reference_solver.mechanism.contacts import DAMPING_FACTORS, NORMAL_LAWS
from reference_solver.mechanism.data import HERTZ_EXPONENT, LINEAR_LAWS, Interpolation

Value = TypeVar("Value")
Kind = TypeVar("Kind", bound="SceneData")

TURN = 2 * math.pi
#: A revolution in a table may be off by as much as five typed digits are, in rad; its forces by rounding.
REVOLUTION_RAD, CLOSES = 1e-4, 1e-9
#: Speeds of straight lines that differ by less than this part of the fastest are one, but for typed digits.
SAME_SPEED = 1e-6
#: What each kind of drive needs, of a body, and what it may have.
NEEDED: dict[str, tuple[str, ...]] = {
    "ramp": ("final_speed_rad_s", "ramp_time_s"),
    "fluctuating": ("amplitude_rad_s", "frequency_Hz"),
    "table": ("time_s", "angle_rad"),
    "torque": ("torque_N_m",),
    "motor": ("stall_torque_N_m", "no_load_speed_rad_s"),
}
MAY_HAVE = {"fluctuating": ("phase_rad",), "torque": ("time_s",)}
#: The units of the slopes at a table's ends, by the first of these columns that it has.
SLOPES = {"position_m": "m/s", "angle_rad": "rad/s", "force_N": "N/s", "speed_rad_s": "N m s/rad"}

#: Laws with a damping, and all laws: those of a function of their own, and those of a factor a(e), are named
#: where the solver has them.
DAMPED_LAWS = ("kelvin-voigt", *sorted(NORMAL_LAWS.keys() - {"dissipative"}))
LAWS = ("linear", "hertz", *DAMPED_LAWS, *DAMPING_FACTORS, "rigid")
FrictionLaw = Literal["saturated-linear", "ambrosio", "tanh"]


class SceneError(BadInput):
    """A scene was refused; each of the reasons names the field, what was expected and what came."""

    def __init__(self, *reasons: str) -> None:
        self.reasons = reasons
        super().__init__("; ".join(reasons))


def require(holds: bool, field: str, expected: str, came: object) -> None:
    """Refuse a field, in the words of ``plain_words``, unless a condition on it holds."""
    if not holds:
        got = f"{came:g}" if isinstance(came, float) else shown(came)
        raise ValueError(f"{field}: expected {expected}, got {got}")


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
#: Beyond 1e6 an angle's own spacing is more than 1e-10 rad, and a whole turn is not known that well either.
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]
#: What a drive's clock may read at the start: later, its own spacing is more than 1e-12 s.
Clock = Annotated[NonNegative, Field(le=1e4)]
#: Columns of a table; a list in a file.
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Angles = Annotated[tuple[Angle, ...], Field(strict=False)]
Pair = Annotated[tuple[float, float], Field(strict=False), expect("a list of two numbers")]
#: A place in a body's own axes.
Place = Annotated[float | Pair, expect("a finite number or a list of two")]
#: The name of a body, a pin, a guide or a spring; and parts or numbers by such names.
LETTERS = expect("a name of letters, digits, _ and -, a letter first")
PartName = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$"), LETTERS]
Named = dict[PartName, Value]


class SceneData(BaseModel):
    """Base of all parts of a scene: immutable, strict about types, unknown keys and non-finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _has_known_keys_and_own_units(cls, data: object, info: ValidationInfo) -> object:
        if not isinstance(data, Mapping):
            return data
        bodies = (info.context or {}).get("body", data) if cls.model_config["extra"] == "allow" else ()
        known = [*cls.model_fields, *bodies]
        if reasons := [unknown_key(key, known) for key in data if key not in known]:
            raise SceneError(*reasons)
        slopes = next((unit for column, unit in SLOPES.items() if data.get(column) is not None), "N m/s")
        exponent = data.get("exponent") or (1 if data.get("law") in LINEAR_LAWS else HERTZ_EXPONENT)
        return in_own_units(data, end_slopes=slopes, stiffness=f"N/m^{exponent}")

    @classmethod
    def checked(cls: type[Kind], data: Mapping[str, Any], folder: Path = Path(), **context: Any) -> Kind:
        """Return what a mapping describes, with tables in a folder; raise SceneError if it is none."""
        try:
            return cls.model_validate(data, context={"folder": folder, **context})
        except ValidationError as error:
            raise SceneError(*refusals(error)) from None

    def as_written(self) -> dict[str, Any]:
        """Return the fields that were given as a file has them, those of parts in mappings."""
        return self.model_dump(exclude_unset=True, exclude_none=True)

    def model_copy(self: Kind, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Kind:  # noqa: ARG002
        """Return a copy with other values in some fields, checked as if it had been read from a file."""
        return self.checked(self.as_written() | dict(update or {}))

    def require(self, holds: bool, name: str, expected: str) -> None:
        """Refuse a field unless a condition on it holds."""
        require(holds, name, expected, getattr(self, name))

    def require_if(self, needed: bool, name: str, when: str) -> None:
        """Refuse a field that is missing where it is needed, or there where it has no use."""
        expected = f"{'a value' if needed else 'nothing'} {when}"
        self.require((getattr(self, name) is not None) == needed, name, expected)


class Table(SceneData):
    """Columns of numbers, with a cubic spline between them, or straight lines; or a ``file`` of them."""

    #: The columns of a kind of table: the first one, and others of which there is one at least.
    COLUMNS: ClassVar[Mapping[object, tuple[str, ...]]] = {}

    interpolation: Interpolation = "spline"
    end_slopes: Pair | None = None
    file: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _has_the_columns_of_its_file(cls, data: object, info: ValidationInfo) -> object:
        kind = data.get("kind") if isinstance(data, Mapping) else None
        names = cls.COLUMNS.get(kind if isinstance(kind, str) else None)
        if not (isinstance(data, Mapping) and names and isinstance(file := data.get("file"), str)):
            return data
        beside = [name for name in names if name in data]
        require(not beside, "file", f"nothing beside {one_of(beside)}", file)
        try:
            columns = read_columns((info.context or {}).get("folder", Path()) / file, names)
        except BadInput as reason:
            raise ValueError(f"file: {reason}") from None
        return {key: value for key, value in data.items() if key != "file"} | columns

    @model_validator(mode="after")
    def _is_a_table(self) -> "Table":
        """Refuse columns that are missing, too short, of other lengths, or do not rise; and bad slopes."""
        x_name, *names = self.COLUMNS.get(getattr(self, "kind", None), ("interpolation",))
        x, columns = getattr(self, x_name), [name for name in names if isinstance(getattr(self, name), tuple)]
        if not columns and not isinstance(x, tuple) and None not in self.COLUMNS:  # numbers in its place
            return self
        self.require(x is not None, x_name, f"a value beside a list {one_of(names)}")
        self.require(columns != [], names[0], f"a list of {one_of(names)}")
        fewest = 4 if self.interpolation == "spline" else 2
        require(len(x) >= fewest, x_name, f"at least {fewest} numbers", len(x))
        for name in columns:
            count = len(getattr(self, name))
            require(count == len(x), name, f"as many numbers as {x_name} has, {len(x)}", count)
        for place, (before, after) in enumerate(pairwise(x), 1):
            require(after > before, f"{x_name}.{place}", f"a number > {before:g}, the one before", after)
        fit = self.end_slopes is None or (len(columns) == 1 and self.interpolation == "spline")
        self.require(fit, "end_slopes", "nothing with interpolation = 'linear', or with two columns")
        return self

    def table(self, x_name: str, y_name: str, period: float = 0.0) -> data.Table:
        """Return a column over another."""
        x, y = getattr(self, x_name), getattr(self, y_name)
        return data.Table(x, y, self.interpolation, self.end_slopes, period)


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


class Torsion(SceneData):
    """A torsion spring, and a rotational damper, from a body or the ground to another (``data.Torsion``)."""

    between: Annotated[tuple[PartName, PartName], Field(strict=False)]
    stiffness_N_m_rad: NonNegative
    free_angle_rad: Angle = 0.0
    damping_N_m_s: NonNegative = 0.0


class Friction(SceneData):
    """Friction in a joint with clearance, which rises over ``regularisation_speed_m_s`` from rest."""

    law: FrictionLaw
    coefficient: NonNegative
    regularisation_speed_m_s: Positive
    dead_band_speed_m_s: Positive | None = None

    @model_validator(mode="after")
    def _dead_band_belongs_to_ambrosio(self) -> "Friction":
        name, band, limit = "dead_band_speed_m_s", self.dead_band_speed_m_s, self.regularisation_speed_m_s
        self.require_if(self.law == "ambrosio", name, f"with law = '{self.law}'")
        self.require((band or 0.0) < limit, name, f"a number < regularisation_speed_m_s = {limit:g}")
        return self


class Clearance(SceneData):
    """A revolute joint whose pin has room in its bearing, on the body named first but for ``bearing``.

    ``stiffness`` is in N/m^exponent; without it, Hertz's value follows from the material that pin and bearing
    share. A law of the dissipative family may pull on a pin that leaves fast only if it ``may_pull``.
    """

    radial_clearance_m: Positive
    bearing_radius_m: Positive
    law: Literal[LAWS]  # type: ignore[valid-type]
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
        radius, rigid, when = self.bearing_radius_m, self.law == "rigid", f"with law = '{self.law}'"
        dissipates, is_linear = self.law in DAMPING_FACTORS, self.law in (*LINEAR_LAWS, "rigid")
        below = self.radial_clearance_m < radius
        self.require(below, "radial_clearance_m", f"a number < bearing_radius_m = {radius:g}")
        self.require(self.stiffness is None or not rigid, "stiffness", f"nothing {when}")
        by_material = not rigid and self.stiffness is None
        material = when if rigid else f"{'in place of' if by_material else 'beside'} stiffness"
        self.require_if(by_material, "young_modulus_Pa", material)
        self.require_if(by_material, "poisson_ratio", material)
        self.require_if(self.law in DAMPED_LAWS, "damping_N_s_m", when)
        self.require_if(dissipates or rigid, "restitution", when)
        try:
            DAMPING_FACTORS.get(self.law, float)(self.restitution or 0.0)
        except ZeroDivisionError:
            self.require(False, "restitution", f"a number > 0 {when}")
        self.require(dissipates or not self.may_pull, "may_pull", f"false or nothing {when}")
        self.require(not is_linear or self.exponent in (None, 1.0), "exponent", f"1 or nothing {when}")
        return self

    def data(self) -> data.ClearanceData:
        """Return the clearance as data of the mechanism."""
        of = self.friction
        rubbing = data.FrictionLaw(**of.model_dump(exclude_none=True)) if of else None
        return data.ClearanceData(**self.model_dump(exclude={"friction", "bearing"}), friction=rubbing)


class Gas(Table):
    """A force by the angle of a ``body``, the driven one unless it is named, over one revolution or two."""

    COLUMNS = {None: ("angle_rad", "force_N")}

    angle_rad: Angles = ()
    force_N: Numbers = ()
    body: PartName | None = None

    @property
    def by_angle(self) -> data.Table:
        """The table, which repeats after that of one revolution and two that is nearer to its length."""
        angle = getattr(self, name := self.COLUMNS[None][0])
        return self.table(name, "force_N", TURN if angle[-1] - angle[0] < 1.5 * TURN else 2 * TURN)

    @model_validator(mode="after")
    def _repeats(self) -> "Gas":
        name, table = self.COLUMNS[None][0], self.by_angle
        angle, force, last, end = table.x, table.y, len(table.x) - 1, table.x[0] + table.period
        turns = f"one revolution or two after the first, {angle[0] + TURN:.6g} or {angle[0] + 2 * TURN:.6g}"
        require(abs(angle[-1] - end) <= REVOLUTION_RAD, f"{name}.{last}", turns, angle[-1])
        closes = abs(force[-1] - force[0]) <= CLOSES * max(map(abs, force))
        require(closes, f"force_N.{last}", f"the first one again, {force[0]:g}", force[-1])
        self.require(self.end_slopes is None, "end_slopes", "nothing in a table that repeats")
        return self


class ByTime(Table):
    """A force in N, a torque in N m or both by the drive's clock, as a spline or straight lines."""

    COLUMNS = {None: ("time_s", "force_N", "torque_N_m")}

    time_s: Numbers = ()
    force_N: Numbers | None = None
    torque_N_m: Numbers | None = None


class Load(SceneData):
    """Forces along a line and torques on a body: any of them, together (see ``data.Load``).

    On a body in a guide they act at the guide's pin along it, and push back on what it is on; ``guide`` names
    one where the body has two. On another body they act on the centre of mass, or at a ``pin`` of the body,
    along ``along_rad`` from the x axis of the global frame.
    """

    force_N: float | None = None
    viscous_N_s_m: NonNegative | None = None
    spring_N_m: Positive | None = None
    free_position_m: float | None = None
    by_time: ByTime | None = None
    torque_N_m: float | None = None
    viscous_N_m_s: NonNegative | None = None
    guide: PartName | None = None
    pin: PartName | None = None
    along_rad: Angle | None = None
    gas: Gas | None = None

    @property
    def has_forces(self) -> bool:
        """Whether anything acts along a line."""
        by_time = self.by_time and self.by_time.force_N
        parts = (self.force_N, self.viscous_N_s_m, self.spring_N_m, self.gas, by_time)
        return any(part is not None for part in parts)

    @model_validator(mode="after")
    def _has_a_whole_spring(self) -> "Load":
        sprung = self.spring_N_m is not None
        self.require_if(sprung, "free_position_m", f"{'beside' if sprung else 'without'} spring_N_m")
        return self


class Drive(Table):
    """What drives a ``body``, the first of the file unless it is named, or a ``guide``'s body along it.

    Prescribed speeds are functions of time on the drive's clock (see ``data.DriveLaw``); of a body in rad/s,
    along a guide in m/s: fields with ``_m`` and ``_m_s`` take the place of those with ``_rad`` there. A
    ``table`` turns the body from the start's angle on, as ``angle_rad`` does from its first entry on. Between
    straight lines the speed jumps: ``linear`` is for a constant speed alone. A fluctuation slower than 1e-9
    Hz is constant for as long as anybody waits. Torques are counter-clockwise positive.
    """

    COLUMNS = {
        "table": ("time_s", "angle_rad", "position_m"),
        "torque": ("time_s", "torque_N_m"),
        "motor": ("speed_rad_s", "torque_N_m"),
    }

    kind: Literal["free", "constant-speed", "ramp", "fluctuating", "table", "torque", "motor"]
    body: PartName | None = None
    guide: PartName | None = None
    final_speed_rad_s: float | None = None
    final_speed_m_s: float | None = None
    ramp_time_s: Positive | None = None
    amplitude_rad_s: NonNegative | None = None
    amplitude_m_s: NonNegative | None = None
    frequency_Hz: Annotated[float, Field(ge=1e-9)] | None = None
    phase_rad: Angle = 0.0
    time_s: Numbers | None = None
    angle_rad: Angles | None = None
    position_m: Numbers | None = None
    torque_N_m: Annotated[float | Numbers, expect("a finite number or a list of them")] | None = None
    stall_torque_N_m: float | None = None
    no_load_speed_rad_s: float | None = None
    speed_rad_s: Numbers | None = None

    @model_validator(mode="after")
    def _fits_its_kind(self) -> "Drive":
        kind, along = self.kind, self.guide is not None
        self.require(not along or self.body is None, "body", "nothing beside guide")
        acts = not along or kind not in ("torque", "motor")
        self.require(acts, "guide", "nothing with a torque, which acts on a body")
        table, by_speed = self.COLUMNS.get(kind, ()), self.speed_rad_s is not None
        of_body = table if by_speed else NEEDED.get(kind, ())
        of_guide = [name.replace("rad_s", "m_s").replace("angle_rad", "position_m") for name in of_body]
        needed = of_guide if along else of_body
        may = {"kind", "body", "guide", *needed, *MAY_HAVE.get(kind, ())}
        may |= {"interpolation", "end_slopes"} if table else set()
        when = f"with kind = '{kind}'{' along a guide' if along else ' by a table' if by_speed else ''}"
        reasons, missing = list[str](), list[str]()
        for name, field in type(self).model_fields.items():
            came, given = getattr(self, name), getattr(self, name) != field.default
            if given and name not in may:
                reasons.append(f"{name}: expected nothing {when}, got {shown(came)}")
            if not given and name in needed:
                missing.append(f"{name}: expected a value {when}, got nothing")
        if reasons + missing:
            raise SceneError(*reasons, *missing)
        if kind == "table" and self.interpolation == "linear":
            speeds = np.diff(getattr(self, table[2 if along else 1])) / np.diff(self.time_s or ())
            even = bool(np.ptp(speeds) <= SAME_SPEED * abs(speeds).max())
            self.require(even, "interpolation", "'spline' (else the speed would jump, by an infinite force)")
        if (stall := self.stall_torque_N_m) is not None:
            self.require(stall != 0, "stall_torque_N_m", "a number other than 0")
            same = (self.no_load_speed_rad_s or 0.0) * math.copysign(1.0, stall) > 0
            self.require(same, "no_load_speed_rad_s", "a number of the sign of stall_torque_N_m, not 0")
        return self


class BodyState(SceneData):
    """Where a body's centre of mass is, and how fast it moves."""

    x_m: float
    y_m: float
    angle_rad: Angle
    velocity_x_m_s: float
    velocity_y_m_s: float
    angular_velocity_rad_s: float


class PlacedStart(SceneData):
    """Where the motion begins, and how fast: what is told, or by its name the state of every body.

    Values told are rough, unless their bodies, guides or pins are named in ``hold``: the mechanism is put
    together as near to them as its joints allow. ``time_s`` is what the drive's clock reads then.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, BodyState] = Field(init=False)

    angle_rad: Named[Angle] = {}
    position_m: Named[float] = {}
    place_m: Named[Place] = {}
    hold: Annotated[tuple[PartName, ...], Field(strict=False)] = ()
    speed_rad_s: Named[float] = {}
    speed_m_s: Named[float] = {}
    time_s: Clock = 0.0

    @property
    def states(self) -> dict[str, BodyState]:
        """The given states of bodies by their names."""
        return self.__pydantic_extra__


class Top(SceneData):
    """The top of a file, in both spellings. Gravity is a number along -y, or a pair along x and y.

    Names begin cells of CSV files, and spreadsheets run what begins as a formula does.
    """

    name: Annotated[str, Field(pattern=r"^[^\s=+\-@＝＋－＠]"), expect("text, first no blank, =, +, - or @")]
    end_time_s: Annotated[float, Field(gt=0, ge=1e-100)]
    gravity_m_s2: Annotated[NonNegative | Pair, expect("a finite number >= 0 or a list of two")] = 0.0

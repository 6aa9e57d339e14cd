"""The parts of any planar mechanism, as a file has them: bodies, guides, springs, clearances, a start.

A joint is a pin of the same name in two or more bodies, or in a body and the ground, each in axes of its own.
A place is one number, on the x axis of the body, or a pair of numbers.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, TypeVar, get_args

import tomli_w
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.data import (
    Angle,
    Duration,
    Fraction,
    Named,
    NonNegative,
    PartName,
    Parts,
    Positive,
    SceneData,
    require,
    require_presence,
    with_fields,
)
from engine_models.scene.drives import PRESCRIBED, Drive, FreeDrive
from engine_models.scene.loads import Load
from engine_models.scene.plain_words import expect, one_of, shown
from reference_solver.mechanism.data import HERTZ_EXPONENT, MechanismData, Point
from reference_solver.mechanism.data import LINEAR_LAWS as LINEAR_LAWS
from reference_solver.mechanism.data import Guide as Line

Pair = Annotated[tuple[float, float], Field(strict=False)]
#: A place in a body's own axes.
Place = Annotated[float | Pair, expect("a finite number or a list of two")]
#: Places by the names of pins, of whom it has one at least.
Places = Annotated[Named[Place], expect("places by the names of pins, as { A = 0.1 }")]
#: What a drive's clock may read at the start: later, its own spacing is more than 1e-12 s.
LATEST_CLOCK_S = 1e4
Clock = Annotated[float, Field(ge=0, le=LATEST_CLOCK_S)]

ContactLaw = Literal[
    "linear",
    "kelvin-voigt",
    "hertz",
    "hunt-crossley",
    "lankarani-nikravesh",
    "gonthier",
    "zhiying-qishao",
    "flores",
    "hu-guo",
    "carvalho-martins",
    "rigid",
]
FrictionLaw = Literal["saturated-linear", "ambrosio", "tanh"]
_FRICTION_LAWS = one_of([shown(law) for law in get_args(FrictionLaw)])

#: Laws that know no restitution, and laws whose damping factor divides by it.
LAWS_WITHOUT_RESTITUTION: tuple[ContactLaw, ...] = ("linear", "kelvin-voigt", "hertz")
LAWS_DIVIDING_BY_RESTITUTION: tuple[ContactLaw, ...] = ("gonthier", "flores", "hu-guo")


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
    restitution: Fraction | None = None
    minimum_impact_speed_m_s: Positive | None = None
    may_pull: bool = False
    friction: Friction | None = None
    bearing: PartName | None = None

    @classmethod
    def units_of(cls, data: Mapping[str, object]) -> dict[str, str]:
        """Return the unit of the stiffness, by the exponent."""
        exponent = data.get("exponent") or (1 if data.get("law") in LINEAR_LAWS else HERTZ_EXPONENT)
        return {"stiffness": f"N/m^{exponent}"}

    @model_validator(mode="after")
    def _hangs_together(self) -> "Clearance":
        c, radius = self.radial_clearance_m, self.bearing_radius_m
        require(c < radius, "radial_clearance_m", f"a number < bearing_radius_m = {radius:g}", c)
        self._has_one_stiffness()
        law, e, with_law = self.law, self.restitution, f"with law = '{self.law}'"
        require_presence(law == "kelvin-voigt", "damping_N_s_m", self.damping_N_s_m, with_law)
        require_presence(law not in LAWS_WITHOUT_RESTITUTION, "restitution", e, with_law)
        if law in LAWS_DIVIDING_BY_RESTITUTION:
            require(e != 0, "restitution", f"a number > 0 {with_law}", e)
        if self.may_pull and (law in LAWS_WITHOUT_RESTITUTION or law == "rigid"):
            raise ValueError(f"may_pull: expected false or nothing {with_law}, got true")
        if law in ("linear", "kelvin-voigt", "rigid"):
            require(self.exponent in (None, 1.0), "exponent", f"1 or nothing {with_law}", self.exponent)
        return self

    def _has_one_stiffness(self) -> None:
        """Require the stiffness or the material, but none of them for a rigid contact."""
        stiffness, by_material = self.stiffness, self.law != "rigid" and self.stiffness is None
        when = f"{'beside' if stiffness else 'without'} stiffness"
        if self.law == "rigid":
            when = "with law = 'rigid'"
            require_presence(False, "stiffness", stiffness, when)
        require_presence(by_material, "young_modulus_Pa", self.young_modulus_Pa, when)
        require_presence(by_material, "poisson_ratio", self.poisson_ratio, when)


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


#: Names begin cells of CSV files, and spreadsheets run what begins as a formula does.
NAME_IN_WORDS = "a string that is not empty and begins with neither a blank nor =, +, - or @"
Name = Annotated[str, Field(pattern=r"^[^\s=+\-@＝＋－＠]"), expect(NAME_IN_WORDS)]
T = TypeVar("T", bound="AnyScene")
Gravity = Annotated[NonNegative | Pair, expect("a finite number >= 0 or a list of two")]
Observe = Annotated[str, expect('a name and what of it, as "B.x", "B.y", "body.angle" or "guide.along"')]


@dataclass(frozen=True)
class Observed:
    """What a scene is about, by its name: a coordinate of a point of a body, its angle, or a guide's way.

    Tolerances, errors and studies are of this quantity.
    """

    name: str
    what: Literal["x", "y", "angle", "along"]
    body: int
    point: Point = (0.0, 0.0)
    guide: Line | None = None

    @property
    def unit(self) -> str:
        """The unit: rad of an angle, else m."""
        return "rad" if self.what == "angle" else "m"


class AnyScene(SceneData):
    """One mechanism in motion, from its start to its end.

    Gravity is a number along -y, or a pair along x and y.
    """

    name: Name
    end_time_s: Duration
    gravity_m_s2: Gravity = 0.0

    @check_arguments
    def replace(self: T, field: str | Mapping[str, object], value: object = None) -> T:
        """Return the scene with another value in a field: ``replace("clearance.B.restitution", 0.5)``.

        Several fields, checked together, are given as a mapping. None takes a part away, and what there is
        not yet comes to be: ``replace("clearance.B", None)`` makes a joint ideal.

        Raises:
            SceneError: with the new values it is no scene.
        """
        fields = {field: value} if isinstance(field, str) else field
        return self.checked(with_fields(self.model_dump(exclude_none=True), fields))

    def with_clearances(self: T, rooms: Mapping[str, Clearance]) -> T:
        """Return the scene with other clearances of joints that have one."""
        changed = {name: room for name, room in rooms.items() if room != self.clearances[name]}
        fields = {f"clearance.{name}": room.model_dump(exclude_none=True) for name, room in changed.items()}
        return self.replace(fields) if fields else self

    def to_toml(self) -> str:
        """Return the scene as a TOML file that reads back to an equal scene."""
        data = self.model_dump(exclude_none=True, exclude_unset=False)
        return tomli_w.dumps(_without_empty(data))

    @property
    def gravity(self) -> Point:
        """Gravity as an acceleration (x, y) in m/s^2."""
        own = self.gravity_m_s2
        return own if isinstance(own, tuple) else (0.0, -own)

    @cached_property
    def mechanism(self) -> MechanismData:
        """The mechanism by names, from which engines build it."""
        return self._mechanism()

    def _mechanism(self) -> MechanismData:
        raise NotImplementedError

    def __copy__(self: T) -> T:
        """Return a copy that knows nothing of what follows from its fields, as others may be put into it."""
        copy = super().__copy__()
        for name in self.__dict__.keys() - type(self).model_fields.keys():
            del copy.__dict__[name]
        return copy

    @property
    def observed(self) -> Observed:
        """What the scene is about."""
        raise NotImplementedError

    @property
    def turning_body(self) -> int | None:
        """The number of the body whose turns are revolutions, None where time is the unit."""
        raise NotImplementedError

    @property
    def driven_by(self) -> Drive:
        """What drives the mechanism."""
        raise NotImplementedError

    @property
    def clearances(self) -> dict[str, Clearance]:
        """The clearances of the joints that have one, by the joints' names, in their order."""
        raise NotImplementedError

    @property
    def is_plain(self) -> bool:
        """Whether it is a crank-slider on a guide along +x through joint O, or a pendulum: see ``Scene``."""
        return self.general_by is None

    @cached_property
    def general_by(self) -> str | None:
        """The first entry by which the mechanism is another than a plain crank-slider or pendulum, if any."""
        return "body"

    @property
    def speed_is_prescribed(self) -> bool:
        """Whether the driver keeps a speed, constant or not, whatever that takes."""
        return self.driven_by.kind in PRESCRIBED

    @property
    def clock_s(self) -> float:
        """What the drive's clock reads as a run begins."""
        raise NotImplementedError

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in their order."""
        return tuple(pin.name for pin in self.mechanism.pins)

    @property
    def joints_with_clearance(self) -> tuple[str, ...]:
        """Names of the joints with clearance, in their order."""
        return tuple(self.clearances)


def _without_empty(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a mapping without empty ones, at any depth."""
    parts = {name: _without_empty(part) if isinstance(part, dict) else part for name, part in data.items()}
    return {name: part for name, part in parts.items() if part != {}}


class GeneralParts(AnyScene):
    """The parts of a scene in the general form, whether they fit each other or not."""

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

    @property
    def driven_by(self) -> Drive:
        """What drives the mechanism."""
        return self.drive

    @property
    def clock_s(self) -> float:
        """What the drive's clock reads as a run begins."""
        return self.start.time_s or 0.0

"""The physics of a planar crank-slider, or of a pendulum, as frozen, validated data: no engine's setting.

Conventions. SI units. The crank turns about joint O at the origin, the slider moves along the x axis,
gravity acts along -y. Angles are counter-clockwise from +x. Joint A connects crank and rod, joint B rod and
slider; the slider's centre of mass is its pin B. A link's centre of mass lies on the line of its joints, at
the given distance from its first joint (O for the crank, A for the rod). A pendulum is a crank alone, hanging
from joint O.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal

import tomli_w
from pydantic import Field, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.data import (
    Angle,
    Duration,
    Fraction,
    NonNegative,
    Positive,
    SceneData,
    require,
    require_presence,
    with_fields,
)
from engine_models.scene.drives import PRESCRIBED, Drive, TableDrive
from engine_models.scene.loads import Loads
from engine_models.scene.plain_words import expect
from engine_models.scene.units import in_own_units

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

#: Laws whose exponent is 1 unless another is given, and the exponent of the others.
LINEAR_LAWS, HERTZ_EXPONENT = ("linear", "kelvin-voigt"), 1.5
#: Laws that know no restitution, and laws whose damping factor divides by it.
LAWS_WITHOUT_RESTITUTION: tuple[ContactLaw, ...] = ("linear", "kelvin-voigt", "hertz")
LAWS_DIVIDING_BY_RESTITUTION: tuple[ContactLaw, ...] = ("gonthier", "flores", "hu-guo")

#: A table may end before its scene by rounding, and begin at another speed than its scene says by this part
#: of the fastest in it: a coarse one is not differentiated more sharply, other units are far off.
ROUND_OFF, ALIKE = 1e-12, 0.1
#: Names begin cells of CSV files, and spreadsheets run what begins as a formula does.
NAME_IN_WORDS = "a string that is not empty and begins with neither a blank nor =, +, - or @"
Name = Annotated[str, Field(pattern=r"^[^\s=+\-@＝＋－＠]"), expect(NAME_IN_WORDS)]
#: What a drive's clock may read at the start: later, its own spacing is more than 1e-12 s.
LATEST_CLOCK_S = 1e4


class Link(SceneData):
    """A rigid link between two pins; inertia about its centre of mass."""

    length_m: Positive
    mass_kg: Positive
    inertia_kg_m2: Positive
    centre_of_mass_m: float


class Slider(SceneData):
    """The block on the guide; the inertia matters only to a model that lets it turn."""

    mass_kg: Positive
    inertia_kg_m2: Positive


class BodyState(SceneData):
    """Where a body's centre of mass is, and how fast it moves."""

    x_m: float
    y_m: float
    angle_rad: Angle
    velocity_x_m_s: float
    velocity_y_m_s: float
    angular_velocity_rad_s: float


class Start(SceneData):
    """Crank angle and speed at t = 0; everything else follows from the ideal joints.

    Or every body's own state is given, for a start that is elsewhere in its clearances; ``crank_speed_rad_s``
    is then that of the drive alone. ``time_s`` is what the drive's clock reads at t = 0; nothing is 0. Where
    the speed fluctuates, ``crank_speed_rad_s`` is the one about which it does.
    """

    crank_angle_rad: Angle
    crank_speed_rad_s: float
    time_s: Annotated[float, Field(ge=0, le=LATEST_CLOCK_S)] | None = None
    crank: BodyState | None = None
    rod: BodyState | None = None
    slider: BodyState | None = None

    @property
    def states(self) -> tuple[BodyState, ...]:
        """The bodies' given states in the order crank, rod, slider."""
        return tuple(state for state in (self.crank, self.rod, self.slider) if state is not None)


class Friction(SceneData):
    """Friction in a joint with clearance; the dead band belongs to Ambrosio's law alone."""

    law: FrictionLaw
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
    dissipative family may pull on a pin that leaves fast: the force is zero there unless ``may_pull``.
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

    @model_validator(mode="before")
    @classmethod
    def _has_stiffness_in_its_unit(cls, data: object) -> object:
        if not isinstance(data, Mapping):
            return data
        exponent = data.get("exponent") or (1 if data.get("law") in LINEAR_LAWS else HERTZ_EXPONENT)
        return in_own_units(data, stiffness=f"N/m^{exponent}")

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


class Clearances(SceneData):
    """The joints with clearance; a joint that is not named is ideal."""

    O: Clearance | None = None  # noqa: E741  the joint's name in the field
    A: Clearance | None = None
    B: Clearance | None = None


class Scene(SceneData):
    """One crank-slider in motion: bodies, joints, loads, drive, start and end.

    Without rod and slider it is a physical pendulum: the crank alone, in joint O.
    """

    name: Name
    end_time_s: Duration
    gravity_m_s2: NonNegative = 0.0
    crank: Link
    rod: Link | None = None
    slider: Slider | None = None
    start: Start
    drive: Drive
    load: Loads = Loads()
    clearance: Clearances = Clearances()

    @model_validator(mode="after")
    def _is_a_mechanism(self) -> "Scene":
        self._can_be_assembled()
        if isinstance(self.drive, TableDrive):
            self._is_in_the_table(self.drive)
        return self

    def _is_in_the_table(self, table: TableDrive) -> None:
        """Require a table that lasts as long as the scene, which begins at the table's own speed."""
        begin, time, angle = self.start.time_s or 0.0, table.time_s, table.angle_rad
        require(time[0] <= begin, "drive.time_s.0", f"a number <= {begin:g}, when the scene begins", time[0])
        end, expected = begin + self.end_time_s, f"at least {begin + self.end_time_s:g}, when the scene ends"
        require(time[-1] >= end * (1 - ROUND_OFF), f"drive.time_s.{len(time) - 1}", expected, time[-1])
        rises = zip(pairwise(time), pairwise(angle), strict=True)
        fastest = max(abs((b - a) / (t - s)) for (s, t), (a, b) in rises)
        speed, own = self.start.crank_speed_rad_s, float(table.spline()(begin, 1))
        expected = f"the speed of the drive's table when the scene begins, {own:.4g}"
        require(abs(speed - own) <= ALIKE * fastest, "start.crank_speed_rad_s", expected, speed)

    def _can_be_assembled(self) -> None:
        if self.start.states and len(self.start.states) != 1 + 2 * (self.rod is not None):
            raise ValueError("start: expected the state of every body or of none, got some")
        if self.rod is None or self.slider is None:
            self._is_a_pendulum()
            return
        crank, rod = self.crank.length_m, self.rod.length_m
        if self.drive.kind != "free":
            expected = f"at least crank.length_m = {crank:g} with drive.kind = '{self.drive.kind}'"
            require(rod >= crank, "rod.length_m", f"{expected} (else the crank cannot turn)", rod)
        height = abs(crank * math.sin(self.start.crank_angle_rad))
        expected = f"more than crank.length_m |sin(start.crank_angle_rad)| = {height:g}"
        require(rod > height, "rod.length_m", f"{expected} (else the rod cannot reach the guide)", rod)

    def _is_a_pendulum(self) -> None:
        missing, there = ("rod", "slider") if self.rod is None else ("slider", "rod")
        if getattr(self, there) is not None:
            raise ValueError(f"{missing}: expected a section beside {there}, got nothing")
        for joint in ("A", "B"):
            if getattr(self.clearance, joint) is not None:
                raise ValueError(f"clearance.{joint}: expected nothing without rod and slider, got a section")
        if self.load.slider is not None:
            raise ValueError("load.slider: expected nothing without rod and slider, got a section")

    @check_arguments
    def replace(self, field: str | Mapping[str, object], value: object = None) -> "Scene":
        """Return the scene with another value in a field: ``replace("clearance.B.restitution", 0.5)``.

        Several fields, checked together, are given as a mapping. None takes a part away, and what there is
        not yet comes to be: ``replace("clearance.B", None)`` makes a joint ideal.

        Raises:
            SceneError: with the new values it is no scene.
        """
        fields = {field: value} if isinstance(field, str) else field
        return self.checked(with_fields(self.model_dump(exclude_none=True), fields))

    def to_toml(self) -> str:
        """Return the scene as a TOML file that reads back to an equal scene."""
        data = self.model_dump(exclude_none=True)
        return tomli_w.dumps({name: part for name, part in data.items() if part != {}})

    @property
    def is_crank_slider(self) -> bool:
        """Whether there are a rod and a slider; otherwise the scene is a pendulum."""
        return self.rod is not None

    def crank_slider(self) -> tuple[Link, Link, Slider]:
        """Return crank, rod and slider.

        Raises:
            ValueError: the scene is a pendulum.
        """
        if self.rod is None or self.slider is None:
            raise ValueError(f"scene {self.name}: expected a crank-slider, got a pendulum")
        return self.crank, self.rod, self.slider

    @property
    def speed_is_prescribed(self) -> bool:
        """Whether the driver keeps the crank's speed, constant or not, whatever torque that takes."""
        return self.drive.kind in PRESCRIBED

    @property
    def bodies(self) -> tuple[Link | Slider, ...]:
        """The bodies in the order crank, rod, slider, or the crank alone."""
        return self.crank_slider() if self.is_crank_slider else (self.crank,)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints: O, A, B, or O alone."""
        return ("O", "A", "B") if self.is_crank_slider else ("O",)

    @property
    def joints_with_clearance(self) -> tuple[str, ...]:
        """Names of the joints with clearance, in the order O, A, B."""
        return tuple(name for name in self.joints if getattr(self.clearance, name) is not None)

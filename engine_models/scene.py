"""The physics of a planar crank-slider as frozen, validated data: no engine's setting appears here.

Conventions. SI units. The crank turns about joint O at the origin, the slider moves along the x axis,
gravity acts along -y. Angles are counter-clockwise from +x. Joint A connects crank and rod, joint B rod and
slider; the slider's centre of mass is its pin B. A link's centre of mass lies on the line of its joints, at
the given distance from its first joint (O for the crank, A for the rod).
"""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]

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

#: Laws whose damping factor divides by the restitution.
LAWS_NEEDING_RESTITUTION: tuple[ContactLaw, ...] = ("gonthier", "flores", "hu-guo")


class SceneData(BaseModel):
    """Base of all parts of a scene: immutable, strict about types, unknown keys and non-finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


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


class Start(SceneData):
    """Crank angle and speed at t = 0; everything else follows from the ideal joints."""

    crank_angle_rad: float
    crank_speed_rad_s: float


class FreeDrive(SceneData):
    """Nothing drives the crank."""

    kind: Literal["free"]


class ConstantSpeedDrive(SceneData):
    """The crank keeps the speed it starts with."""

    kind: Literal["constant-speed"]


class TorqueDrive(SceneData):
    """A constant torque on the crank, counter-clockwise positive."""

    kind: Literal["torque"]
    torque_N_m: float


Drive = Annotated[FreeDrive | ConstantSpeedDrive | TorqueDrive, Field(discriminator="kind")]


class Friction(SceneData):
    """Friction in a joint with clearance; the dead band belongs to Ambrosio's law alone."""

    law: FrictionLaw
    coefficient: NonNegative
    regularisation_speed_m_s: Positive
    dead_band_speed_m_s: Positive | None = None

    @model_validator(mode="after")
    def _dead_band_belongs_to_ambrosio(self) -> "Friction":
        if (self.law == "ambrosio") != (self.dead_band_speed_m_s is not None):
            raise ValueError("dead_band_speed_m_s goes with law = 'ambrosio', which needs it")
        if self.dead_band_speed_m_s is not None and self.dead_band_speed_m_s >= self.regularisation_speed_m_s:
            raise ValueError("dead_band_speed_m_s must be below regularisation_speed_m_s")
        return self


class Clearance(SceneData):
    """A revolute joint whose pin has room in its bearing.

    ``stiffness`` is in N/m^exponent; without it, Hertz's value follows from the material that pin and bearing
    share. ``exponent`` defaults to 1 for the linear and Kelvin-Voigt laws, else to 3/2.
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
    friction: Friction | None = None

    @model_validator(mode="after")
    def _hangs_together(self) -> "Clearance":
        if self.radial_clearance_m >= self.bearing_radius_m:
            raise ValueError("radial_clearance_m must be below bearing_radius_m (the pin has the difference)")
        material = (self.young_modulus_Pa is not None, self.poisson_ratio is not None)
        if self.law == "rigid":
            if self.stiffness is not None or any(material):
                raise ValueError("law = 'rigid' takes no stiffness, young_modulus_Pa or poisson_ratio")
        elif self.stiffness is None and not all(material):
            raise ValueError("give stiffness, or young_modulus_Pa and poisson_ratio")
        elif self.stiffness is not None and any(material):
            raise ValueError("give either stiffness or young_modulus_Pa and poisson_ratio, not both")
        if (self.law == "kelvin-voigt") != (self.damping_N_s_m is not None):
            raise ValueError("damping_N_s_m goes with law = 'kelvin-voigt', which needs it")
        if self.law in ("linear", "kelvin-voigt", "hertz"):
            if self.restitution is not None:
                raise ValueError(f"law = '{self.law}' takes no restitution")
        elif self.restitution is None:
            raise ValueError(f"law = '{self.law}' needs restitution")
        if self.law in LAWS_NEEDING_RESTITUTION and self.restitution == 0:
            raise ValueError(f"law = '{self.law}' needs restitution above 0")
        if self.law in ("linear", "kelvin-voigt", "rigid") and self.exponent not in (None, 1.0):
            raise ValueError(f"law = '{self.law}' takes no exponent but 1")
        return self


class Clearances(SceneData):
    """The joints with clearance; a joint that is not named is ideal."""

    O: Clearance | None = None  # noqa: E741  the joint's name in the field
    A: Clearance | None = None
    B: Clearance | None = None


class Scene(SceneData):
    """One crank-slider in motion: bodies, joints, loads, drive, start and end."""

    name: Annotated[str, Field(min_length=1)]
    end_time_s: Positive
    gravity_m_s2: NonNegative = 0.0
    crank: Link
    rod: Link
    slider: Slider
    start: Start
    drive: Drive
    clearance: Clearances = Clearances()

    @model_validator(mode="after")
    def _can_be_assembled(self) -> "Scene":
        crank, rod = self.crank.length_m, self.rod.length_m
        if rod < crank and self.drive.kind != "free":
            raise ValueError(
                f"rod.length_m must be at least crank.length_m = {crank:g} with drive.kind = "
                f"'{self.drive.kind}' (the crank could not turn), got {rod:g}"
            )
        if rod <= abs(crank * math.sin(self.start.crank_angle_rad)):
            raise ValueError(
                f"start.crank_angle_rad = {self.start.crank_angle_rad:g} puts pin A at or beyond the rod's "
                f"reach: rod.length_m = {rod:g} must exceed crank.length_m |sin(crank_angle_rad)|"
            )
        return self

    @property
    def joints_with_clearance(self) -> tuple[str, ...]:
        """Names of the joints with clearance, in the order O, A, B."""
        return tuple(name for name in ("O", "A", "B") if getattr(self.clearance, name) is not None)

"""What drives a mechanism, as data: nothing, a torque on a body, or a motion of a body or along a guide.

A driver that prescribes the motion keeps it whatever it takes. Prescribed speeds are functions of time on the
drive's clock, which reads ``start.time_s`` as a run begins. On a body they are in rad/s, along a guide in
m/s: fields with ``_m`` and ``_m_s`` take the place of those with ``_rad`` and ``_rad_s`` there.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from engine_models.scene.data import (
    Angle,
    Angles,
    NonNegative,
    Numbers,
    PartName,
    Positive,
    SceneData,
    require,
    require_column,
    require_presence,
    require_slopes,
    require_table,
)
from engine_models.scene.plain_words import shown
from reference_solver.mechanism.curves import table_curve
from reference_solver.mechanism.data import Interpolation

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


#: What is slower is constant for as long as anybody waits.
LOWEST_FREQUENCY_HZ = 1e-9
#: What a table of a torque is unless another interpolation is given.
SPLINE: Interpolation = "spline"
#: Speeds of straight lines that differ by less than this part of the fastest are one, but for typed digits.
SAME_SPEED = 1e-6


class AnyDrive(SceneData):
    """What is driven: a ``body``, the first of the file unless it is named, or a guide's body along it."""

    body: PartName | None = None
    guide: PartName | None = None

    @model_validator(mode="after")
    def _drives_one_thing(self) -> "AnyDrive":
        if self.guide is not None and self.body is not None:
            raise ValueError(f"body: expected nothing beside guide, got {shown(self.body)}")
        return self

    def _fitting(self, by_body: str, by_guide: str) -> float:
        """Return the number of the field that fits what is driven; the other one is to be absent."""
        name, other = (by_body, by_guide) if self.guide is None else (by_guide, by_body)
        when = "without guide" if self.guide is None else "beside guide"
        require_presence(False, other, getattr(self, other), when)
        require_presence(True, name, getattr(self, name), when)
        return float(getattr(self, name))


class FreeDrive(AnyDrive):
    """Nothing drives the mechanism."""

    kind: Literal["free"]


class ConstantSpeedDrive(AnyDrive):
    """What is driven keeps the speed that it starts with."""

    kind: Literal["constant-speed"]


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
        self.final_speed  # noqa: B018  refuses
        return self

    @property
    def final_speed(self) -> float:
        """The speed at the end, in rad/s or m/s."""
        return self._fitting("final_speed_rad_s", "final_speed_m_s")


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
        self.amplitude  # noqa: B018  refuses
        return self

    @property
    def amplitude(self) -> float:
        """The amplitude, in rad/s or m/s."""
        return self._fitting("amplitude_rad_s", "amplitude_m_s")


class TableDrive(AnyDrive):
    """The body turns by a table: from the start's angle on, as ``angle_rad`` does from its first entry on.

    Between the entries the angle is a cubic spline of time. ``end_slopes`` are its speeds in rad/s at both
    ends. Without them it is not-a-knot there (de Boor's), but at rest at an end whose two angles are equal.
    Between straight lines the speed jumps: ``linear`` is for a constant speed alone.
    """

    kind: Literal["table"]
    time_s: Numbers
    angle_rad: Angles | None = None
    position_m: Numbers | None = None
    interpolation: Interpolation = "spline"
    end_slopes: Numbers | None = None

    @classmethod
    def units_of(cls, data: Mapping[str, object]) -> dict[str, str]:
        """Return the unit of the slopes at the ends."""
        return {"end_slopes": "rad/s" if data.get("guide") is None else "m/s"}

    @model_validator(mode="after")
    def _is_a_table(self) -> "TableDrive":
        require_table("time_s", self.time_s, self.column, self.values, self.interpolation)
        require_slopes(self.end_slopes, self.interpolation)
        if self.interpolation == "linear":
            self._turns_evenly()
        return self

    def _turns_evenly(self) -> None:
        """Refuse straight lines between which the speed jumps."""
        speeds, unit = self.spline().c[2].tolist(), "rad/s" if self.guide is None else "m/s"
        for place, (before, after) in enumerate(pairwise(speeds), 1):
            if abs(after - before) > SAME_SPEED * max(map(abs, speeds)):
                jump = f"at time_s.{place} the speed would jump from {before:.4g} to {after:.4g} {unit}"
                of = "torque" if self.guide is None else "force"
                raise ValueError(
                    f"interpolation: expected 'spline' ({jump}, by an infinite {of}), got 'linear'"
                )

    @property
    def column(self) -> str:
        """The name of the driven column."""
        return "angle_rad" if self.guide is None else "position_m"

    @property
    def values(self) -> tuple[float, ...]:
        """The angles in rad, or positions in m."""
        column, other = self.column, "position_m" if self.guide is None else "angle_rad"
        if getattr(self, other) is not None or getattr(self, column) is None:
            if getattr(self, other) is not None:
                when = "without guide" if self.guide is None else "beside guide"
                raise ValueError(f"{other}: expected nothing {when}, got a list")
            raise ValueError(f"{column}: expected a list of numbers, got nothing")
        return tuple(getattr(self, column))

    def spline(self) -> "PPoly":
        """Return the angle in rad, or the position in m, over the drive's clock in s."""
        return table_curve(self.time_s, self.values, self.interpolation, self.end_slopes)


class TorqueDrive(AnyDrive):
    """A torque on the body, counter-clockwise positive: constant, or by a table over the clock's time."""

    kind: Literal["torque"]
    torque_N_m: float | Numbers
    time_s: Numbers | None = None
    interpolation: Interpolation | None = None
    end_slopes: Numbers | None = None

    @classmethod
    def units_of(cls, data: Mapping[str, object]) -> dict[str, str]:  # noqa: ARG003
        """Return the unit of the slopes at the ends."""
        return {"end_slopes": "N m/s"}

    @model_validator(mode="after")
    def _is_a_torque(self) -> "TorqueDrive":
        require_body(self)
        if isinstance(self.torque_N_m, tuple):
            require_column("time_s", self.time_s)
            require_table(
                "time_s", self.time_s or (), "torque_N_m", self.torque_N_m, self.interpolation or SPLINE
            )
            require_slopes(self.end_slopes, self.interpolation or SPLINE)
        else:
            for name in ("time_s", "interpolation", "end_slopes"):
                require_no_table(name, getattr(self, name), "torque_N_m")
        return self

    @property
    def constant_N_m(self) -> float:
        """The constant torque."""
        assert isinstance(self.torque_N_m, float)
        return self.torque_N_m


class MotorLine(NamedTuple):
    """The two points of a motor whose torque is linear in its speed."""

    stall_torque_N_m: float
    no_load_speed_rad_s: float


class MotorDrive(AnyDrive):
    """A torque by the body's speed: linear through two points and beyond them, or by a table.

    At rest it is ``stall_torque_N_m``, at ``no_load_speed_rad_s`` none; faster than that the motor brakes. A
    table of ``torque_N_m`` over ``speed_rad_s`` has its end values beyond its ends.
    """

    kind: Literal["motor"]
    stall_torque_N_m: float | None = None
    no_load_speed_rad_s: float | None = None
    speed_rad_s: Numbers | None = None
    torque_N_m: Numbers | None = None
    interpolation: Interpolation | None = None
    end_slopes: Numbers | None = None

    @classmethod
    def units_of(cls, data: Mapping[str, object]) -> dict[str, str]:  # noqa: ARG003
        """Return the unit of the slopes at the ends."""
        return {"end_slopes": "N m s/rad"}

    @model_validator(mode="after")
    def _drives(self) -> "MotorDrive":
        require_body(self)
        if self.speed_rad_s is not None or self.torque_N_m is not None:
            require_column("speed_rad_s", self.speed_rad_s)
            require_column("torque_N_m", self.torque_N_m)
            columns = self.speed_rad_s or (), self.torque_N_m or ()
            require_table("speed_rad_s", columns[0], "torque_N_m", columns[1], self.interpolation or SPLINE)
            require_slopes(self.end_slopes, self.interpolation or SPLINE)
            for name in ("stall_torque_N_m", "no_load_speed_rad_s"):
                require_presence(False, name, getattr(self, name), "beside a table")
            return self
        for name in ("interpolation", "end_slopes"):
            require_no_table(name, getattr(self, name), "torque_N_m")
        for name in ("stall_torque_N_m", "no_load_speed_rad_s"):
            require(getattr(self, name) is not None, name, "a finite number", None)
        stall, speed = self.line
        if stall == 0:
            raise ValueError("stall_torque_N_m: expected a number other than 0, got 0")
        if speed == 0 or (speed > 0) != (stall > 0):
            wanted = "> 0" if stall > 0 else "< 0"
            raise ValueError(
                f"no_load_speed_rad_s: expected a number {wanted}, as stall_torque_N_m, got {speed:g}"
            )
        return self

    @property
    def line(self) -> MotorLine:
        """The two points of a motor without a table."""
        assert self.stall_torque_N_m is not None
        assert self.no_load_speed_rad_s is not None
        return MotorLine(self.stall_torque_N_m, self.no_load_speed_rad_s)


def require_no_table(name: str, value: object, column: str) -> None:
    """Refuse what belongs to a table where there is none."""
    if value is not None:
        raise ValueError(f"{name}: expected nothing without a list {column}, got {shown(value)}")


def require_body(drive: AnyDrive) -> None:
    """Refuse a torque along a guide."""
    if drive.guide is not None:
        came = shown(drive.guide)
        raise ValueError(f"guide: expected nothing with a torque, which acts on a body, got {came}")


Drive = Annotated[
    FreeDrive | ConstantSpeedDrive | RampDrive | FluctuatingDrive | TableDrive | TorqueDrive | MotorDrive,
    Field(discriminator="kind"),
]
#: The kinds that prescribe the motion.
PRESCRIBED = ("constant-speed", "ramp", "fluctuating", "table")

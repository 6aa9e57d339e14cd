"""What drives the crank, as data: nothing, a torque, or a speed that the driver keeps whatever it takes.

Prescribed speeds are functions of time on the drive's clock, which reads ``start.time_s`` as a run begins.
"""

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from engine_models.scene.curves import Ends, Interpolation, curve, require_table
from engine_models.scene.data import Angle, Angles, NonNegative, Numbers, Positive, SceneData

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


#: What is slower is constant for as long as anybody waits.
LOWEST_FREQUENCY_HZ = 1e-9
#: Speeds of straight lines that differ by less than this part of the fastest are one, but for typed digits.
SAME_SPEED = 1e-6


class FreeDrive(SceneData):
    """Nothing drives the crank."""

    kind: Literal["free"]


class ConstantSpeedDrive(SceneData):
    """The crank keeps the speed it starts with."""

    kind: Literal["constant-speed"]


class RampDrive(SceneData):
    """The crank's speed goes from the start's to another, and stays there: a start-up, or a stop.

    It is w0 + (w1 - w0) x^3 (10 - 15 x + 6 x^2) with x = t/``ramp_time_s`` up to 1: twice differentiable.
    """

    kind: Literal["ramp"]
    final_speed_rad_s: float
    ramp_time_s: Positive


class FluctuatingDrive(SceneData):
    """The crank's speed is the start's plus a sine of the clock's t.

    It is ``amplitude_rad_s`` sin(2 pi ``frequency_Hz`` t + ``phase_rad``).
    """

    kind: Literal["fluctuating"]
    amplitude_rad_s: NonNegative
    frequency_Hz: Annotated[float, Field(ge=LOWEST_FREQUENCY_HZ)]
    phase_rad: Angle = 0.0


class TableDrive(SceneData):
    """The crank turns by a table: from the start's angle on, as ``angle_rad`` does from its first entry on.

    Between the entries the angle is a cubic spline of time. ``end_slopes`` are its speeds in rad/s at both
    ends. Without them it is not-a-knot there (de Boor's), but at rest at an end whose two angles are equal.
    Between straight lines the speed jumps: ``linear`` is for a constant speed alone.
    """

    kind: Literal["table"]
    time_s: Numbers
    angle_rad: Angles
    interpolation: Interpolation = "spline"
    end_slopes: Numbers | None = None

    @model_validator(mode="after")
    def _is_a_table(self) -> "TableDrive":
        require_table("time_s", self.time_s, "angle_rad", self.angle_rad, self.interpolation)
        slopes = self.end_slopes
        if slopes is not None and self.interpolation == "linear":
            raise ValueError("end_slopes: expected nothing with interpolation = 'linear', got a list")
        if slopes is not None and len(slopes) != 2:
            raise ValueError(
                f"end_slopes: expected two numbers, of the first and the last end, got {len(slopes)}"
            )
        if self.interpolation == "linear":
            self._turns_evenly()
        return self

    def _turns_evenly(self) -> None:
        """Refuse straight lines between which the speed jumps."""
        speeds = self.spline().c[2].tolist()
        for place, (before, after) in enumerate(pairwise(speeds), 1):
            if abs(after - before) > SAME_SPEED * max(map(abs, speeds)):
                jump = f"at time_s.{place} the speed would jump from {before:.4g} to {after:.4g} rad/s"
                raise ValueError(
                    f"interpolation: expected 'spline' ({jump}, by an infinite torque), got 'linear'"
                )

    @property
    def _ends(self) -> Ends:
        if self.end_slopes is not None:
            return self.end_slopes[0], self.end_slopes[1]
        first, second, *_, last_but_one, last = self.angle_rad
        return 0.0 if first == second else None, 0.0 if last_but_one == last else None

    def spline(self) -> "PPoly":
        """Return the angle in rad over the drive's clock in s."""
        ends = (None, None) if self.interpolation == "linear" else self._ends
        return curve(self.time_s, self.angle_rad, self.interpolation, ends)


class TorqueDrive(SceneData):
    """A constant torque on the crank, counter-clockwise positive."""

    kind: Literal["torque"]
    torque_N_m: float


class MotorDrive(SceneData):
    """A torque that is linear in the crank's speed, through both points given and beyond them.

    At rest it is ``stall_torque_N_m``, at ``no_load_speed_rad_s`` none; faster than that the motor brakes.
    """

    kind: Literal["motor"]
    stall_torque_N_m: float
    no_load_speed_rad_s: float

    @model_validator(mode="after")
    def _drives(self) -> "MotorDrive":
        stall, speed = self.stall_torque_N_m, self.no_load_speed_rad_s
        if stall == 0:
            raise ValueError("stall_torque_N_m: expected a number other than 0, got 0")
        if speed == 0 or (speed > 0) != (stall > 0):
            wanted = "> 0" if stall > 0 else "< 0"
            raise ValueError(
                f"no_load_speed_rad_s: expected a number {wanted}, as stall_torque_N_m, got {speed:g}"
            )
        return self


Drive = Annotated[
    FreeDrive | ConstantSpeedDrive | RampDrive | FluctuatingDrive | TableDrive | TorqueDrive | MotorDrive,
    Field(discriminator="kind"),
]
#: The kinds that prescribe the crank's speed.
PRESCRIBED = ("constant-speed", "ramp", "fluctuating", "table")

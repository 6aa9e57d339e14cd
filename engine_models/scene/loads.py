"""What acts on bodies from outside, as data: forces along a line, and torques.

A force on a body in a guide acts at the guide's pin along the guide, and pushes back on what the guide is on;
one on another body acts on its centre of mass, along a fixed direction.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pydantic import model_validator

from engine_models.scene.data import (
    Angle,
    Angles,
    NonNegative,
    Numbers,
    PartName,
    Positive,
    SceneData,
    require,
    require_presence,
    require_slopes,
    require_table,
)
from engine_models.scene.plain_words import one_of
from reference_solver.mechanism.curves import curve
from reference_solver.mechanism.data import Interpolation

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: A revolution in a table may be off by as much as five typed digits are, in rad; its forces by rounding.
REVOLUTION_RAD, CLOSES = 1e-4, 1e-9
TURN = 2 * math.pi
#: What is no load without another field.
NOT_ALONE = ("free_position_m", "guide", "along_rad")


class Gas(SceneData):
    """A force on the slider by the crank's angle, of a cylinder that works once in one or two revolutions.

    A periodic cubic spline, or straight lines, through a table over one revolution, or over two, whose last
    entry is the first again.
    """

    crank_angle_rad: Angles
    force_N: Numbers
    interpolation: Interpolation = "spline"

    @model_validator(mode="after")
    def _closes(self) -> "Gas":
        require_period("crank_angle_rad", self.crank_angle_rad, self.force_N, self.interpolation)
        return self

    @property
    def period_rad(self) -> float:
        """The angle after which the force repeats: one revolution or two."""
        return period_of(self.crank_angle_rad)

    @property
    def is_of_one_turn(self) -> bool:
        """Whether the force repeats after one revolution."""
        return self.period_rad == TURN

    def spline(self) -> "PPoly":
        """Return the force in N over the crank's angle in rad, at any angle."""
        return periodic_curve(self.crank_angle_rad, self.force_N, self.interpolation)


class BodyGas(SceneData):
    """A force by the angle of a ``body``, that which is driven unless it is named: see ``Gas``."""

    angle_rad: Angles
    force_N: Numbers
    body: PartName | None = None
    interpolation: Interpolation = "spline"

    @model_validator(mode="after")
    def _closes(self) -> "BodyGas":
        require_period("angle_rad", self.angle_rad, self.force_N, self.interpolation)
        return self


def period_of(angle: tuple[float, ...]) -> float:
    """Return the period of a table over angles in rad: one revolution or two, the one that is nearer."""
    return TURN if angle[-1] - angle[0] < 1.5 * TURN else 2 * TURN


def periodic_curve(angle: tuple[float, ...], force: tuple[float, ...], by: Interpolation) -> "PPoly":
    """Return the force in N over angles in rad of a table that repeats."""
    last = angle[0] + period_of(angle)
    return curve((*angle[:-1], last), (*force[:-1], force[0]), by, "periodic")


def require_period(
    name: str, angle: tuple[float, ...], force: tuple[float, ...], interpolation: Interpolation
) -> None:
    """Refuse a table over angles that does not repeat after one revolution, or after two."""
    require_table(name, angle, "force_N", force, interpolation)
    period, last = period_of(angle), f"{name}.{len(angle) - 1}"
    times = "one revolution" if period == TURN else "two revolutions"
    ends = angle[0] + TURN, angle[0] + 2 * TURN
    expected = f"one revolution or two after the first, {ends[0]:.6g} or {ends[1]:.6g}"
    require(abs(angle[-1] - angle[0] - period) <= REVOLUTION_RAD, last, expected, angle[-1])
    expected = f"a number < {angle[0] + period:.6g}, {times} after the first"
    require(angle[-2] < angle[0] + period, f"{name}.{len(angle) - 2}", expected, angle[-2])
    closes = abs(force[-1] - force[0]) <= CLOSES * max(map(abs, force))
    require(closes, f"force_N.{len(force) - 1}", f"the first one again, {force[0]:g}", force[-1])


class ByTime(SceneData):
    """A force in N, a torque in N m or both by the drive's clock, as a spline or straight lines."""

    time_s: Numbers
    force_N: Numbers | None = None
    torque_N_m: Numbers | None = None
    interpolation: Interpolation = "spline"
    end_slopes: Numbers | None = None

    @classmethod
    def units_of(cls, data: Mapping[str, object]) -> dict[str, str]:
        """Return the unit of the slopes at the ends."""
        return {"end_slopes": "N/s" if data.get("force_N") is not None else "N m/s"}

    @model_validator(mode="after")
    def _is_a_table(self) -> "ByTime":
        columns = [name for name in ("force_N", "torque_N_m") if getattr(self, name) is not None]
        if not columns:
            raise ValueError("force_N: expected it or torque_N_m, got nothing")
        for name in columns:
            require_table("time_s", self.time_s, name, getattr(self, name), self.interpolation)
        require_slopes(self.end_slopes, self.interpolation)
        if self.end_slopes is not None and len(columns) == 2:
            raise ValueError("end_slopes: expected nothing beside both force_N and torque_N_m, got a list")
        return self


class Forces(SceneData):
    """Forces along a line, by the way s along it and its rate s': any of them, together.

    ``force_N`` is constant; ``viscous_N_s_m`` -c s', friction of a guide; ``spring_N_m``
    -k (s - ``free_position_m``); ``by_time`` goes by the drive's clock.
    """

    force_N: float | None = None
    viscous_N_s_m: NonNegative | None = None
    spring_N_m: Positive | None = None
    free_position_m: float | None = None
    by_time: ByTime | None = None

    @model_validator(mode="after")
    def _is_some(self) -> "Forces":
        kinds = [name for name in type(self).model_fields if name not in NOT_ALONE]
        if all(getattr(self, name) is None for name in kinds):
            raise ValueError(f"force_N: expected it or {one_of(kinds[1:])}, got nothing")
        sprung = self.spring_N_m is not None
        require_presence(
            sprung, "free_position_m", self.free_position_m, f"{'beside' if sprung else 'without'} spring_N_m"
        )
        return self


class SliderLoad(Forces):
    """Forces on the slider along its guide (see ``Forces``); ``gas`` goes by the crank's angle."""

    gas: Gas | None = None


class ForcesAndTorques(Forces):
    """Forces on a body (see ``Forces``), and torques: a constant one, and -c phi' of a damper.

    They act along its ``guide``, which is named where it has two, or along ``along_rad`` from the x axis of
    the global frame where it has none.
    """

    torque_N_m: float | None = None
    viscous_N_m_s: NonNegative | None = None
    guide: PartName | None = None
    along_rad: Angle | None = None

    @property
    def has_forces(self) -> bool:
        """Whether anything acts along a line."""
        by_time = self.by_time is not None and self.by_time.force_N is not None
        own = (self.force_N, self.viscous_N_s_m, self.spring_N_m, getattr(self, "gas", None))
        return by_time or any(part is not None for part in own)


class Load(ForcesAndTorques):
    """Forces and torques on a body of any mechanism; ``gas`` goes by the angle of a body."""

    gas: BodyGas | None = None


class LinkLoad(ForcesAndTorques):
    """Forces and torques on crank or rod; ``gas`` goes by the crank's angle."""

    gas: Gas | None = None


class Loads(SceneData):
    """The loads of a crank-slider; bodies that are not named have none but their weight."""

    crank: LinkLoad | None = None
    rod: LinkLoad | None = None
    slider: SliderLoad | None = None

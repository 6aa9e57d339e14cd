"""What acts on the slider from outside, as data: forces along its guide, positive along +x."""

import math
from typing import TYPE_CHECKING

from pydantic import model_validator

from engine_models.scene.curves import Interpolation, curve, require_table
from engine_models.scene.data import (
    Angles,
    NonNegative,
    Numbers,
    Positive,
    SceneData,
    require,
    require_presence,
)

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: A revolution in a table may be off by as much as five typed digits are, in rad; its forces by rounding.
REVOLUTION_RAD, CLOSES = 1e-4, 1e-9


class Gas(SceneData):
    """A force on the slider by the crank's angle, of a cylinder that works once a revolution.

    A periodic cubic spline, or straight lines, through a table over one revolution, whose last entry is the
    first again.
    """

    crank_angle_rad: Angles
    force_N: Numbers
    interpolation: Interpolation = "spline"

    @model_validator(mode="after")
    def _closes(self) -> "Gas":
        angle, force = self.crank_angle_rad, self.force_N
        require_table("crank_angle_rad", angle, "force_N", force, self.interpolation)
        turn, last = 2 * math.pi, f"crank_angle_rad.{len(angle) - 1}"
        expected = f"one revolution after the first, {angle[0] + turn:.6g}"
        require(abs(angle[-1] - angle[0] - turn) <= REVOLUTION_RAD, last, expected, angle[-1])
        expected = f"a number < {angle[0] + turn:.6g}, one revolution after the first"
        require(angle[-2] < angle[0] + turn, f"crank_angle_rad.{len(angle) - 2}", expected, angle[-2])
        closes = abs(force[-1] - force[0]) <= CLOSES * max(map(abs, force))
        require(closes, f"force_N.{len(force) - 1}", f"the first one again, {force[0]:g}", force[-1])
        return self

    def spline(self) -> "PPoly":
        """Return the force in N over the crank's angle in rad, at any angle."""
        first, turn = self.crank_angle_rad[0], 2 * math.pi
        angle, force = (*self.crank_angle_rad[:-1], first + turn), (*self.force_N[:-1], self.force_N[0])
        return curve(angle, force, self.interpolation, "periodic")


class SliderLoad(SceneData):
    """Forces on the slider along +x, by its position x and velocity x': any of them, together.

    ``force_N`` is constant; ``viscous_N_s_m`` -c x', friction of the guide; ``spring_N_m``
    -k (x - ``free_position_m``); ``gas`` goes by the crank's angle.
    """

    force_N: float | None = None
    viscous_N_s_m: NonNegative | None = None
    spring_N_m: Positive | None = None
    free_position_m: float | None = None
    gas: Gas | None = None

    @model_validator(mode="after")
    def _is_some(self) -> "SliderLoad":
        if all(getattr(self, name) is None for name in type(self).model_fields):
            raise ValueError("force_N: expected it or viscous_N_s_m, spring_N_m or gas, got nothing")
        sprung = self.spring_N_m is not None
        require_presence(
            sprung, "free_position_m", self.free_position_m, f"{'beside' if sprung else 'without'} spring_N_m"
        )
        return self


class Loads(SceneData):
    """The loads of a scene; bodies that are not named have none but their weight."""

    slider: SliderLoad | None = None

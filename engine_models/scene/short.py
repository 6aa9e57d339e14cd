"""The short spelling of a crank-slider or a pendulum, and the general one that it is rewritten into.

The crank turns about joint O at the origin, the slider moves along its guide, which passes O at an offset,
positive to the left of the guide's direction, at an angle from +x. Joint A connects crank and rod, B rod and
slider; the slider's centre of mass is pin B, a link's is on the line of its joints, at the given distance
from its first. A pendulum is a crank alone, in joint O.
"""

import math
import re
from typing import Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from engine_models.scene import format as form
from engine_models.scene.format import Angle, BodyState, Named, Positive, SceneData, require
from reference_solver.tape import FloatArray

#: Entries that the general spelling alone has, by which a file without a crank is of that spelling.
OF_GENERAL = {"body", "ground", "guide", "observe"}


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
    guide_offset_m: float = 0.0
    guide_angle_rad: Angle = 0.0


class Start(SceneData):
    """Crank angle and speed at t = 0, or every body's own state; ``time_s`` is what the drive's clock reads.

    Where the speed fluctuates, ``crank_speed_rad_s`` is the one about which it does. A driven slider has its
    speed in ``speed_m_s`` in place of the crank's, as in ``{guide = 0.2}``.
    """

    crank_angle_rad: Angle
    crank_speed_rad_s: float = 0.0
    speed_m_s: Named[float] | None = None
    time_s: form.Clock = 0.0
    crank: BodyState | None = None
    rod: BodyState | None = None
    slider: BodyState | None = None

    @model_validator(mode="after")
    def _tells_one_speed(self) -> "Start":
        told = "crank_speed_rad_s" in self.model_fields_set
        require(told or self.speed_m_s is not None, "crank_speed_rad_s", "a number", None)
        alone = self.speed_m_s is None or self.crank_speed_rad_s == 0
        self.require(alone, "crank_speed_rad_s", "nothing beside speed_m_s")
        return self


class CrankGas(form.Gas):
    """A force by the crank's angle: see ``[load.NAME.gas]``."""

    COLUMNS: ClassVar = {None: ("crank_angle_rad", "force_N")}

    crank_angle_rad: form.Angles = ()
    angle_rad: None = None  # type: ignore[assignment]
    body: None = None


class CrankLoad(form.Load):
    """Forces and torques as of any body; ``gas`` goes by the crank's angle."""

    gas: CrankGas | None = None


class CrankSlider(form.Top):
    """A file with a crank: bodies, joints, loads, drive, start and end of a crank-slider.

    Without rod and slider it is a physical pendulum: the crank alone, in joint O.
    """

    crank: Link
    rod: Link | None = None
    slider: Slider | None = None
    start: Start
    drive: form.Drive
    load: Named[CrankLoad] = Field({})
    spring: Named[form.Spring] = Field({})
    torsion: Named[form.Torsion] = Field({})
    clearance: Named[form.Clearance] = Field({})

    @model_validator(mode="after")
    def _can_be_assembled(self) -> "CrankSlider":
        missing, both = "rod" if self.rod is None else "slider", (self.rod is None) == (self.slider is None)
        self.require(both, missing, "a section: rod and slider together, or none")
        if self.rod is None:
            return self
        crank, rod, (tilt, offset) = self.crank.length_m, self.rod.length_m, self.guide
        height, when = abs(crank * math.sin(self.start.crank_angle_rad - tilt) - offset), "at the start"
        fits = rod > height
        if self.drive.kind != "free" and self.drive.guide is None:
            height, when = crank + abs(offset), "as the driven crank turns"
        distance = f"{height:g}, the largest distance of pin A from the guide {when}"
        require(fits and rod >= height, "rod.length_m", f"more than {distance}", rod)
        return self

    @property
    def guide(self) -> tuple[float, float]:
        """Angle in rad and offset in m of the slider's guide, 0 of a pendulum."""
        return (self.slider.guide_angle_rad, self.slider.guide_offset_m) if self.slider else (0.0, 0.0)

    def general(self) -> dict[str, Any]:
        """Return the same scene in the general spelling.

        At the start the slider lies in the guide's direction from pin A, which is at r cos along the guide
        and at r sin across it, of the crank's angle from the guide's.
        """
        data, (angle, offset) = self.as_written(), self.guide
        start, bodies, gases = data["start"], dict[str, Any](), data.get("load", {}).values()
        for name, near, far in (("crank", "O", "A"), ("rod", "A", "B")):
            if link := data.pop(name, None):
                bodies[name] = {"pins_m": {near: 0.0, far: link.pop("length_m")}, **link}
        data |= {"body": bodies, "ground": {"pins_m": {"O": 0.0}}, "observe": "A.x", "turning": "crank"}
        angles = {"crank": start.pop("crank_angle_rad")}
        if slider := data.pop("slider", None):
            block = {key: value for key, value in slider.items() if not key.startswith("guide")}
            bodies["slider"] = {"pins_m": {"B": 0.0}, **block}
            through = (-offset * math.sin(angle), offset * math.cos(angle))
            line = {"body": "slider", "pin": "B", "through_m": through, "angle_rad": angle}
            data |= {"guide": {"guide": line}, "observe": "guide.along"}
            across = offset - self.crank.length_m * math.sin(angles["crank"] - angle)
            angles["rod"] = angle + math.asin(max(-1.0, min(1.0, across / bodies["rod"]["pins_m"]["B"])))
        for gas in (load["gas"] for load in gases if "gas" in load):
            gas |= {"angle_rad": gas.pop("crank_angle_rad"), "body": "crank"}
        if self.drive.guide is None:
            data["drive"] = {"body": "crank", **data["drive"]}
        speed = start.pop("crank_speed_rad_s", 0.0)
        if self.start.speed_m_s is None:
            start["speed_rad_s"] = {"crank": speed}
        if self.start.crank is None:
            start |= {"angle_rad": angles, "hold": ["crank"]}
        return data


def in_short(path: str) -> str:
    """Return the path of a field, or a reason that begins with one, as the short spelling has it."""
    return re.sub(r"^start\.(angle|speed)_rad(_s)?(\.crank)?(?=:|$)", r"start.crank_\1_rad\2", path)


def assembled(short: CrankSlider, angle_rad: float, speed_rad_s: float) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities, each (3, 3), of a crank-slider whose guide is on the x axis.

    They are those of crank, rod and slider by (x, y, phi) of the centre of mass, at a crank angle and speed;
    of a pendulum (1, 3). The rod is on the side of its acute angle: the slider lies to the right of pin A.
    """

    def along(distance_m: float, angle: float, rate: float) -> FloatArray:
        x, y = np.cos(angle), np.sin(angle)
        return np.array([[distance_m * x, distance_m * y], [-distance_m * rate * y, distance_m * rate * x]])

    state = np.zeros((2, 1 if short.rod is None else 3, 3))
    state[:, 0, :2] = along(short.crank.centre_of_mass_m, angle_rad, speed_rad_s)
    state[:, 0, 2] = angle_rad, speed_rad_s
    if (rod := short.rod) is not None:
        r, length = short.crank.length_m, rod.length_m
        phi = np.arcsin(-r / length * np.sin(angle_rad))
        phi_rate = -r * np.cos(angle_rad) / (length * np.cos(phi)) * speed_rad_s
        pin = along(r, angle_rad, speed_rad_s)
        state[:, 1, :2] = pin + along(rod.centre_of_mass_m, phi, phi_rate)
        state[:, 1, 2] = phi, phi_rate
        state[:, 2, 0] = (pin + along(length, phi, phi_rate))[:, 0]
    return state[0], state[1]

"""The short spelling of a crank-slider or a pendulum, and the general one that it is rewritten into.

The crank turns about joint O at the origin, the slider moves along its guide, which passes O at an offset,
positive to the left of the guide's direction, at an angle from +x: both are 0 unless given. Angles are
counter-clockwise from +x. Joint A connects crank and rod, joint B rod and slider; the slider's centre of mass
is its pin B. A link's centre of mass lies on the line of its joints, at the given distance from its first
joint (O for the crank, A for the rod). A pendulum is a crank alone, hanging from joint O.
"""

import math
import re
from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_validator

from engine_models.scene.format import (
    Angle,
    BodyState,
    Clearance,
    Clock,
    CrankGas,
    Drive,
    Load,
    Named,
    Parts,
    Positive,
    SceneData,
    Spring,
    Top,
    require,
)

#: Entries that the general spelling alone has, by which a file without a crank is of that spelling.
OF_GENERAL = ("body", "ground", "guide", "observe")
#: The name of the slider's guide.
GUIDE = "guide"


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
    guide_offset_m: float | None = None
    guide_angle_rad: Angle | None = None


class Start(SceneData):
    """Crank angle and speed at t = 0; everything else follows from the ideal joints.

    Or every body's own state is given, for a start that is elsewhere in its clearances; ``crank_speed_rad_s``
    is then that of the drive alone. ``time_s`` is what the drive's clock reads at t = 0; nothing is 0. Where
    the speed fluctuates, ``crank_speed_rad_s`` is the one about which it does. A driven slider has its speed
    in ``speed_m_s`` in place of the crank's, as in ``{guide = 0.2}``.
    """

    crank_angle_rad: Angle
    crank_speed_rad_s: float
    speed_m_s: Named[float] | None = None
    time_s: Clock | None = None
    crank: BodyState | None = None
    rod: BodyState | None = None
    slider: BodyState | None = None

    @model_validator(mode="before")
    @classmethod
    def _has_one_speed(cls, data: object) -> object:
        if isinstance(data, Mapping) and data.get("speed_m_s") is not None:
            return {"crank_speed_rad_s": 0.0, **data}
        return data

    @model_validator(mode="after")
    def _tells_one_speed(self) -> "Start":
        alone = self.speed_m_s is None or self.crank_speed_rad_s == 0
        require(alone, "crank_speed_rad_s", "nothing beside speed_m_s", self.crank_speed_rad_s)
        return self


class CrankLoad(Load):
    """Forces and torques as of any body; ``gas`` goes by the crank's angle."""

    gas: CrankGas | None = None  # type: ignore[assignment]


class Loads(SceneData):
    """The loads of a crank-slider; bodies that are not named have none but their weight."""

    crank: CrankLoad | None = None
    rod: CrankLoad | None = None
    slider: CrankLoad | None = None


class Clearances(SceneData):
    """The joints with clearance; a joint that is not named is ideal."""

    O: Clearance | None = None  # noqa: E741  the joint's name in the field
    A: Clearance | None = None
    B: Clearance | None = None


class CrankSlider(Top):
    """A file with a crank: bodies, joints, loads, drive, start and end of a crank-slider.

    Without rod and slider it is a physical pendulum: the crank alone, in joint O.
    """

    crank: Link
    rod: Link | None = None
    slider: Slider | None = None
    start: Start
    drive: Drive
    load: Loads = Loads()
    spring: Named[Spring] = Field(default_factory=Parts)
    clearance: Clearances = Clearances()

    @model_validator(mode="before")
    @classmethod
    def _has_no_general_part(cls, data: object) -> object:
        if isinstance(data, Mapping) and "crank" in data:
            for name in OF_GENERAL:
                require(name not in data, name, "nothing beside crank (the short form)", data.get(name))
        return data

    @model_validator(mode="after")
    def _can_be_assembled(self) -> "CrankSlider":
        states = [state for state in (self.start.crank, self.start.rod, self.start.slider) if state]
        if states and len(states) != 1 + 2 * (self.rod is not None):
            raise ValueError("start: expected the state of every body or of none, got some")
        if self.rod is None or self.slider is None:
            self._is_a_pendulum()
            return self
        crank, rod, (tilt, offset) = self.crank.length_m, self.rod.length_m, self.guide
        if self.drive.kind != "free" and self.drive.guide is None:
            longest, also = crank + abs(offset), " + |slider.guide_offset_m|" if offset else ""
            expected = f"at least crank.length_m{also} = {longest:g} with drive.kind = '{self.drive.kind}'"
            require(rod >= longest, "rod.length_m", f"{expected} (else the crank cannot turn)", rod)
        height = abs(crank * math.sin(self.start.crank_angle_rad - tilt) - offset)
        of = "the distance of pin A from the guide"
        if not (tilt or offset):
            of = "crank.length_m |sin(start.crank_angle_rad)|"
        expected = f"more than {of} = {height:g} (else the rod cannot reach the guide)"
        require(rod > height, "rod.length_m", expected, rod)
        return self

    def _is_a_pendulum(self) -> None:
        missing, there = ("rod", "slider") if self.rod is None else ("slider", "rod")
        require(getattr(self, there) is None, missing, f"a section beside {there}", None)
        parts = {f"clearance.{joint}": getattr(self.clearance, joint) for joint in ("A", "B")}
        parts |= {f"load.{body}": getattr(self.load, body) for body in ("rod", "slider")}
        for path, part in parts.items():
            require(part is None, path, "nothing without rod and slider", part)

    @property
    def guide(self) -> tuple[float, float]:
        """Angle in rad and offset in m of the slider's guide, 0 of a pendulum."""
        slider = self.slider
        return (0.0, 0.0) if slider is None else (slider.guide_angle_rad or 0.0, slider.guide_offset_m or 0.0)

    def general(self) -> dict[str, Any]:
        """Return the same scene in the general spelling."""
        data, own = self.as_written(), self.as_written()
        for name in ("crank", "rod", "slider"):
            data.pop(name, None)
        data |= {"observe": "A.x", "turning": "crank", "ground": {"pins_m": {"O": 0.0}}, "body": {}}
        for name, near, far in (("crank", "O", "A"), ("rod", "A", "B")):
            if name in own:
                length_m = own[name].pop("length_m")
                data["body"][name] = {"pins_m": {near: 0.0, far: length_m}, **own[name]}
        if self.slider is not None:
            angle, offset = self.guide
            through = (-offset * math.sin(angle), offset * math.cos(angle))
            block = {"mass_kg": self.slider.mass_kg, "inertia_kg_m2": self.slider.inertia_kg_m2}
            data["body"]["slider"] = {"pins_m": {"B": 0.0}, **block}
            data["guide"] = {GUIDE: {"body": "slider", "pin": "B", "through_m": through, "angle_rad": angle}}
            data["observe"] = f"{GUIDE}.along"
        for load in data["load"].values():
            if gas := load.get("gas"):
                gas |= {"angle_rad": gas.pop("crank_angle_rad"), "body": "crank"}
        if self.drive.guide is None:
            data["drive"] = {"body": "crank", **data["drive"]}
        data["start"] = self._start()
        return data

    def _start(self) -> dict[str, Any]:
        start = self.start.as_written()
        angle, speed = start.pop("crank_angle_rad"), start.pop("crank_speed_rad_s")
        if self.drive.guide is None:
            start["speed_rad_s"] = {"crank": speed}
        elif self.start.speed_m_s is None:
            start["speed_m_s"] = {GUIDE: self._slider_speed_m_s()}
        if self.start.crank is None:
            rod = {} if self.rod is None else {"rod": self._rod_angle_rad()}
            start |= {"angle_rad": {"crank": angle, **rod}, "hold": ["crank"]}
        return start

    def _rod_angle_rad(self) -> float:
        """Return the rod's angle at the start: the slider lies in the guide's direction from pin A.

        Along the guide pin A is at r cos, across it at r sin of the crank's angle from the guide's.
        """
        assert self.rod is not None
        angle, offset = self.guide
        across = offset - self.crank.length_m * math.sin(self.start.crank_angle_rad - angle)
        return angle + math.asin(max(-1.0, min(1.0, across / self.rod.length_m)))

    def _slider_speed_m_s(self) -> float:
        """Return the slider's speed along its guide at the start, by the crank's."""
        angle, _ = self.guide
        crank_angle, rod_angle = self.start.crank_angle_rad - angle, self._rod_angle_rad() - angle
        turn = math.sin(crank_angle) - math.cos(crank_angle) * math.tan(rod_angle)
        return -self.crank.length_m * self.start.crank_speed_rad_s * turn


def in_short(path: str) -> str:
    """Return the path of a field, or a reason that begins with one, as the short spelling has it."""
    return re.sub(r"^start\.(angle|speed)_rad(_s)?(\.crank)?(?=:|$)", r"start.crank_\1_rad\2", path)

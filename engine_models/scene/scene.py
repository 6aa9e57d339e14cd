"""The short form of a scene: a planar crank-slider, or a pendulum, as frozen, validated data.

Conventions. SI units. The crank turns about joint O at the origin, the slider moves along its guide, which
passes O at an offset, positive to the left of the guide's direction, at an angle from +x: both are 0 unless
given. Gravity acts along -y unless it is a pair. Angles are counter-clockwise from +x. Joint A connects crank
and rod, joint B rod and slider; the slider's centre of mass is its pin B. A link's centre of mass lies on the
line of its joints, at the given distance from its first joint (O for the crank, A for the rod). A pendulum is
a crank alone, hanging from joint O.
"""

import math
import re
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from typing import Any

from pydantic import Field, model_validator

from engine_models.scene.data import Angle, Named, Parts, Positive, SceneData, require
from engine_models.scene.drives import Drive, MotorDrive, TableDrive, TorqueDrive
from engine_models.scene.general import (
    ALIKE,
    GeneralScene,
    assembled,
    check_parts,
    check_time_tables,
    refuse_later,
)
from engine_models.scene.loads import BodyGas, LinkLoad, Load, Loads, SliderLoad
from engine_models.scene.parts import (
    LAWS_DIVIDING_BY_RESTITUTION,
    LAWS_WITHOUT_RESTITUTION,
    AnyScene,
    Body,
    BodyState,
    Clearance,
    Clock,
    ContactLaw,
    Friction,
    Ground,
    Guide,
    Observed,
    PlacedStart,
    Spring,
)
from engine_models.scene.plain_words import shown
from reference_solver.mechanism.data import MechanismData

__all__ = [
    "LAWS_DIVIDING_BY_RESTITUTION",
    "LAWS_WITHOUT_RESTITUTION",
    "BodyState",
    "Clearance",
    "Clearances",
    "ContactLaw",
    "Friction",
    "Link",
    "Scene",
    "Slider",
    "Start",
]


#: Entries that the general form alone has, by which a file without a crank is of that form.
OF_GENERAL = ("body", "ground", "guide", "observe")


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
        speed = self.crank_speed_rad_s
        alone = self.speed_m_s is None or speed == 0
        require(alone, "crank_speed_rad_s", "nothing beside speed_m_s", speed)
        return self

    @property
    def states(self) -> tuple[BodyState, ...]:
        """The bodies' given states in the order crank, rod, slider."""
        return tuple(state for state in (self.crank, self.rod, self.slider) if state is not None)


class Clearances(SceneData):
    """The joints with clearance; a joint that is not named is ideal."""

    O: Clearance | None = None  # noqa: E741  the joint's name in the field
    A: Clearance | None = None
    B: Clearance | None = None


class Scene(AnyScene):
    """One crank-slider in motion: bodies, joints, loads, drive, start and end.

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
    def _has_no_later_part(cls, data: object) -> object:
        if isinstance(data, Mapping):
            refuse_later(data)
            for name in OF_GENERAL:
                if "crank" in data and name in data:
                    came = shown(data[name])
                    raise ValueError(f"{name}: expected nothing beside crank (the short form), got {came}")
        return data

    @model_validator(mode="after")
    def _is_a_mechanism(self) -> "Scene":
        self._can_be_assembled()
        if what_is_general(self) is not None:
            self._is_a_general_one()
        elif isinstance(self.drive, TableDrive):
            self._is_in_the_table(self.drive)
        return self

    def _is_a_general_one(self) -> None:
        """Check the scene as one of any mechanism, with the names of the short form in refusals."""
        try:
            check_parts(self.general)
            assembled(self.general)
        except ValueError as reason:
            said = re.sub(r"^start\.(angle|speed)_rad(_s)?(\.crank)?:", r"start.crank_\1_rad\2:", str(reason))
            raise ValueError(said) from None

    def _is_in_the_table(self, table: TableDrive) -> None:
        """Require a table that lasts as long as the scene, which begins at the table's own speed."""
        check_time_tables(table, {}, self.clock_s, self.end_time_s)
        begin, time, angle = self.clock_s, table.time_s, table.values
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
        crank, rod, (tilt, offset) = self.crank.length_m, self.rod.length_m, guide_of(self)
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

    def _is_a_pendulum(self) -> None:
        missing, there = ("rod", "slider") if self.rod is None else ("slider", "rod")
        if getattr(self, there) is not None:
            raise ValueError(f"{missing}: expected a section beside {there}, got nothing")
        for joint in ("A", "B"):
            if getattr(self.clearance, joint) is not None:
                raise ValueError(f"clearance.{joint}: expected nothing without rod and slider, got a section")
        for body in ("rod", "slider"):
            if getattr(self.load, body) is not None:
                raise ValueError(f"load.{body}: expected nothing without rod and slider, got a section")

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

    @cached_property
    def general_by(self) -> str | None:
        """The first entry that plain crank-sliders and pendulums do not have, if any."""
        return what_is_general(self)

    @property
    def general(self) -> GeneralScene:
        """The same scene in the general form."""
        return general_form(self)

    def _mechanism(self) -> MechanismData:
        return self.general.mechanism

    @property
    def observed(self) -> Observed:
        """The slider's way along its guide; of a pendulum the place of pin A along x."""
        return self.general.observed

    @property
    def turning_body(self) -> int:
        """The crank's number."""
        return 0

    @property
    def driven_by(self) -> Drive:
        """What drives the mechanism."""
        return self.drive

    @property
    def clearances(self) -> dict[str, Clearance]:
        """The clearances of the joints that have one, in the order O, A, B."""
        return {name: getattr(self.clearance, name) for name in self.joints_with_clearance}

    @property
    def clock_s(self) -> float:
        """What the drive's clock reads as a run begins."""
        return self.start.time_s or 0.0

    @property
    def weight_m_s2(self) -> float:
        """Gravity along -y, as it acts unless it is a pair."""
        assert isinstance(self.gravity_m_s2, float)
        return self.gravity_m_s2

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


#: The name of the slider's guide.
GUIDE = "guide"


def general_form(scene: Scene) -> GeneralScene:
    """Return the same scene in the general form, without checking it again."""
    bodies = {"crank": _bar(scene.crank, "O", "A")}
    guides = dict[str, Guide]()
    if scene.is_crank_slider:
        _, rod, slider = scene.crank_slider()
        block = Body.model_construct(
            pins_m={"B": 0.0}, mass_kg=slider.mass_kg, inertia_kg_m2=slider.inertia_kg_m2
        )
        bodies |= {"rod": _bar(rod, "A", "B"), "slider": block}
        angle, offset = guide_of(scene)
        through = (-offset * math.sin(angle), offset * math.cos(angle))
        guides[GUIDE] = Guide.model_construct(body="slider", pin="B", through_m=through, angle_rad=angle)
    drive = scene.drive
    if drive.guide is None and drive.body is None:
        drive = drive.model_construct(**{**dict(drive), "body": "crank"})
    rooms = {name: getattr(scene.clearance, name) for name in type(scene.clearance).model_fields}
    return GeneralScene.model_construct(
        name=scene.name,
        end_time_s=scene.end_time_s,
        gravity_m_s2=scene.gravity_m_s2,
        observe=f"{GUIDE}.along" if guides else "A.x",
        ground=Ground.model_construct(pins_m={"O": 0.0}),
        body=bodies,
        guide=guides,
        spring=scene.spring,
        load=_loads(scene),
        drive=drive,
        clearance={name: room for name, room in rooms.items() if room is not None},
        start=_start(scene),
    )


def guide_of(scene: Scene) -> tuple[float, float]:
    """Return angle in rad and offset in m of the slider's guide, 0 of a pendulum."""
    slider = scene.slider
    return (0.0, 0.0) if slider is None else (slider.guide_angle_rad or 0.0, slider.guide_offset_m or 0.0)


def _bar(link: Link, near: str, far: str) -> Body:
    return Body.model_construct(
        pins_m={near: 0.0, far: link.length_m},
        mass_kg=link.mass_kg,
        inertia_kg_m2=link.inertia_kg_m2,
        centre_of_mass_m=link.centre_of_mass_m,
    )


def _loads(scene: Scene) -> dict[str, Load]:
    own = {name: getattr(scene.load, name) for name in type(scene.load).model_fields}
    return {name: _load(load) for name, load in own.items() if load is not None}


def _load(load: LinkLoad | SliderLoad) -> Load:
    own, gas = load.gas, None
    if own is not None:
        gas = BodyGas.model_construct(
            angle_rad=own.crank_angle_rad, force_N=own.force_N, body="crank", interpolation=own.interpolation
        )
    return Load.model_construct(**{**dict(load), "gas": gas})


def _start(scene: Scene) -> PlacedStart:
    start, states = scene.start, ("crank", "rod", "slider")
    given: Any = {name: state for name in states if (state := getattr(start, name)) is not None}
    speeds: Any = {"speed_rad_s": {"crank": start.crank_speed_rad_s}}
    if scene.drive.guide is not None:
        speeds = {"speed_m_s": start.speed_m_s or {GUIDE: slider_speed_m_s(scene)}}
    if given:
        return PlacedStart.model_construct(time_s=start.time_s, **speeds, **given)
    angles = {"crank": start.crank_angle_rad}
    if scene.is_crank_slider:
        angles["rod"] = rod_angle_rad(scene)
    return PlacedStart.model_construct(angle_rad=angles, hold=("crank",), time_s=start.time_s, **speeds)


def rod_angle_rad(scene: Scene) -> float:
    """Return the rod's angle at the start: the slider lies in the guide's direction from pin A.

    Along the guide pin A is at r cos, across it at r sin of the crank's angle from the guide's.
    """
    crank, rod, _ = scene.crank_slider()
    angle, offset = guide_of(scene)
    across = offset - crank.length_m * math.sin(scene.start.crank_angle_rad - angle)
    return angle + math.asin(max(-1.0, min(1.0, across / rod.length_m)))


def slider_speed_m_s(scene: Scene) -> float:
    """Return the slider's speed along its guide at the start, by the crank's."""
    crank, _, _ = scene.crank_slider()
    angle, _ = guide_of(scene)
    crank_angle, rod_angle = scene.start.crank_angle_rad - angle, rod_angle_rad(scene) - angle
    turn = math.sin(crank_angle) - math.cos(crank_angle) * math.tan(rod_angle)
    return -crank.length_m * scene.start.crank_speed_rad_s * turn


def what_is_general(scene: Scene) -> str | None:
    """Return the entry of a scene that crank-sliders and pendulums of the first kind do not have, if any.

    Those have a guide along +x through joint O, gravity along -y, loads on the slider alone, and a drive on
    the crank.
    """
    drive, load = scene.drive, scene.load
    slider = load.slider
    found = {
        "slider.guide_angle_rad": guide_of(scene)[0] != 0,
        "slider.guide_offset_m": guide_of(scene)[1] != 0,
        "gravity_m_s2": isinstance(scene.gravity_m_s2, tuple),
        "spring": bool(scene.spring),
        "load.crank": load.crank is not None,
        "load.rod": load.rod is not None,
        "load.slider.by_time": slider is not None and slider.by_time is not None,
        "load.slider.gas": slider is not None and slider.gas is not None and not slider.gas.is_of_one_turn,
        "drive.body": drive.body not in (None, "crank"),
        "drive.guide": drive.guide is not None,
        "drive.torque_N_m": isinstance(drive, TorqueDrive) and isinstance(drive.torque_N_m, tuple),
        "drive.speed_rad_s": isinstance(drive, MotorDrive) and drive.speed_rad_s is not None,
        **{
            f"clearance.{name}.bearing": room is not None and room.bearing is not None
            for name in type(scene.clearance).model_fields
            for room in [getattr(scene.clearance, name)]
        },
    }
    return next((name for name, there in found.items() if there), None)

"""A scene: one planar mechanism in motion, from its start to its end, as frozen data that fits together."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import tomli_w
from pydantic import ConfigDict, Field, PrivateAttr, ValidationInfo, field_validator, model_validator

from engine_models.scene import format as form
from engine_models.scene.arguments import check_arguments
from engine_models.scene.checks import check_parts
from engine_models.scene.format import Named, Place, SceneError
from engine_models.scene.mechanism import mechanism_data
from engine_models.scene.plain_words import expect, one_of, shown
from engine_models.scene.short import OF_GENERAL, CrankSlider, Link, Slider, in_short
from engine_models.scene.start import Placed, placed
from reference_solver.mechanism import data
from reference_solver.mechanism.data import GROUND, Point

#: The path of a field, or values by their paths.
Fields = Annotated[str | Mapping[str, object], expect("a string or a mapping of names to values")]
#: Parts of the format that no engine runs so far.
Later = Named[Annotated[None, expect("nothing yet, which no engine runs so far")]]


class Observed(NamedTuple):
    """What a scene is about, by its name: a coordinate of a point of a body, its angle, or a guide's way.

    Tolerances, errors and studies are of this quantity.
    """

    name: str
    what: Literal["x", "y", "angle", "along"]
    body: int
    point: Point = (0.0, 0.0)
    guide: data.Line | None = None

    @property
    def unit(self) -> str:
        """The unit: rad of an angle, else m."""
        return "rad" if self.what == "angle" else "m"


class Scene(form.Top):
    """Any planar mechanism in motion: bodies that share pins, guides, springs, loads, a drive.

    ``observe`` is what the scene is about: a pin's x or y, a body's angle, or the way along a guide, as
    "B.x", "B.y", "body.angle" or "guide.along". ``turning`` is the body whose turns are revolutions, "" for
    none; it is the driven one unless it is named. The parts fit together, and are put together at the start.
    """

    model_config = ConfigDict(validate_default=True)

    ground: form.Ground = form.Ground(pins_m={})
    body: Annotated[Named[form.Body], Field(min_length=1)]
    guide: Named[form.Guide] = Field({})
    observe: form.ObservedName
    turning: form.TurningName | None = None
    spring: Named[form.Spring] = Field({})
    load: dict[form.BodyName, form.Load] = Field({})
    drive: form.Drive = form.Drive(kind="free")
    clearance: dict[form.JointName, form.Clearance] = Field({})
    start: form.PlacedStart = form.PlacedStart()
    film: Later = Field({})
    friction: Later = Field({})

    _short: CrankSlider | None = PrivateAttr(None)

    @field_validator("body", "guide")
    @classmethod
    def _names_are_known_to_later_parts(cls, part: Any, info: ValidationInfo) -> Any:
        own, taken = info.data | {info.field_name: part}, ["ground", *form.PlacedStart.model_fields]
        for name in own.get("body", ()):
            form.require(name not in taken, name, f"a name other than {one_of(taken)}", name)
        if info.context is not None and {"ground", "body"} <= own.keys():
            info.context.update(form.names_of(own["ground"], own["body"], own.get("guide", {})))
        return part

    @model_validator(mode="after")
    def _hangs_together(self, info: ValidationInfo) -> "Scene":
        self._short = (info.context or {}).get("short")
        check_parts(self)
        self.placed  # noqa: B018  put together, or refused
        return self

    @classmethod
    def checked(cls, data: Mapping[str, Any], folder: Path = Path(), **_: Any) -> "Scene":
        """Return the scene that a mapping describes, in the short spelling or in the general one.

        Raises:
            SceneError: it is none.
        """
        general = [name for name in OF_GENERAL if name in data]
        if general and "crank" in data:
            came = shown(data[general[0]])
            raise SceneError(f"{general[0]}: expected nothing beside crank (the short form), got {came}")
        if general:
            return super().checked(data, folder)
        short = CrankSlider.checked(data, folder)
        try:
            return super().checked(short.general(), short=short)
        except SceneError as error:
            raise SceneError(*map(in_short, error.reasons)) from None

    def __hash__(self) -> int:
        """Return a hash of what a file of the scene says."""
        return hash(self.to_toml())

    @check_arguments
    def replace(self, field: Fields, value: object = None) -> "Scene":
        """Return the scene with another value in a field: ``replace("clearance.B.restitution", 0.5)``.

        Several fields, checked together, are given as a mapping. None takes a part away, and what there is
        not yet comes to be: ``replace("clearance.B", None)`` makes a joint ideal.

        Raises:
            SceneError: with the new values it is no scene.
        """
        fields = {field: value} if isinstance(field, str) else field
        return self.checked(with_fields(self.as_written(), fields))

    def as_written(self) -> dict[str, Any]:
        """Return the scene as a file has it, in its own spelling."""
        return self._short.as_written() if self._short else super().as_written()

    def to_toml(self) -> str:
        """Return the scene as a TOML file that reads back to an equal scene."""
        return tomli_w.dumps(self.as_written())

    def path(self, general: str) -> str:
        """Return the path of a field in the scene's own spelling."""
        return in_short(general) if self._short else general

    @property
    def is_short(self) -> bool:
        """Whether it is written in the short spelling, as a crank-slider or a pendulum."""
        return self._short is not None

    @property
    def is_crank_slider(self) -> bool:
        """Whether it is written as a crank-slider, so that its columns are of crank and slider."""
        return self._short is not None and self._short.rod is not None

    @property
    def short(self) -> CrankSlider:
        """The scene in the short spelling, in which it has to be written."""
        assert self._short is not None, f"scene {self.name}: neither a crank-slider nor a pendulum"
        return self._short

    def crank_slider(self) -> tuple[Link, Link, Slider]:
        """Return crank, rod and slider of a scene that is written as a crank-slider."""
        rod, slider = self.short.rod, self.short.slider
        assert rod is not None
        assert slider is not None
        return self.short.crank, rod, slider

    def number(self, name: str) -> int:
        """Return the number of a body, or of the ground."""
        return GROUND if name == "ground" else [*self.body].index(name)

    def point(self, name: str, place: str | Place) -> Point:
        """Return a pin or a place of a body from its centre of mass, or of the ground from the origin."""
        centre: Place = 0.0 if name == "ground" else self.body[name].centre_of_mass_m
        if isinstance(place, str):
            place = (self.ground if name == "ground" else self.body[name]).pins_m[place]
        (x, y), (x0, y0) = (each if isinstance(each, tuple) else (each, 0.0) for each in (place, centre))
        return x - x0, y - y0

    @cached_property
    def pins(self) -> dict[str, list[str]]:
        """The names of what has each pin: the ground first, then bodies in the order of the file."""
        return form.pins_of(self.ground, self.body)

    @property
    def markers(self) -> dict[str, tuple[int, Point]]:
        """The pins of no joint, guide or spring, by their names: the body of each, and its point there."""
        used = {guide.pin for guide in self.guide.values()}
        used |= {end.partition(".")[2] for spring in self.spring.values() for end in spring.between}
        alone = {pin: names[0] for pin, names in self.pins.items() if len(names) == 1 and pin not in used}
        return {pin: (self.number(name), self.point(name, pin)) for pin, name in alone.items()}

    @cached_property
    def mechanism(self) -> data.MechanismData:
        """The mechanism by names, from which engines build it."""
        return mechanism_data(self)

    @cached_property
    def placed(self) -> Placed:
        """The start: coordinates and velocities of all bodies."""
        return placed(self, self._short)

    @property
    def observed(self) -> Observed:
        """What the scene is about."""
        name, _, axis = self.observe.rpartition(".")
        what: Any = axis
        if axis == "along":
            guide = self.mechanism.guides[[*self.guide].index(name)]
            return Observed(self.observe, what, guide.body_j, guide.point_j, guide)
        last = name if axis == "angle" else self.pins[name][-1]
        point = (0.0, 0.0) if axis == "angle" else self.point(last, name)
        return Observed(self.observe, what, self.number(last), point)

    @property
    def driven(self) -> str:
        """The name of the driven body, or guide."""
        return self.drive.guide or self.drive.body or next(iter(self.body))

    @property
    def turning_body(self) -> int | None:
        """The number of the body whose turns are revolutions, None where time is the unit.

        It is that of ``turning``; without it the driven one, or the first, where the ground has its pin.
        """
        if self.turning is not None:
            return self.number(self.turning) if self.turning else None
        is_pinned = (
            self.drive.guide is None and self.ground.pins_m.keys() & self.body[self.driven].pins_m.keys()
        )
        return self.number(self.driven) if is_pinned else None

    @property
    def speed_is_prescribed(self) -> bool:
        """Whether the driver keeps a speed, constant or not, whatever that takes."""
        return self.mechanism.drive.prescribes

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in their order."""
        return tuple(pin.name for pin in self.mechanism.pins)

    @property
    def clearances(self) -> dict[str, form.Clearance]:
        """The clearances of the joints that have one, by the joints' names, in their order."""
        return {name: self.clearance[name] for name in self.joints if name in self.clearance}

    @property
    def joints_with_clearance(self) -> tuple[str, ...]:
        """Names of the joints with clearance, in their order."""
        return tuple(self.clearances)


def with_fields(data: dict[str, Any], fields: Mapping[str, object]) -> dict[str, Any]:
    """Return the data of a scene with values put into it by their fields' paths, and sections for them."""
    for path, value in fields.items():
        part, *names = data, *path.split(".")
        for name in names[:-1]:
            if not isinstance(part.get(name), dict):
                part[name] = {}
            part = part[name]
        part[names[-1]] = value
        if value is None:
            del part[names[-1]]
    return data

"""A scene: one planar mechanism in motion, from its start to its end, as frozen data that fits together."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import tomli_w
from pydantic import PrivateAttr, ValidationInfo, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.checks import check_parts
from engine_models.scene.format import Clearance, SceneError, Sections
from engine_models.scene.mechanism import markers_of, mechanism_data, number_of, pins_of, point_of
from engine_models.scene.plain_words import expect
from engine_models.scene.short import OF_GENERAL, CrankSlider, Link, Slider, in_short
from engine_models.scene.start import Placed, placed
from reference_solver.mechanism import data
from reference_solver.mechanism.data import Point

#: The path of a field, or values by their paths.
Fields = Annotated[str | Mapping[str, object], expect("a string or a mapping of names to values")]


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


class Scene(Sections):
    """A scene whose sections fit together, put together at its start; see ``Sections``."""

    _short: CrankSlider | None = PrivateAttr(None)
    _placed: Placed = PrivateAttr()

    @model_validator(mode="after")
    def _hangs_together(self, info: ValidationInfo) -> "Scene":
        self._short = (info.context or {}).get("short")
        check_parts(self)
        self._placed = placed(self, self.mechanism, self._short)
        return self

    @classmethod
    def checked(cls, data: Mapping[str, Any], folder: Path = Path(), **_: Any) -> "Scene":
        """Return the scene that a mapping describes, in the short spelling or in the general one.

        Raises:
            SceneError: it is none.
        """
        if "crank" not in data and data.keys() & {*OF_GENERAL}:
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
        assert self._short is not None, (
            f"scene {self.name}: another mechanism than a crank-slider or a pendulum"
        )
        return self._short

    def crank_slider(self) -> tuple[Link, Link, Slider]:
        """Return crank, rod and slider of a scene that is written as a crank-slider."""
        assert self.short.rod is not None
        assert self.short.slider is not None
        return self.short.crank, self.short.rod, self.short.slider

    @cached_property
    def mechanism(self) -> data.MechanismData:
        """The mechanism by names, from which engines build it."""
        return mechanism_data(self)

    @property
    def placed(self) -> Placed:
        """The start: coordinates and velocities of all bodies."""
        return self._placed

    @property
    def observed(self) -> Observed:
        """What the scene is about."""
        name, _, axis = self.observe.rpartition(".")
        if axis == "angle":
            return Observed(self.observe, "angle", number_of(self, name))
        if axis == "along":
            guide = self.mechanism.guides[[*self.guide].index(name)]
            return Observed(self.observe, "along", guide.body_j, guide.point_j, guide)
        last = pins_of(self)[name][-1]
        what: Literal["x", "y"] = "x" if axis == "x" else "y"
        return Observed(self.observe, what, number_of(self, last), point_of(self, last, name))

    @property
    def markers(self) -> dict[str, tuple[int, Point]]:
        """The pins of no joint, guide or spring, by their names: the body of each, and its point there."""
        markers = markers_of(self).items()
        return {pin: (number_of(self, body), point_of(self, body, pin)) for pin, body in markers}

    @property
    def turning_body(self) -> int | None:
        """The number of the body whose turns are revolutions, None where time is the unit.

        It is that of ``turning``; without it the driven one, or the first, where the ground has its pin.
        """
        if self.turning is not None:
            return number_of(self, self.turning) if self.turning else None
        body = self.drive.body or next(iter(self.body))
        is_pinned = self.ground.pins_m.keys() & self.body[body].pins_m.keys()
        return number_of(self, body) if is_pinned and self.drive.guide is None else None

    @property
    def speed_is_prescribed(self) -> bool:
        """Whether the driver keeps a speed, constant or not, whatever that takes."""
        return self.mechanism.drive.prescribes

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in their order."""
        return tuple(pin.name for pin in self.mechanism.pins)

    @property
    def clearances(self) -> dict[str, Clearance]:
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

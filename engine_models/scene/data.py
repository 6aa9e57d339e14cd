"""What all parts of a scene are made of: frozen, strict data, the kinds of numbers, and refusals in words."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.bad_input import BadInput
from engine_models.scene.plain_words import refusals
from engine_models.scene.units import in_own_units

Part = TypeVar("Part", bound="SceneData")

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
#: Within less time nothing happens, and steps are lost below the least numbers there are.
Duration = Annotated[float, Field(gt=0, ge=1e-100)]
Fraction = Annotated[float, Field(ge=0, le=1)]
#: Beyond this an angle's own spacing is more than 1e-10 rad, and a whole turn is not known that well either.
LARGEST_ANGLE_RAD = 1e6
Angle = Annotated[float, Field(ge=-LARGEST_ANGLE_RAD, le=LARGEST_ANGLE_RAD)]
#: Columns of a table; a list in a file.
Numbers = Annotated[tuple[float, ...], Field(strict=False)]
Angles = Annotated[tuple[Angle, ...], Field(strict=False)]


class SceneError(BadInput):
    """A scene was refused; each of the reasons names the field, what was expected and what came."""

    def __init__(self, *reasons: str) -> None:
        self.reasons = reasons
        super().__init__("; ".join(reasons))


class SceneData(BaseModel):
    """Base of all parts of a scene: immutable, strict about types, unknown keys and non-finite numbers.

    A number whose field's name has a unit may be text with another one: ``"50 mm"``.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _has_numbers_in_own_units(cls, data: object) -> object:
        return in_own_units(data) if isinstance(data, Mapping) else data

    @classmethod
    def checked(cls: type[Part], data: Mapping[str, object]) -> Part:
        """Return what a mapping of its fields describes, each a value or a mapping in its turn.

        Raises:
            SceneError: it is none.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise SceneError(*refusals(error, cls)) from None

    @check_arguments
    def model_copy(self: Part, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Part:
        """Return a copy with other values in some fields, checked as if it had been read from a file.

        Raises:
            SceneError: with them it is none.
        """
        copy = super().model_copy(deep=deep)
        return self.checked(copy.__dict__ | dict(update)) if update else copy


def with_fields(data: dict[str, Any], fields: Mapping[str, object]) -> dict[str, Any]:
    """Return the data of a scene with values put into it by their fields' paths, and sections for them."""
    for path, value in fields.items():
        part, *names = data, *path.split(".")
        for name in names[:-1]:
            if not isinstance(part.get(name), dict):
                part[name] = {}
            part = part[name]
        part[names[-1]] = value
    return data


def require(holds: bool, field: str, expected: str, value: float | None) -> None:
    """Raise a ValueError in the words of ``plain_words`` unless a condition on a field holds."""
    if not holds:
        raise ValueError(f"{field}: expected {expected}, got {'nothing' if value is None else f'{value:g}'}")


def require_presence(needed: bool, field: str, value: float | None, when: str) -> None:
    """Refuse a number that is missing where it is needed, or there where it has no use."""
    require((value is not None) == needed, field, f"{'a number' if needed else 'nothing'} {when}", value)

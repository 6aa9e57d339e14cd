"""What all parts of a scene are made of: frozen, strict data, the kinds of numbers, and refusals in words."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from engine_models.scene.arguments import check_arguments
from engine_models.scene.plain_words import BadInput, expect, refusals
from engine_models.scene.units import in_own_units
from reference_solver.mechanism.data import Interpolation

#: How many points each takes: a cubic spline without conditions at its ends, and a straight line.
FEWEST_POINTS: dict[Interpolation, int] = {"spline": 4, "linear": 2}
Part = TypeVar("Part")
Kind = TypeVar("Kind", bound="SceneData")

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
#: The name of a body, a pin, a guide or a spring.
PartName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$"),
    expect("a name of letters, digits, _ and -, a letter first"),
]


class Parts(dict[str, Part]):
    """Parts or numbers by their names, as a scene has them, which can be hashed as scenes can."""

    def __hash__(self) -> int:  # type: ignore[override]
        """Return a hash of all names and parts."""
        return hash(tuple(self.items()))


#: A mapping of names to parts or numbers in a file.
Named = Annotated[dict[PartName, Part], AfterValidator(Parts)]


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
        return in_own_units(data, **cls.units_of(data)) if isinstance(data, Mapping) else data

    @classmethod
    def units_of(cls, data: Mapping[str, object]) -> dict[str, str]:  # noqa: ARG003
        """Return the units of fields that their names do not tell, by what the part is."""
        return {}

    @classmethod
    def checked(cls: type[Kind], data: Mapping[str, object]) -> Kind:
        """Return what a mapping of its fields describes, each a value or a mapping in its turn.

        Raises:
            SceneError: it is none.
        """
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            raise SceneError(*refusals(error, cls)) from None

    @check_arguments
    def model_copy(self: Kind, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Kind:
        """Return a copy with other values in some fields, checked as if it had been read from a file.

        Raises:
            SceneError: with them it is none.
        """
        copy = super().model_copy(deep=deep)
        fields = {name: getattr(copy, name) for name in type(self).model_fields} | (copy.model_extra or {})
        return self.checked(fields | dict(update)) if update else copy


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


def require_table(
    x_name: str, x: Sequence[float], y_name: str, y: Sequence[float], interpolation: Interpolation
) -> None:
    """Refuse a table that is too short, whose columns differ in length, or whose x does not rise."""
    if len(x) < FEWEST_POINTS[interpolation]:
        raise ValueError(f"{x_name}: expected at least {FEWEST_POINTS[interpolation]} numbers, got {len(x)}")
    if len(y) != len(x):
        raise ValueError(f"{y_name}: expected as many numbers as {x_name} has, {len(x)}, got {len(y)}")
    for place, (before, after) in enumerate(pairwise(x), 1):
        require(after > before, f"{x_name}.{place}", f"a number > {before:g}, the one before", after)
        expected = f"a number neither at {before:g} nor endlessly far from it"
        require(_has_cubic(after - before, y[place] - y[place - 1]), f"{x_name}.{place}", expected, after)


def require_column(name: str, values: Sequence[float] | None) -> None:
    """Refuse a table without one of its columns."""
    if values is None:
        raise ValueError(f"{name}: expected a list of numbers, got nothing")


def require_slopes(slopes: Sequence[float] | None, interpolation: Interpolation) -> None:
    """Refuse slopes at the ends of straight lines, and other than two."""
    if slopes is not None and interpolation == "linear":
        raise ValueError("end_slopes: expected nothing with interpolation = 'linear', got a list")
    if slopes is not None and len(slopes) != 2:
        raise ValueError(
            f"end_slopes: expected two numbers, of the first and the last end, got {len(slopes)}"
        )


def _has_cubic(step: float, rise: float) -> bool:
    """Return whether coefficients of a cubic that rises so far within a step are finite numbers."""
    try:
        return math.isfinite(step**3) and math.isfinite((1.0 + abs(rise)) / step**3)
    except (OverflowError, ZeroDivisionError):
        return False

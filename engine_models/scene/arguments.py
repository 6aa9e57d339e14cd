"""Arguments of the library's functions, held to their annotations: what does not fit is refused in words."""

import inspect
from collections.abc import Callable, Mapping
from functools import cache, wraps
from pathlib import Path
from typing import Annotated, Any, ParamSpec, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model

from engine_models.scene.plain_words import BadInput, expect, refusal
from engine_models.scene.units import NUMBER, in_unit

P = ParamSpec("P")
R = TypeVar("R")

STRICT = ConfigDict(strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
#: NumPy's kinds of numbers and text; times, which would pass for numbers without their unit, are none.
PLAIN_KINDS = tuple("biufOU")


def in_words(unit: str = "") -> Any:
    """Return what in an annotation takes a number as text too, and with a unit."""

    def number(value: object) -> object:
        if isinstance(value, str) and NUMBER.fullmatch(value):
            return int(value) if value.lstrip("+-").isdigit() else float(value)
        return in_unit(value, unit) if unit else value

    return BeforeValidator(number)


#: Where a file or a folder is, or is to be.
Place = Annotated[str | Path, expect("a path")]
#: Times in s, lengths in m and counts as people type them.
Seconds = Annotated[float, Field(gt=0, ge=1e-100), in_words("s")]
Metres = Annotated[float, Field(gt=0), in_words("m")]


def check_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that refuses arguments other than its annotations say by BadInput, before it begins.

    NumPy's numbers and arrays are taken as Python's own. What is raised inside the function stays as it is.
    """
    signature = inspect.signature(function)
    kinds = {name: each.annotation for name, each in signature.parameters.items() if name != "self"}

    @cache
    def model() -> type[BaseModel]:
        fields: Any = {name: (kind, None) for name, kind in kinds.items()}
        return create_model("Arguments", __config__=STRICT, **fields)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = signature.bind(*args, **kwargs)
        given = {name: plain(value) for name, value in bound.arguments.items() if name != "self"}
        try:
            valid = model().model_validate(given)
        except ValidationError as error:
            raise BadInput(refusal(error)) from None
        bound.arguments.update((name, getattr(valid, name)) for name in given)
        return function(*bound.args, **bound.kwargs)

    return checked


def plain(value: Any) -> Any:
    """Return a value with the numbers and arrays of NumPy in it as Python's own numbers and lists."""
    if kind := getattr(getattr(value, "dtype", None), "kind", None):
        exact = value.astype(float) if kind == "f" else value
        value = exact.tolist() if kind in PLAIN_KINDS else repr(value)
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value

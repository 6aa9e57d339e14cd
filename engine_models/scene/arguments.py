"""Arguments of the library's functions, held to their annotations: what does not fit is refused in words."""

import inspect
import os
from collections.abc import Callable, Mapping
from functools import cache, wraps
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, ParamSpec, TypeVar, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
)
from pydantic_core import PydanticCustomError

from engine_models.scene.plain_words import BadInput, expect, refusal
from engine_models.scene.units import NUMBER, in_unit

P = ParamSpec("P")
R = TypeVar("R")

STRICT = ConfigDict(strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)
#: NumPy's kinds of numbers and text, and those of times, which would pass for numbers without their unit.
PLAIN_KINDS, TIMES = tuple("biufOU"), tuple("mM")


def _has_a_name(place: str | Path) -> str | Path:
    """Refuse what no file can be named: with a NUL, or with half of a pair of surrogates."""
    try:
        if b"\0" not in os.fsencode(place):
            return place
    except UnicodeEncodeError:
        pass
    raise PydanticCustomError("no_path", "no path")


#: Where a file or a folder is, or is to be.
Place = Annotated[str | Path, AfterValidator(_has_a_name), expect("a path")]


def in_words(unit: str = "") -> Any:
    """Return what in an annotation takes a number as text too, and with a unit."""

    def number(value: object) -> object:
        if not isinstance(value, str):
            return value
        if NUMBER.fullmatch(value):
            return int(value) if value.isdigit() and len(value) < MOST_DIGITS else float(value)
        return in_unit(value, unit) if unit else value

    return BeforeValidator(number)


#: An integer of more digits is none that anybody means.
MOST_DIGITS = 20
#: Times in s, lengths in m and counts as people type them.
Seconds = Annotated[float, Field(gt=0, ge=1e-100, json_schema_extra={"unit": "s"}), in_words("s")]
Metres = Annotated[float, Field(gt=0, json_schema_extra={"unit": "m"}), in_words("m")]


def check_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that refuses arguments other than its annotations say, before it begins.

    NumPy's numbers and arrays are taken as Python's own. What is raised inside the function stays as it is.

    Raises:
        BadInput: an argument is missing, unknown or of another kind.
    """
    signature = inspect.signature(function)

    @cache
    def model() -> type[BaseModel]:
        kinds = {name: _kind(each) for name, each in signature.parameters.items() if name != "self"}
        fields: dict[str, Any] = {name: (kind, None) for name, kind in kinds.items()}
        return create_model("Arguments", __config__=STRICT, **fields)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as reason:
            expected = ", ".join(name for name in signature.parameters if name != "self") or "no arguments"
            got = str(reason).removeprefix("got ").replace("missing a", "no", 1)
            raise BadInput(f"{function.__name__}: expected {expected}, got a call with {got}") from None
        given = {name: value for name, value in bound.arguments.items() if name != "self"}
        try:
            valid = model().model_validate({name: plain(value) for name, value in given.items()})
        except ValidationError as error:
            raise BadInput(refusal(error, model())) from None
        except RecursionError:
            expected = "values of a few levels"
            raise BadInput(
                f"{function.__name__}: expected {expected}, got too many inside each other"
            ) from None
        bound.arguments.update((name, getattr(valid, name)) for name in given)
        return function(*bound.args, **bound.kwargs)

    hints = _plain_types(signature)  # as people read them
    parameters = [each.replace(annotation=hints[each.name]) for each in signature.parameters.values()]
    checked.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    checked.__annotations__ = {**checked.__annotations__, **hints}
    return checked


def plain(value: Any) -> Any:
    """Return a value with the numbers and arrays of NumPy in it as Python's own numbers and lists."""
    kind = getattr(getattr(value, "dtype", None), "kind", None)
    if kind in PLAIN_KINDS:
        value = (value.astype(float) if kind == "f" else value).tolist()
    if kind in TIMES:
        return repr(value)
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def _plain_types(signature: inspect.Signature) -> dict[str, Any]:
    """Return the types of parameters without what is checked of their values."""
    annotations = {name: each.annotation for name, each in signature.parameters.items()}
    return get_type_hints(SimpleNamespace(__annotations__=annotations))


def _kind(parameter: inspect.Parameter) -> Any:
    """Return what a parameter takes; further arguments by name come as a mapping."""
    return Mapping[str, object] if parameter.kind is parameter.VAR_KEYWORD else parameter.annotation

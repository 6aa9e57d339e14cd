"""Why input was refused, in one line: ``rod.length_m: expected a number greater than 0, got -0.12``.

A validator of a whole part raises a ``ValueError`` of the same form, its field counted from that part; the
part's own path is put before it.
"""

import json
import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import TypeAdapter, ValidationError, WrapValidator
from pydantic_core import ErrorDetails, PydanticCustomError

from engine_models.scene.bad_input import BadInput as BadInput
from engine_models.scene.units import unit_of

BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
#: Beginnings of pydantic's words, and what stands for them.
WORDS = {
    r"\w+ should (be|have) ": "",
    r"a valid (dictionary|mapping).*": "a section",
    r"a valid tuple": "a list",
    r"a valid boolean.*": "true or false",
    r"a valid integer.*": "an integer",
    r"a valid (\w+).*": r"a \1",
    r"Field required": "a value",
    r"None$|Unexpected .*": "nothing",
    r"(at (least|most) \d+ items?) after.*": r"\1",
}
#: Longest piece of the input that a message repeats.
LONGEST = 60


def expect(words: str) -> Any:
    """Return what in an annotation has refusals say so what is expected, in place of pydantic's words."""

    def checked(value: object, validate: Any) -> object:
        try:
            return validate(value)
        except ValidationError:
            raise PydanticCustomError("expected", "{words}", {"words": words}) from None

    return WrapValidator(checked)


def fields(kind: Any) -> dict[str, dict[str, Any]]:
    """Return the JSON schema of each field of a pydantic model or dataclass."""
    properties: dict[str, dict[str, Any]] = TypeAdapter(kind).json_schema()["properties"]
    return properties


def expectation(schema: Mapping[str, Any]) -> str:
    """Return what a field with this JSON schema takes: ``a number > 0``, ``"rk4" or "dop853"``."""
    texts = []
    for choice in schema.get("anyOf", [schema]):
        limits = [f"{sign} {choice[key]}" for key, sign in BOUNDS.items() if key in choice]
        texts += [*map(shown, choice.get("enum", ()))] or [" and ".join([choice["type"], *limits])]
    return one_of([text for text in texts if text != "null"])


def one_of(choices: list[str]) -> str:
    """Return choices as a phrase: ``a, b or c``."""
    return " or ".join([", ".join(choices[:-1]), choices[-1]] if len(choices) > 1 else choices)


def unknown(field: str, came: object, choices: Iterable[str], expected: str = "", got: str = "") -> str:
    """Return the refusal of what is none of the choices: first which of them was meant, if one is like it.

    ``expected`` are words for the choices, ``got`` for what came, where these are not to stand as they are.
    """
    known = {choice.lower(): choice for choice in choices}
    near = get_close_matches(str(came).lower(), known, n=1)
    meant = f"did you mean {known[near[0]]}? " if near else ""
    return f"{field}: {meant}expected {expected or one_of([*known.values()])}, got {got or shown(came)}"


def unknown_key(key: object, known: Iterable[str]) -> str:
    """Return the refusal of a key that is none of a part's."""
    return unknown(shortened(str(key)) or '""', key, known, f"the key {one_of([*known])}", "an unknown key")


def shown(value: object) -> str:
    """Return a value as a TOML file would have it, shortened."""
    if isinstance(value, Mapping):
        return "a section" if value else "an empty section"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, str | bool):
        return shortened(json.dumps(value, ensure_ascii=False))
    return "nothing" if value is None else shortened(str(value))


def shortened(text: str, longest: int = LONGEST) -> str:
    """Return a text with only its beginning if it is long."""
    return text if len(text) <= longest else f"{text[:longest]}..."


def refusal(error: ValidationError, known: Iterable[str] = ()) -> str:
    """Return why pydantic refused data in one line; ``known`` are the keys that it may have."""
    return "; ".join(refusals(error, known))


def refusals(error: ValidationError, known: Iterable[str] = ()) -> list[str]:
    """Return why pydantic refused data: the first three reasons, and how many more there are."""
    reasons = [reason for details in error.errors() for reason in _reasons(details, known)]
    more = len(reasons) - 3
    return reasons if more <= 0 else [*reasons[:2], f"{reasons[2]}; and {more} more"]


def _reasons(error: ErrorDetails, known: Iterable[str]) -> list[str]:
    """Return the reasons of an error."""
    kind, context = error["type"], error.get("ctx", {})
    steps = [shortened(str(step)) or '""' for step in error["loc"] if step != "[key]"]
    if kind == "value_error":
        reasons = getattr(context["error"], "reasons", [str(context["error"])])
        return [".".join([*steps, reason]) for reason in reasons]
    if known and kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return [unknown_key(steps[-1], known)]
    choices = re.findall(r"'([^']*)'", context.get("expected", ""))
    expected = one_of(list(map(shown, choices))) or error["msg"]
    for words, plain in WORDS.items():
        expected = re.sub(f"^{words}", plain, expected)
    for bound, sign in SIGNS.items():
        expected = f"a number {sign} {context[bound]:g}" if bound in context else expected
    unit = next((unit for name in reversed(steps) if (unit := unit_of(name))), None)
    if unit and isinstance(error["input"], str) and "[key]" not in error["loc"]:
        expected += f", or text with a unit such as '1 {unit}'"
    came = "nothing" if kind == "missing" else ""
    return [unknown(".".join(steps), error["input"], choices, expected, came)]

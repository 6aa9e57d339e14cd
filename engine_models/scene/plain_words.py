"""Validated data in plain words: what a field takes, and why input was refused, in one line without jargon.

A refusal reads ``rod.length_m: expected a finite number > 0, got -0.12``. A validator of a whole part raises
a ``ValueError`` of the same form, its field counted from that part; the part's own path is put before it.
"""

import json
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from engine_models.scene.bad_input import BadInput as BadInput
from engine_models.scene.units import NUMBER, unit_of

JsonSchema = dict[str, Any]

NOUNS = {
    "number": "a finite number",
    "integer": "an integer",
    "boolean": "true or false",
    "string": "a string",
}
NUMERIC = (NOUNS["number"], NOUNS["integer"])
BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument", "invalid_key")
NO_TAG = ("union_tag_invalid", "union_tag_not_found")
#: Longest piece of the input that a message repeats, and most reasons that it gives.
LONGEST, MOST_REASONS = 60, 3


def expect(words: str) -> Any:
    """Return what in an annotation has refusals say so what is expected, in place of words for its types."""
    return Field(json_schema_extra={"expected": words})


def fields(kind: Any) -> dict[str, JsonSchema]:
    """Return the JSON schema of each field of a pydantic model or dataclass."""
    properties: dict[str, JsonSchema] = TypeAdapter(kind).json_schema()["properties"]
    return properties


def expectation(schema: JsonSchema) -> str:
    """Return what a field with this JSON schema takes: ``a finite number > 0``, ``"free" or "torque"``."""
    choices = _choices(schema)
    if "expected" in schema:
        return str(schema["expected"])
    if choices:
        return one_of([expectation(choice) for choice in choices])
    if "enum" in schema or "const" in schema:
        return one_of([shown(value) for value in schema.get("enum", [schema.get("const")])])
    if schema.get("type") == "array":
        return f"a list of {schema.get('items', {}).get('type', 'value')}s"
    if _by_chosen_names(schema):
        return "a mapping of names to values"
    noun = NOUNS.get(schema.get("type", ""), "a section")
    bounds = [f"{sign} {schema[name]}" for name, sign in BOUNDS.items() if name in schema]
    return f"{noun} {' and '.join(bounds)}".rstrip()


def one_of(choices: list[str]) -> str:
    """Return choices as a phrase: ``a, b or c``."""
    return " or ".join([", ".join(choices[:-1]), choices[-1]] if len(choices) > 1 else choices)


def unknown(field: str, came: object, choices: Iterable[str], expected: str = "", got: str = "") -> str:
    """Return the refusal of what is none of the choices: first which of them was meant, if one is like it.

    ``expected`` are words for the choices, ``got`` for what came, where these are not to stand as they are.
    """
    known = {choice.lower(): choice for choice in choices}
    near = get_close_matches(typed(came).lower(), list(known), n=1)
    meant = f"did you mean {known[near[0]]}? " if near else ""
    return f"{field}: {meant}expected {expected or one_of([*known.values()])}, got {got or shown(came)}"


def shown(value: object) -> str:
    """Return a value as a TOML file would have it, shortened, on one line."""
    if isinstance(value, dict | BaseModel):
        return "a section" if value != {} else "an empty section"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 2**63:
        return "a huge integer"
    if isinstance(value, str | bool):
        return shortened(json.dumps(value, ensure_ascii=not str(value).isprintable()))
    return shortened(str(value))


def typed(value: object) -> str:
    """Return a value as it would be typed on a command line."""
    try:
        return str(value)
    except ValueError:  # an integer of thousands of digits
        return shown(value)


def shortened(text: str, longest: int = LONGEST) -> str:
    """Return a text with only its beginning if it is long."""
    return text if len(text) <= longest else f"{text[:longest]}..."


def no_numbers(values: Mapping[str, object], kind: Any) -> str:
    """Return a refusal of what is not typed as a number where ``kind`` has one, empty if all are."""
    wanted = {key: expectation(schema) for key, schema in fields(kind).items()}
    return "; ".join(
        f"{key}: expected {wanted[key]}, got {shown(value)}"
        for key, value in values.items()
        if wanted.get(key, "").startswith(NUMERIC) and not NUMBER.fullmatch(typed(value))
    )


def refusal(error: ValidationError, kind: Any) -> str:
    """Return why pydantic refused input for ``kind`` in one line."""
    return "; ".join(refusals(error, kind))


def refusals(error: ValidationError, kind: Any) -> list[str]:
    """Return why pydantic refused input for ``kind``: the first reasons, and how many more there are."""
    root = TypeAdapter(kind).json_schema()
    reasons = [_reason(details, root) for details in error.errors()]
    reasons = list({reason.partition(": ")[0]: reason for reason in reasons}.values())
    more = len(reasons) - MOST_REASONS  # each type that a field may have gives a reason: the last one stays
    return [*reasons[:MOST_REASONS], f"and {more} more"] if more > 0 else reasons


def _reason(error: ErrorDetails, root: JsonSchema) -> str:
    if error["type"] == "value_error":
        path, _ = _follow(error["loc"], root)
        return ".".join([*path, str(error["ctx"]["error"])])
    if error["type"] in UNKNOWN_KEY:
        path, section = _follow(error["loc"][:-1], root)
        known, key = list(section["properties"]), _key(error["loc"][-1])
        return unknown(".".join([*path, key]), key, known, f"the key {one_of(known)}", "an unknown key")
    if error["type"] in NO_TAG:
        path, union = _follow(error["loc"], root)
        tag = union["discriminator"]["propertyName"]
        choices = list(union["discriminator"]["mapping"])
        given = error["input"] if isinstance(error["input"], Mapping) else {}
        came = "" if tag in given else "nothing"
        expected = one_of(list(map(shown, choices)))
        return unknown(".".join([*path, tag]), given.get(tag, ""), choices, expected, came)
    path, field = _follow(error["loc"], root)
    given = error["input"]
    if error["loc"][-1:] == ("[key]",) and "propertyNames" in field:
        path, field = [*path, _key(error["loc"][-2])], field["propertyNames"]
    came = "nothing" if error["type"] == "missing" else shown(given)
    expected = expectation(field) + _or_quantity(error, path, field)
    return unknown(".".join(path), given, field.get("enum", ()), expected, came)


def _or_quantity(error: ErrorDetails, path: list[str], field: JsonSchema) -> str:
    """Return what else is taken where text stands for a number that has a unit, as a mapping's have by it."""
    unit = field.get("unit") or next((unit for name in reversed(path) if (unit := unit_of(name))), None)
    is_number = expectation(field).startswith(NUMERIC) and isinstance(error["input"], str)
    return f", or text with a unit such as '1 {unit}'" if unit and is_number else ""


def _key(key: int | str) -> str:
    """Return a key as a TOML file would have it, shortened, on one line."""
    text = typed(key)
    return shortened(text if text and text.isprintable() else json.dumps(text))


def _follow(location: tuple[int | str, ...], root: JsonSchema) -> tuple[list[str], JsonSchema]:
    """Return the path of a location as the input has it, and the schema that stands there.

    Pydantic names the chosen member of a union in its locations, and says where a key is wrong; the input
    does not. What may be of several types is the end of a path.
    """
    path, schema = list[str](), root
    for part in location[:-2] if location[-1:] == ("[key]",) else location:
        if "discriminator" in schema:
            schema = {"$ref": schema["discriminator"]["mapping"][part]}
        elif len(_choices(schema)) > 1:
            break
        else:
            path.append(str(part))
            by_name = schema.get("properties", {}).get(part, _by_chosen_names(schema))
            schema = schema["prefixItems"][part] if "prefixItems" in schema else schema.get("items", by_name)
        schema = _resolved(schema, root)
    return path, schema


def _by_chosen_names(schema: JsonSchema) -> Any:
    """Return the schema of values whose names are free, None if there are none."""
    return next(iter(schema.get("patternProperties", {}).values()), schema.get("additionalProperties"))


def _choices(schema: JsonSchema) -> list[JsonSchema]:
    """Return the schemas of the types that a field may have, beside null; none if it has one type."""
    return [choice for choice in schema.get("anyOf", ()) if choice.get("type") != "null"]


def _resolved(schema: JsonSchema, root: JsonSchema) -> JsonSchema:
    """Return the schema behind a reference, and the one beside null of an optional field."""
    if len(choices := _choices(schema)) == 1:
        schema = {**schema, "anyOf": (), **choices[0]}
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    return schema

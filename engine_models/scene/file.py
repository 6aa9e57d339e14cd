"""Scenes from TOML files, every refusal in one plain line, and the schema by which editors check them."""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import DictSchema, FloatSchema

from engine_models.scene.format import SceneError as SceneError
from engine_models.scene.plain_words import shortened
from engine_models.scene.scene import Scene, with_fields
from engine_models.scene.short import CrankSlider
from engine_models.scene.tables import read_text
from engine_models.scene.units import NUMBER, UNIT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: A section's head, or a key before its value: names with dots between them.
NAME = r"(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')"
LINE = re.compile(rf"\s*(\[?)\s*({NAME}(?:\s*\.\s*{NAME})*)\s*[]=]")


def entries(text: str) -> dict[str, Any]:
    """Return what a TOML text says; raise SceneError if it is none."""
    try:
        data: dict[str, Any] = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also an integer too long for Python to read
        reason = shortened(" ".join(str(error).split()), 150)
        raise SceneError(f"TOML syntax: expected valid TOML, got '{reason}'") from None
    return data


def from_toml(text: str, folder: Path = Path(), changes: Mapping[str, object] = {}) -> Scene:
    """Return the scene that a TOML text describes with some changes, with tables in a folder."""
    return Scene.checked(with_fields(entries(text), changes), folder)


def load(path: Path, changes: Mapping[str, object] = {}, option: str = "") -> Scene:
    """Return the scene in a TOML file, whose tables are beside it, with changes that an option asked for.

    Raises BadInput where there is no text, SceneError where that is no scene: what is wrong in the file is
    told with the line, what is with a change with the option.
    """
    text = read_text(path)
    try:
        return from_toml(text, path.parent, changes)
    except SceneError as error:
        reasons, lines = [], lines_of(text)
        for why in error.reasons:
            field = why.partition(": ")[0]
            beside = field if field in lines else f"{field.rpartition('.')[0] or field}."
            if any(f"{field}.".startswith(f"{it}.") or it.startswith(beside) for it in changes):
                reasons.append(f"{option} {why}")
                continue
            while field and field not in lines:  # missing: where it would stand
                field = field.rpartition(".")[0]
            reasons.append(f"{path}: line {lines[field]}: {why}" if field else f"{path}: {why}")
        raise SceneError(*reasons) from None


def lines_of(text: str) -> dict[str, int]:
    """Return the numbers of the lines, from 1, on which sections and fields of a text are first, by paths."""
    lines, section = dict[str, int](), ""
    for number, line in enumerate(text.splitlines(), 1):
        if typed := LINE.match(line):
            path = re.sub(r"[\"']|\s*(\.)\s*", r"\1", typed[2])  # without quotes, and blanks around dots
            section = path if typed[1] else section
            names = (path if typed[1] else f"{section}.{path}".removeprefix(".")).split(".")
            for count in range(len(names)):
                lines.setdefault(".".join(names[: count + 1]), number)
    return lines


class _AsTyped(GenerateJsonSchema):
    """The schema of what is typed: names are as they have to be, and a number may be text with a unit."""

    def dict_schema(self, schema: DictSchema) -> JsonSchemaValue:
        own = super().dict_schema(schema)
        return {**own, "additionalProperties": False} if "patternProperties" in own else own

    def float_schema(self, schema: FloatSchema) -> JsonSchemaValue:
        text = {"type": "string", "pattern": rf"^\s*{NUMBER.pattern}\s*{UNIT}$"}
        return {"anyOf": [super().float_schema(schema), text]}


def scene_schema() -> JsonSchemaValue:
    """Return the JSON schema of what a scene's file may contain. What only belongs together is not in it.

    A file with a crank has the short form, others the general one.
    """
    parts = TypeAdapter(CrankSlider | Scene).json_schema(schema_generator=_AsTyped)["$defs"]
    then, other = ({"$ref": f"#/$defs/{form.__name__}"} for form in (CrankSlider, Scene))
    return {"$defs": parts, "if": {"required": ["crank"]}, "then": then, "else": other}

"""A JSON schema of scene files, with which editors complete and check them while they are typed."""

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import DictSchema, FloatSchema

from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankSlider
from engine_models.scene.units import NUMBER, UNIT


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

"""A JSON schema of scene files, with which editors complete and check them while they are typed."""

from engine_models.scene.plain_words import JsonSchema
from engine_models.scene.scene import Scene
from engine_models.scene.tables import TABLES
from engine_models.scene.units import NUMBER, UNIT, unit_of

#: Text with a unit, as a number may be typed.
QUANTITY: JsonSchema = {"type": "string", "pattern": rf"^\s*{NUMBER.pattern}\s*{UNIT}$"}
#: What pydantic says of a field that no editor needs.
LEFT_OUT = ("title", "expected")


def scene_schema() -> JsonSchema:
    """Return the JSON schema of what a scene's file may contain. What only belongs together is not in it."""
    schema = Scene.model_json_schema()
    for part in (schema, *schema["$defs"].values()):
        fields = part["properties"]
        part["properties"] = {name: _as_typed(field, unit_of(name)) for name, field in fields.items()}
        for columns in TABLES.values():
            if set(columns) <= set(fields):
                part["properties"]["file"] = {"type": "string", "description": "a CSV file in place of lists"}
                part["required"] = [name for name in part["required"] if name not in columns]
                part["oneOf"] = [{"required": list(columns)}, {"required": ["file"]}]
    return schema


def _as_typed(field: JsonSchema, unit: str | None) -> JsonSchema:
    """Return the schema of a field as files have it: never null, and a number may be text with a unit."""
    kept = {
        key: value for key, value in field.items() if key not in ("title", "expected") and value is not None
    }
    choices = [choice for choice in kept.pop("anyOf", ()) if choice.get("type") != "null"]
    if len(choices) == 1:
        kept |= _as_typed(choices[0], unit)
    elif choices:
        kept["anyOf"] = choices
    if unit and kept.get("type") == "array":
        kept["items"] = _as_typed(kept["items"], unit)
    if unit and kept.get("type") == "number":
        return {"anyOf": [kept, QUANTITY], "description": f"in {unit}, or text with a unit"}
    return kept

"""A JSON schema of scene files, with which editors complete and check them while they are typed."""

from pydantic import TypeAdapter

from engine_models.scene.plain_words import JsonSchema
from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankSlider
from engine_models.scene.tables import BY_TIME, OF_CRANK, OF_DRIVES, OF_GAS, OPTIONAL
from engine_models.scene.units import NUMBER, UNIT, unit_of

#: Text with a unit, as a number may be typed.
QUANTITY: JsonSchema = {"type": "string", "pattern": rf"^\s*{NUMBER.pattern}\s*{UNIT}$"}
#: What pydantic says of a field that no editor needs.
LEFT_OUT = ("title", "expected", "propertyNames")
#: The parts that may have a file in place of columns.
OF_TABLE = ("angle_rad", "position_m")
TABLES = {
    "TableDrive": OF_DRIVES["table"],
    "TorqueDrive": ("torque_N_m",),
    "CrankGas": OF_CRANK,
    "Gas": OF_GAS,
    "ByTime": BY_TIME,
}
#: A CSV file in place of lists.
FILE: JsonSchema = {"type": "string", "description": "a CSV file in place of lists"}


def scene_schema() -> JsonSchema:
    """Return the JSON schema of what a scene's file may contain. What only belongs together is not in it.

    A file with a crank has the short form, others the general one.
    """
    forms: JsonSchema = TypeAdapter(CrankSlider | Scene).json_schema()
    parts = forms["$defs"]
    for part in parts.values():
        fields = part["properties"]
        part["properties"] = {name: _as_typed(field, unit_of(name)) for name, field in fields.items()}
    for name, columns in TABLES.items():
        part = parts[name]
        part["properties"]["file"] = FILE
        part["required"] = [field for field in part["required"] if field not in columns]
        lists: JsonSchema = {
            "required": [column for column in columns if name != "ByTime" or column not in OPTIONAL]
        }
        if name == "TableDrive":
            lists = {"required": ["time_s"], "anyOf": [{"required": [each]} for each in OF_TABLE]}
        part["oneOf"] = [lists, {"required": ["file"]}]
    parts["MotorDrive"]["properties"]["file"] = FILE
    short, general = ({"$ref": f"#/$defs/{form.__name__}"} for form in (CrankSlider, Scene))
    return {"$defs": parts, "if": {"required": ["crank"]}, "then": short, "else": general}


def _as_typed(field: JsonSchema, unit: str | None) -> JsonSchema:
    """Return the schema of a field as files have it: never null, and a number may be text with a unit."""
    kept = {key: value for key, value in field.items() if key not in LEFT_OUT and value is not None}
    choices = [choice for choice in kept.pop("anyOf", ()) if choice.get("type") != "null"]
    if len(choices) == 1:
        kept |= _as_typed(choices[0], unit)
    elif choices:
        kept["anyOf"] = [_as_typed(choice, unit) for choice in choices]
    if "patternProperties" in kept:
        named = {name: _as_typed(value, unit) for name, value in kept["patternProperties"].items()}
        kept |= {"patternProperties": named, "additionalProperties": False}
    if not unit:
        return kept
    for inner in ("items", "additionalProperties"):
        if isinstance(kept.get(inner), dict):
            kept[inner] = _as_typed(kept[inner], unit)
    if "prefixItems" in kept:
        kept["prefixItems"] = [_as_typed(item, unit) for item in kept["prefixItems"]]
    if kept.get("type") == "number":
        return {"anyOf": [kept, QUANTITY], "description": f"in {unit}, or text with a unit"}
    return kept

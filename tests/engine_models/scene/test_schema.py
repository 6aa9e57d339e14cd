"""The schema that is printed takes what files may say, and nothing else."""

import json
from typing import Any

import jsonschema
import pytest

import crankslider as cs
from engine_models.scene.file import from_toml, scene_schema
from engine_models.scene.library import ALL_SCENES
from tests.helpers.command import crankslider
from tests.input.scenes import base

#: Scenes of both forms, and values of their fields, some good, some bad.
VALUES: dict[str, dict[str, list[Any]]] = {
    "free": {
        "crank.length_m": ["50 mm", "fifty", -0.05],
        "crank.length": [0.05],
        "gravity_m_s2": ["1 g_0", [0, "-1 g_0"]],
        "drive": [
            {"kind": "table", "file": "drive.csv"},
            {"kind": "tabel"},
            {"kind": "torque", "torque_N_m": True},
        ],
        "load": [{"slider": {"gas": {"file": "gas.csv"}}}, {"slider": {"gas": {"file": 3}}}],
        "name": [""],
        "start.time_s": ["0 s"],
    },
    "four-bar": {
        "body.crank.pins_m.A": ["100 mm", "far", [0, 0, 0]],
        "body.crank.pins_m": [{"O": ["0 mm", 0], "A": 0.1}],
        "body.crank.mass_kg": [0],
        "body.crank.colour": [1],
        "body.crank": [{"mass_kg": 1, "inertia_kg_m2": 1}],
        "body": [{}, {"the crank": {"pins_m": {"O": 0}, "mass_kg": 1, "inertia_kg_m2": 1}}],
        "belt": [{}],
        "start.angle_rad.crank": ["40 deg", "steep"],
        "drive": [
            {"kind": "torque", "file": "a.csv"},
            {"kind": "motor", "file": "a.csv"},
            {"kind": "belt"},
        ],
        "gravity_m_s2": [[0, "-1 g_0"]],
        "spring": [{"s": {"between": ["ground.O"], "stiffness_N_m": 1, "free_length_m": 1}}],
        "guide": [{"g": {"body": "crank", "pin": "A", "turns": "yes"}}],
        "observe": [3],
        "end_time_s": [-1],
    },
}


def is_valid(data: object) -> bool:
    """Return whether a validator of JSON schemas finds nothing wrong."""
    return bool(jsonschema.Draft202012Validator(scene_schema()).is_valid(data))


def test_the_schema_that_is_printed_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(scene_schema())
    assert crankslider("schema").stdout.startswith('{\n  "$defs": {')


@pytest.mark.parametrize("name", ALL_SCENES)
def test_the_schema_takes_every_scene_of_the_library(name: str) -> None:
    assert is_valid(json.loads(json.dumps(ALL_SCENES[name]().as_written())))


@pytest.mark.parametrize(
    ("name", "field", "value"),
    [(name, field, value) for name, of in VALUES.items() for field in of for value in of[field]],
)
def test_the_schema_takes_what_a_file_may_say(name: str, field: str, value: object) -> None:
    data = json.loads(json.dumps(from_toml(base(name)).as_written()))
    *sections, last = field.split(".")
    part = data
    for section in sections:
        part = part[section]
    part[last] = value
    try:
        from_toml(base(name), changes={field: value})
        taken = True
    except cs.BadInput as error:
        taken = "expected a file that can be read" in str(error)
    assert is_valid(data) == taken

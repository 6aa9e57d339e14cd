"""What the command line says of itself."""

import json
import re
from contextlib import nullcontext

import pytest

from crankslider.command import COMMANDS
from engine_models.engine import UnsupportedScene
from engine_models.engines import ENGINES, engine_class, make_engine
from engine_models.scene.library import ALL_SCENES
from engine_models.scene.plain_words import fields
from tests.helpers.command import crankslider


def test_scenes_lists_every_scene_with_its_description() -> None:
    listed = crankslider("scenes")
    lines, as_json = listed.stdout.splitlines(), json.loads(crankslider("scenes", "--json").stdout)
    assert [each["scene"] for each in as_json] == [*ALL_SCENES]
    assert (listed.code, listed.stderr) == (0, "")
    assert [line.split()[0] for line in lines] == ["scene", *ALL_SCENES]
    for make, line in zip(ALL_SCENES.values(), lines[1:], strict=True):
        scene = make()
        for said in (scene.drive.kind, f"{scene.end_time_s:g} s", (make.__doc__ or "").splitlines()[0]):
            assert said in line


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_lists_every_setting_and_every_scene_that_is_refused_with_the_reason(engine: str) -> None:
    (listed,) = json.loads(crankslider("engines", engine, "--json").stdout)
    said = crankslider("engines", engine).stdout
    assert [name for name, *_ in listed["settings"]] == [*fields(engine_class(engine))]
    reasons = {name: why for why, names in listed["refused"].items() for name in names}
    assert [word for word in (*fields(engine_class(engine)), *reasons) if word not in said] == []
    for name, make in ALL_SCENES.items():
        refused = pytest.raises(UnsupportedScene, match=re.escape(reasons.get(name, "")))
        with refused if name in reasons else nullcontext():
            make_engine(engine).check(make())


def test_help_is_there_for_every_command() -> None:
    for name in (each.__name__ for each in COMMANDS):
        done = crankslider(name, "-h")
        assert (done.code, done.stderr) == (0, "")
        assert f"crankslider {name}" in done.stdout
        assert name in crankslider("--help").stdout

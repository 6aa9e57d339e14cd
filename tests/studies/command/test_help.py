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
    lines = listed.stdout.splitlines()
    assert (listed.code, listed.stderr) == (0, "")
    assert [line.split()[0] for line in lines] == ["scene", *ALL_SCENES]
    for make, line in zip(ALL_SCENES.values(), lines[1:], strict=True):
        scene = make()
        for said in (scene.drive.kind, f"{scene.end_time_s:g} s", (make.__doc__ or "").splitlines()[0]):
            assert said in line


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_lists_every_setting_and_every_scene_that_is_refused_with_the_reason(engine: str) -> None:
    listed = {each["engine"]: each for each in json.loads(crankslider("engines", "--json").stdout)}[engine]
    said = crankslider("engines", engine).stdout
    assert [setting.strip() for setting, *_ in listed["settings"]] == [*fields(engine_class(engine))]
    assert [name for name in (*fields(engine_class(engine)), *listed["refused"]) if name not in said] == []
    for name, make in ALL_SCENES.items():
        refused = pytest.raises(UnsupportedScene, match=re.escape(listed["refused"].get(name, "")))
        with refused if name in listed["refused"] else nullcontext():
            make_engine(engine).check(make())


def test_help_is_there_for_every_command() -> None:
    for name in (each.__name__ for each in COMMANDS):
        done = crankslider(name, "-h")
        assert (done.code, done.stderr) == (0, "")
        assert f"crankslider {name}" in done.stdout
        assert name in crankslider("--help").stdout

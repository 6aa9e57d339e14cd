"""What the command line says of itself, and what it passes on."""

import json
import re
from pathlib import Path

import pytest

from crankslider.command import app
from engine_models.engine import UnsupportedScene
from engine_models.engines import ENGINES, engine_class, make_engine
from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.plain_words import fields
from reports import page
from reports.page import Chapter, Claim, Made, Report
from studies import runner
from studies.registry import STUDIES
from tests.helpers.command import crankslider

#: The names of all commands, and of those that print at once what they have to say.
COMMANDS = [function.__name__ for command in app.registered_commands if (function := command.callback)]
LISTINGS = ("scenes", "engines", "show", "schema")


def test_scenes_lists_every_scene_with_its_description() -> None:
    listed = crankslider("scenes")
    lines = listed.stdout.splitlines()
    assert (listed.code, listed.stderr) == (0, "")
    assert [line.split()[0] for line in lines] == ["scene", *ALL_SCENES]
    for make, line in zip(ALL_SCENES.values(), lines[1:], strict=True):
        scene = make()
        for said in (scene.driven_by.kind, f"{scene.end_time_s:g} s", (make.__doc__ or "").splitlines()[0]):
            assert said in line


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_lists_every_setting_and_every_scene_that_is_refused_with_the_reason(engine: str) -> None:
    listed = {each["engine"]: each for each in json.loads(crankslider("engines", "--json").stdout)}[engine]
    said = crankslider("engines", engine).stdout
    for setting in fields(engine_class(engine)):
        assert f"\n  {setting} " in said
    assert [setting.strip() for setting, *_ in listed["settings"]] == [*fields(engine_class(engine))]
    for name, make in ALL_SCENES.items():
        if name in listed["refused"]:
            assert f"{name}" in said
            with pytest.raises(UnsupportedScene, match=re.escape(listed["refused"][name])):
                make_engine(engine).check(make())
        else:
            make_engine(engine).check(make())
    assert "BaseModel" not in said


def test_an_engine_in_full_has_its_whole_documentation_and_the_values_of_its_settings() -> None:
    said = crankslider("engines", "scipy").stdout
    assert "LSODA can come to a standstill" in said
    assert "max_evaluations  5000000" in said
    assert "exudyn" not in said
    assert '"none", "baumgarte" or "projection"' in crankslider("engines", "reference").stdout


@pytest.mark.parametrize("help_", ["-h", "--help"])
@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_there_for_every_command(command: str, help_: str) -> None:
    done = crankslider(command, help_)
    assert (done.code, done.stderr) == (0, "")
    assert f"crankslider {command}" in done.stdout
    assert ("--quiet" in done.stdout) == (command not in LISTINGS), "what says how far it is can be quiet"
    assert command in crankslider(help_).stdout
    if command == "run":
        assert all(study in done.stdout for study in STUDIES)


def test_run_passes_on_what_was_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(runner, "run_studies", lambda *it: calls.append((*it[:3], *it[4:])))
    monkeypatch.chdir(tmp_path)
    assert crankslider("run").code == 0
    options = ("--full", "--retry-failed", "--jobs", 3, "--out", tmp_path)
    assert crankslider("run", "accuracy", *options).code == 0
    assert calls == [
        (list(STUDIES), False, Path("results"), False, []),
        (["accuracy"], True, tmp_path, True, []),
    ]


def test_report_passes_on_what_was_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[object, ...]] = []

    def write_report(*arguments: object) -> Report:
        calls.append(arguments)
        chapter = Chapter("answer", "", (), "", lambda _: iter(()))
        return Report((Made(chapter, (Claim("answer", "The answer."),)),), ("a note",))

    monkeypatch.setattr(page, "write_report", write_report)
    monkeypatch.chdir(tmp_path)
    done = crankslider("report")
    assert (done.stdout, done.stderr) == (
        "The answer.\n",
        "note: a note\nnote: the report is report/index.html\n",
    )
    assert crankslider("report", "--results", tmp_path, "--out", tmp_path / "r").code == 0
    assert [results for results, *_ in calls] == [Path("results"), tmp_path]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r", "report"]

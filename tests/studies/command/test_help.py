"""What the command line says of itself, and what it passes on."""

import os
from pathlib import Path

import pytest

from engine_models.engines import ENGINES, engine_class
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.library.mechanisms import ALL_SCENES
from engine_models.scene.plain_words import fields
from reports import page
from reports.page import Chapter, Claim, Made, Report
from studies import failures, runner
from studies.command.main import app
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
def test_engines_lists_what_runs_and_every_setting_with_a_line_out_of_its_documentation(engine: str) -> None:
    blocks = crankslider("engines").stdout.split("\n\n")
    lines = next(block for block in blocks if block.startswith(f"{engine}: ")).splitlines()
    documentation = " ".join(crankslider("engines", engine).stdout.replace("``", "").split())
    for setting in fields(engine_class(engine)):
        line = next(line for line in lines if line.startswith(f"  {setting} "))
        explained = line.split("  ")[-1].removesuffix(" ...")
        assert len(explained) > 20, setting
        assert explained in documentation, setting
    runs = next(line for line in lines if line.startswith("  runs "))
    assert all(scene in runs for scene in IDEAL_SCENES)
    refused = [line for line in lines if line.startswith("  not ")]
    run_or_refused = [scene in runs or any(scene in line for line in refused) for scene in ALL_SCENES]
    assert all(run_or_refused), "every scene is run or refused with a reason"


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


@pytest.mark.parametrize("command", [("engines",), ("--help",)])
def test_a_terminal_of_no_width_changes_nothing(command: tuple[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    usual = crankslider(*command)
    monkeypatch.setenv("COLUMNS", "0")
    assert crankslider(*command) == usual


def test_in_quiet_there_are_warnings_and_no_more(capsys: pytest.CaptureFixture[str]) -> None:
    with failures.quietly(True):
        failures.note("so many cases")
        failures.progress_console().print("half of them")
        failures.say("warning: one is wrong")
    failures.note("afterwards")
    assert capsys.readouterr().err == "warning: one is wrong\nnote: afterwards\n"


@pytest.mark.parametrize(
    ("words", "completed"),
    [("crankslider simulate ideal-f", "ideal-free ideal-fluctuating"), ("crankslider engines sc", "scipy")],
)
def test_a_shell_completes_names(words: str, completed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_CRANKSLIDER_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    assert crankslider().stdout.split() == completed.split()


def test_run_passes_on_what_was_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(runner, "run_studies", lambda *arguments: calls.append(arguments))
    assert crankslider("run").code == 0
    options = ("--full", "--retry-failed", "--jobs", 3, "--out", tmp_path)
    assert crankslider("run", "agreement", *options).code == 0
    assert calls == [
        (list(STUDIES), False, os.cpu_count(), Path("results"), None, False, ()),
        (["agreement"], True, 3, tmp_path, None, True, ()),
    ]


def test_report_passes_on_what_was_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    calls: list[tuple[object, ...]] = []

    def write_report(*arguments: object) -> Report:
        calls.append(arguments)
        chapter = Chapter("answer", "", (), "", lambda _: iter(()))
        return Report((Made(chapter, (Claim("answer", "The answer."),), (), ()),), ("a note",))

    monkeypatch.setattr(page, "write_report", write_report)
    monkeypatch.chdir(tmp_path)
    done = crankslider("report")
    assert (done.stdout, done.stderr) == (
        "The answer.\n",
        "note: a note\nnote: the report is report/index.html\n",
    )
    assert crankslider("report", "--results", tmp_path, "--out", tmp_path / "r").code == 0
    assert [results for results, _ in calls] == [Path("results"), tmp_path]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r", "report"]

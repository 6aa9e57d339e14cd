"""What the command line says of itself."""

import os
import subprocess
import sys

import pytest

from engine_models.engines import ENGINES, engine_class
from engine_models.scene.plain_words import fields
from studies.command.main import app
from studies.running import failures
from studies.running.registry import STUDIES
from tests.helpers.command import crankslider

#: The names of all commands.
COMMANDS = [function.__name__ for command in app.registered_commands if (function := command.callback)]


@pytest.mark.parametrize("engine", ENGINES)
def test_every_setting_is_explained_in_a_line_out_of_the_documentation(engine: str) -> None:
    block = next(
        block for block in crankslider("engines").stdout.split("\n\n") if block.startswith(f"{engine}: ")
    )
    documentation = " ".join(crankslider("engines", engine).stdout.replace("``", "").split())
    for setting in fields(engine_class(engine)):
        line = next(line for line in block.splitlines() if line.startswith(f"  {setting} "))
        explained = line.split("  ")[-1].removesuffix(" ...")
        assert len(explained) > 20, setting
        assert explained in documentation, setting


def test_an_engine_in_full_has_its_whole_documentation() -> None:
    said = crankslider("engines", "scipy").stdout
    assert "LSODA can come to a standstill" in said
    assert "max_evaluations  5000000" in said
    assert "exudyn" not in said


#: Commands that print at once what they have to say.
LISTINGS = ("scenes", "engines", "show", "schema")


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in LISTINGS])
def test_what_says_how_far_it_is_can_be_quiet(command: str) -> None:
    assert "--quiet" in crankslider(command, "--help").stdout


def test_in_quiet_there_are_warnings_and_no_more(capsys: pytest.CaptureFixture[str]) -> None:
    with failures.quietly(True):
        failures.note("so many cases")
        failures.progress_console().print("half of them")
        failures.say("warning: one is wrong")
    failures.note("afterwards")
    assert capsys.readouterr().err == "warning: one is wrong\nnote: afterwards\n"


@pytest.mark.parametrize("help_", ["-h", "--help"])
def test_help_is_there_for_every_command(help_: str) -> None:
    assert "simulate" in crankslider(help_).stdout
    for command in COMMANDS:
        done = crankslider(command, help_)
        assert (done.code, done.stderr) == (0, "")
        assert f"crankslider {command}" in done.stdout


def test_the_studies_are_named_where_one_looks_for_them() -> None:
    said = crankslider("run", "-h").stdout
    assert all(study in said for study in STUDIES)


@pytest.mark.parametrize(
    ("words", "completed"),
    [("crankslider simulate ideal-f", "ideal-free ideal-fluctuating"), ("crankslider engines sc", "scipy")],
)
def test_a_shell_completes_names(words: str, completed: str) -> None:
    shell = {
        "_CRANKSLIDER_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split()) - 1),
    }
    command = [sys.executable, "-c", "from studies.command.main import main; main()"]
    done = subprocess.run(command, env={**os.environ, **shell}, capture_output=True, text=True, check=True)
    assert done.stdout.split() == completed.split()

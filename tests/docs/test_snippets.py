"""What pages tell people to type works: every block is run, or at least read by what reads such things."""

import re
import shlex
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from runpy import run_path
from typing import Any, cast

import pytest
import yaml
from typer.main import get_command

from crankslider.command import make_app
from engine_models import engines
from engine_models.scene.scene import Scene
from studies.case import STUDIES
from tests.docs.pages import EXAMPLES, PAGES, ROOT, Block, blocks
from tests.helpers.command import crankslider

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: Languages in which one types to a shell, and what stands before a command there.
SHELLS = {"console": "$ ", "bash": "", "sh": ""}
#: Commands of ours that take minutes: their options are read, and nothing is run.
LONG = ("run", "report", "compare", "sweep", "baseline")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A reader's folder with the examples in it; what is imported from there is forgotten afterwards."""
    for example in EXAMPLES:
        shutil.copy(example, tmp_path)
        monkeypatch.delitem(sys.modules, example.stem, raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr(engines, "_CLASSES", classes := dict(engines._CLASSES))
    monkeypatch.setattr(engines, "ENGINES", classes.keys())
    return tmp_path


def follow(block: Block, page: str, names: dict[str, object]) -> None:
    """Do what a block says, in the present folder."""
    where, slow = f"{page}:{block.line}", "slow" in block.words
    if block.file:
        Path(block.file).parent.mkdir(parents=True, exist_ok=True)
        Path(block.file).write_text(block.text, encoding="utf-8")
    if block.language in SHELLS:
        for command, expected in _commands(block.text, SHELLS[block.language]):
            _type(command, expected, where, slow)
    elif block.language == "python":
        code = compile(block.text, where, "exec")
        if not (slow or block.file):
            exec(code, names)
    elif block.language == "toml":
        _read_toml(block, where)
    elif block.language == "yaml":
        assert yaml.safe_load(block.text), where
    else:
        assert block.language == "text", f"{where}: {block.language}"


def _commands(text: str, prompt: str) -> list[tuple[str, list[str]]]:
    """Return the commands after the prompts of a block, and the lines that each is said to answer with."""
    commands: list[tuple[str, list[str]]] = []
    for line in text.replace("\\\n", " ").splitlines():
        if line.strip() in ("", "..."):
            continue
        if line.startswith(prompt):
            commands.append((line.removeprefix(prompt), []))
        else:
            commands[-1][1].append(line)
    return commands


def _type(command: str, expected: list[str], where: str, slow: bool) -> None:
    program, *arguments = shlex.split(command, comments=True)
    if program != "crankslider":
        PROGRAMS[program](arguments, where)
        return
    arguments, target = (arguments[:-2], arguments[-1]) if ">" in arguments else (arguments, None)
    _parse(arguments, where)
    if slow or arguments[0] in LONG:
        return
    done = crankslider(*arguments)
    fails = any(line.startswith("error: ") for line in expected)
    assert (done.code != 0) == fails, f"{where}: {command}: {done.stderr}"
    if target:
        Path(target).write_text(done.stdout, encoding="utf-8")
    said = (done.stdout + done.stderr).splitlines()
    missing = [line for line in expected if line not in said]
    assert not missing, f"{where}: {command} does not say {missing}, but {said}"


def _parse(arguments: list[str], where: str) -> None:
    """Have the command line read arguments without doing anything; studies have to be there."""
    name, *rest = arguments
    commands = cast(Any, get_command(make_app(name))).commands
    assert name in commands or name.startswith("--"), f"{where}: no command {name}"
    if not rest:
        return
    parsed = commands[name].make_context(name, rest).params
    unknown = set(parsed.get("studies") or ()) - set(STUDIES)
    assert not unknown, f"{where}: no studies {unknown}"


def _make(targets: list[str], where: str) -> None:
    rules = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert {target for target in targets if "=" not in target} <= rules, where


def _pytest(arguments: list[str], where: str) -> None:
    """Run the tests in the files named; ``--engine`` has a test of its own."""
    for file in (each for each in arguments if each.endswith(".py")):
        tests = {name: test for name, test in run_path(file).items() if name.startswith("test_")}
        assert tests, where
        for test in tests.values():
            test()


#: What checks what other programs than ours are given; some are taken as they are.
PROGRAMS: Mapping[str, Callable[[list[str], str], None]] = {
    "make": _make,
    "pytest": _pytest,
    **dict.fromkeys(("git", "cd", ".", ".ci/run", "dask", "pip", "python"), lambda *_: None),
}


def _read_toml(block: Block, where: str) -> None:
    """Check a scene; a part of one takes the place of that part in the page's last scene."""
    data = tomllib.loads(block.text)
    if "project" in data:
        return
    if not block.file:
        kept = max(Path().glob("*.toml"), key=lambda path: path.stat().st_mtime_ns)
        data = {**tomllib.loads(kept.read_text(encoding="utf-8")), **data}
    assert Scene.checked(data), where


@pytest.mark.system
@pytest.mark.parametrize("page", PAGES)
@pytest.mark.usefixtures("folder")
def test_every_block_of_a_page_works(page: str) -> None:
    names: dict[str, object] = {}
    for block in blocks(page):
        follow(block, page, names)


def test_every_command_in_a_sentence_is_one_and_every_block_says_its_language() -> None:
    for page in PAGES:
        for command in re.findall(r"`crankslider ([^`]+)`", (ROOT / page).read_text(encoding="utf-8")):
            _parse(shlex.split(command.partition(" > ")[0]), f"{page}: {command}")
    languages = {block.language for page in PAGES for block in blocks(page)}
    assert "" not in languages
    assert {"console", "python", "toml"} <= languages

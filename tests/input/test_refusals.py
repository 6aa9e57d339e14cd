"""Bad input as a table: what is wrong, and below it the whole line that says so, where ``...`` is anything.

``== NAME | CHANGES ==`` heads cases in the scene file NAME. A case is a list, by ``;;``, of changes
"OLD => NEW" (a line at the end where there is no OLD), "csv TEXT" for the file table.csv, and "$ ARGUMENTS"
for another call than ``CALL``. Below ``== library ==`` it is a call of the library. ``RENEW=1 pytest -n 0``
writes what is said now into the table, for the diff.
"""

import os
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import crankslider as cs
from tests.helpers.command import crankslider
from tests.input.scenes import base, changed

TABLE = Path(__file__).parent / "refusals.txt"
CALL = ["simulate", "scene.toml", "--out", "out.csv"]
LOOSE = "clearance-driven-0.5mm"


class Case(NamedTuple):
    """Where it is, in which file or of what; what is wrong; and what is said of that."""

    line: int
    head: str
    wrong: str
    said: str


def cases() -> Iterator[Case]:
    head = wrong = ""
    for number, line in enumerate(TABLE.read_text(encoding="utf-8").splitlines()):
        if line.startswith("== "):
            head = line.strip("= ")
        elif line.startswith("    "):
            yield Case(number, head, wrong, line[4:])
        else:
            wrong = line


def plain(text: str) -> str:
    """Return a text without its escapes: {count*character}, a line's end, and the backslash."""
    text = re.sub(r"\{(\d+)\*(.)\}", lambda found: int(found[1]) * found[2], text)
    return text.replace("\\n", "\n").replace("\\\\", "\\")


def scene_text(head: str, changes: list[str]) -> str:
    """Return the text of a section's file with more changes."""
    name, *common = head.split(" | ")
    pairs = [change.rpartition("=>")[::2] for change in common + changes]
    return changed(
        base(name), *((plain(old.removesuffix(" ")), plain(new.removeprefix(" "))) for old, new in pairs)
    )


def said_by_command(case: Case) -> str:
    """Write the files of a case, and return what its call says."""
    Path("file").touch()
    Path("out.csv").write_text("before")
    call, changes = CALL, list[str]()
    for piece in case.wrong.split(" ;; "):
        if piece.startswith("$"):
            call = [plain(word) for word in shlex.split(piece[1:])]
        elif piece.startswith("csv"):
            Path("table.csv").write_bytes(piece[4:].encode().decode("unicode_escape").encode("latin1"))
        else:
            changes.append(piece)
    if case.head != "calls":
        Path("scene.toml").write_text(scene_text(case.head, changes), encoding="utf-8")
    files = {path.name: path.read_bytes() for path in Path().iterdir()}
    done = crankslider(*call)
    assert {path.name: path.read_bytes() for path in Path().iterdir()} == files, "nothing is written"
    assert (done.code, done.stdout, done.stderr[:7]) == (2, "", "error: "), done
    assert done.stderr.endswith("\n")
    return done.stderr[7:-1]


@cache
def names() -> dict[str, Any]:
    """Return what calls of the library may use."""
    run, scene = cs.simulate(LOOSE, end=0.001, samples=2), cs.scenes[LOOSE]
    return {"cs": cs, "np": np, "Path": Path, "run": run, "scene": scene}


def said_by_library(call: str) -> str:
    with pytest.raises(cs.BadInput) as refused:
        eval(call, names())
    assert not list(Path().iterdir()), "nothing is written"
    return str(refused.value)


def fits(wanted: str, said: str) -> bool:
    return re.fullmatch(".*".join(map(re.escape, wanted.split("..."))), said) is not None


@pytest.mark.parametrize("case", list(cases()), ids=lambda case: f"{case.head}: {case.wrong}"[:70])
def test_bad_input_is_refused_in_one_line(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    said = said_by_library(case.wrong) if case.head == "library" else said_by_command(case)
    if os.environ.get("RENEW") and not fits(case.said, said):
        lines = TABLE.read_text(encoding="utf-8").splitlines(keepends=True)
        lines[case.line] = f"    {said}\n"
        TABLE.write_text("".join(lines), encoding="utf-8")
    assert fits(case.said, said), said
    assert said.isprintable()
    assert re.search(r": (did you mean .+\? )?expected .+(, got |, which |, whose )", said), (
        "field, what was expected, and what came"
    )


#: Heads of cases whose files are whole without what a case adds.
WHOLE = sorted(
    {
        case.head
        for case in cases()
        if not re.search(r"^(calls|library|nothing)$|=> \[(clearance|start)", case.head)
    }
)


@pytest.mark.parametrize("head", WHOLE)
def test_what_is_changed_is_good(head: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("time_s,angle_rad\n0,0\n0.005,0.5\n0.01,1\n0.02,2\n")
    (tmp_path / "scene.toml").write_text(scene_text(head, []), encoding="utf-8")
    assert crankslider("show", tmp_path / "scene.toml").code == 0

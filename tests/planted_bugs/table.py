"""The published table: which check catches which bug, and at which size of error."""

import ast
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

from tests.planted_bugs.catalogue import ROOT, Bug, bugs
from tests.planted_bugs.planting import Outcome

FOLDER = Path(__file__).parent
#: What was found of each bug the last time that it was planted, and the table made of that.
FOUND, TABLE = FOLDER / "found.json", FOLDER / "table.md"

HEAD = """# Planted bugs

Made by `make planted`: each bug is planted in a copy, and the tests that could see it run until one fails.
What it says is shown with the size of the error where it tells one. How to read the patches: `bugs/*.toml`.
"""


def keep(one: Outcome) -> None:
    """Keep what was found of a bug, and renew the table."""
    found = json.loads(FOUND.read_text(encoding="utf-8")) if FOUND.exists() else {}
    found[one.bug.name] = {"caught_by": one.caught_by, "said": one.said}
    known = {bug.name: found[bug.name] for bug in bugs() if bug.name in found}
    FOUND.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    TABLE.write_text(text(known), encoding="utf-8")


def first(bug: Bug) -> Bug:
    """Return a bug with the test that caught it the last time, if there still is one, before the others."""
    found = json.loads(FOUND.read_text(encoding="utf-8")) if FOUND.exists() else {}
    known = found.get(bug.name, {"caught_by": ""})["caught_by"]
    return replace(bug, tests=(known.partition("[")[0], *bug.tests)) if exists(known) else bug


def exists(test: str) -> bool:
    """Return whether there is a test of pytest's name, which may have parameters."""
    file, _, name = test.partition("::")
    if not (ROOT / file).is_file():
        return False
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    names = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    return name.partition("[")[0] in names


def text(found: dict[str, dict[str, str]]) -> str:
    """Return the table as Markdown."""
    by_check = Counter(of["caught_by"].partition("::")[0].removeprefix("tests/") for of in found.values())
    files = {path.relative_to(ROOT / "tests").as_posix() for path in (ROOT / "tests").rglob("test_*.py")}
    lines = ["| bug | in | why somebody could make it | caught by | what it says |", "|---" * 5 + "|"]
    for bug in bugs():
        of = found.get(bug.name, {"caught_by": "", "said": "not planted yet"})
        check = of["caught_by"].removeprefix("tests/") or "nobody"
        cells = (bug.name, bug.file, bug.why, check, of["said"])
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    tally = ["| file of tests | bugs it catches first |", "|---|---|"]
    tally += [f"| {file or 'nobody'} | {count} |" for file, count in sorted(by_check.items())]
    others = ", ".join(sorted(files - by_check.keys()))
    parts = (HEAD.strip(), "\n".join(lines), "## By file", "\n".join(tally))
    return "\n\n".join([*parts, f"Kept, for claims that no bug here breaks first: {others}."]) + "\n"

"""The arrows of the layout: who may import whom."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("reference_solver", "engine_models", "studies", "reports")
#: What each package may import of the others; the command line alone knows studies and reports, and the
#: reference engine's own files the reference solver.
ALLOWED = {
    "reference_solver": set(),
    "engine_models": set(),
    "studies": {"engine_models"},
    "studies/command_line.py": {"engine_models", "reports"},
    "reports": set(),
}
FILES = sorted(path.relative_to(ROOT).as_posix() for p in PACKAGES for path in (ROOT / p).glob("*.py"))


def imported(path: Path) -> set[str]:
    """Return the project's packages that a file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.add((node.module or "").split(".")[0])
    return names & set(PACKAGES)


@pytest.mark.parametrize("file", FILES)
def test_imports_follow_the_arrows(file: str) -> None:
    package = file.split("/")[0]
    allowed = ALLOWED.get(file, ALLOWED[package]) | {package}
    if file.startswith("engine_models/reference_"):
        allowed |= {"reference_solver"}
    assert imported(ROOT / file) <= allowed, f"{file} imports {imported(ROOT / file) - allowed}"

"""The house: which folders may import which, one way only, and no folder too full to be seen at a glance."""

import ast
from collections import Counter
from collections.abc import Callable, Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("reference_solver", "engine_models", "studies", "reports", "crankslider")

#: What a file may import of the other packages: the longest entry that its path begins with decides.
ALLOWED = {
    "reference_solver": set(),
    "engine_models": {"reference_solver"},  # its formulas of laws and drives, its equations, its runs
    "engine_models/engine.py": set(),
    "engine_models/scene": {"reference_solver"},  # a mechanism's data, curves of tables, and assembled starts
    "studies": {"engine_models"},
    "studies/judges/run_cache.py": {"engine_models", "reference_solver"},  # files kept beside machine code
    "studies/judges/closing.py": {"engine_models", "reference_solver"},  # a mechanism without its clearances
    "studies/conform.py": {"engine_models", "reports"},  # the rule by which an order is one
    "reports": {"engine_models", "studies"},  # words of refusals, names of configurations, rows
    "crankslider": {"engine_models", "reference_solver", "reports", "studies"},
}
#: What the independent solver may import of all packages: the physics as data, and the form of answers.
#: Machine code is compiled and kept where all is, which decides no number.
OF_MINIMAL = (
    "engine_models.scene.",
    "engine_models.engine.",
    "engine_models.mechanics.impacts.",
    "engine_models.mechanics.states.",
    "engine_models.mechanics.trajectory.",
    "engine_models.minimal.",
    "engine_models.watch.",
    "reference_solver.machine_code.compiled.",
    "reference_solver.mechanism.data.",
)
FILES = sorted(path.relative_to(ROOT).as_posix() for p in PACKAGES for path in (ROOT / p).rglob("*.py"))
MOST_ENTRIES = 24
ENGINE_ROOMS = tuple(f"engine_models/{room}/" for room in ("reference", "exudyn", "pymunk"))


def imported(file: str) -> Iterator[str]:
    """Yield the dotted names of our packages that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse((ROOT / file).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] in PACKAGES)


def file_of(name: str) -> str:
    """Return the file of a dotted name: of a module, or of what stands in one."""
    path = name.replace(".", "/")
    room = path.rpartition("/")[0]
    return next(
        file
        for file in (f"{path}.py", f"{path}/__init__.py", f"{room}.py", f"{room}/__init__.py")
        if (ROOT / file).exists()
    )


def room_of(file: str) -> str:
    """Return the sub-package of a file; one at the top of its package is by itself."""
    folder = file.rpartition("/")[0]
    return folder if "/" in folder else file


def test_no_engine_imports_another_engines_room() -> None:
    for file in (file for file in FILES if file.startswith(ENGINE_ROOMS)):
        own = next(room for room in ENGINE_ROOMS if file.startswith(room))
        others = {room for name in imported(file) for room in ENGINE_ROOMS if file_of(name).startswith(room)}
        assert others <= {own}, file


def test_imports_follow_the_arrows() -> None:
    for file in FILES:
        package = file.split("/")[0]
        allowed = ALLOWED[max((place for place in ALLOWED if file.startswith(place)), key=len)] | {package}
        other = {name for name in imported(file) if name.split(".")[0] not in allowed}
        assert not other, f"{file} imports {other}"


def test_the_independent_solver_shares_nothing_with_what_it_judges() -> None:
    for file in (file for file in FILES if file.startswith("engine_models/minimal/")):
        other = {name for name in imported(file) if not f"{name}.".startswith(OF_MINIMAL)}
        assert not other, f"{file} imports {other}"


@pytest.mark.parametrize("place_of", [str, room_of], ids=["files", "rooms"])
def test_imports_go_one_way(place_of: Callable[[str], str]) -> None:
    places: dict[str, set[str]] = {}
    for file in FILES:
        targets = {place_of(file_of(name)) for name in imported(file)}
        places.setdefault(place_of(file), set()).update(targets - {place_of(file)})
    assert len(places) > len(PACKAGES)
    TopologicalSorter(places).prepare()  # raises CycleError with the places of a cycle


def test_no_room_is_crowded() -> None:
    places = {path.relative_to(ROOT) for p in (*PACKAGES, "tests") for path in (ROOT / p).rglob("*")}
    of_people = {place for place in places if not {"__pycache__", "published"} & set(place.parts[:-1])}
    entries = Counter(place.parent.as_posix() for place in of_people if place.name != "__pycache__")
    crowded = {folder: count for folder, count in entries.items() if count > MOST_ENTRIES}
    assert not crowded, crowded

"""What a module is made of: its file and all that it imports, found without importing any of it.

An import counts wherever it stands in a file, and so does ``import_module`` of a literal. Files count by
their meaning: comments, layout and docstrings have none. Distributions count by their version. A module from
outside the project counts by its files too, and so does what belongs to no distribution, or to one that is
installed as its developer does it.
"""

import ast
import gc
import hashlib
import json
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.metadata import distribution
from importlib.util import find_spec
from itertools import accumulate
from pathlib import Path
from pkgutil import get_importer

if sys.version_info >= (3, 11):
    from importlib.metadata import packages_distributions as packages_distributions
else:  # Python 3.10 does not find the modules of distributions that do not list them
    from importlib_metadata import packages_distributions as packages_distributions

ROOT = Path(__file__).parents[2]
#: The folders whose code decides numbers; the reports only show them.
NUMERICAL_CODE = ("reference_solver", "engine_models", "studies")
#: Modules that decide no number, and why: what only they import does not count either.
NOT_COUNTED = {
    "engine_models.engines": "a registry: an engine's own module counts for the engine's cases",
    "engine_models.arms": "says which cases there are: engine, label and settings are in their keys",
    "studies.ladders": "says which cases there are: engine, arm, step and settings are in their keys",
    "studies.running.failures": "says how a command fails, which no row does",
    "studies.running.registry": "a registry: a study's own module counts for the study's cases",
    "studies.running.provenance": "only says what made a row",
    "studies.running.closure": "only says what made a row",
}
#: Parts of a syntax tree that have no meaning at run time, or that not every version of Python tells.
UNSTEADY = ("kind", "type_comment", "type_ignores", "type_params")

#: Gives the names of distributions by the modules that they install at the top level.
_owners = cache(packages_distributions)


@dataclass(frozen=True)
class Closure:
    """The files that a module is made of, by their modules' names, and the distributions that they import."""

    files: dict[str, Path]
    distributions: frozenset[str]

    def __or__(self, other: "Closure") -> "Closure":
        return Closure({**self.files, **other.files}, self.distributions | other.distributions)


@cache
def _content(path: Path) -> bytes:
    """Return a file as it was when this process first read it."""
    return path.read_bytes()


# Files of the project are read before it imports more of them.
for _folder in NUMERICAL_CODE:
    for _path in (ROOT / _folder).rglob("*.py"):
        with suppress(FileNotFoundError):  # an editor replaces it
            _content(_path)


@cache
def closure(module: str) -> Closure:
    """Return what a module, by its import path, is made of.

    Raises:
        SyntaxError: a file is no Python.
    """
    own = _top(module)
    files: dict[str, Path] = {}
    imported: set[str] = set()
    seen: set[str] = set()
    waiting = list(_with_packages(module))
    while waiting:
        name = waiting.pop()
        top = _top(name)
        if name in seen or not NOT_COUNTED.keys().isdisjoint(_with_packages(name)):
            continue
        if top in sys.stdlib_module_names and top != own:
            continue
        seen.add(name)
        owners = () if top in NUMERICAL_CODE else _owners().get(top, ())
        imported.update(owners)
        if (not owners or top == own or any(map(_editable, owners))) and (path := _file_of(name)):
            files[name] = path
            waiting += (part for target in _imports(name, path) for part in _with_packages(target))
    return Closure(dict(sorted(files.items())), frozenset(imported))


def meaning(path: Path) -> str:
    """Return a hash of what a file meant when this process first read it, whatever Python's version.

    Raises:
        SyntaxError: it is no Python.
    """
    return _meaning(path, _content(path))


def changed(path: Path) -> bool:
    """Return whether a file by now means something else than when this process first read it."""
    before = _content(path)
    try:
        now = path.read_bytes()
        return now != before and _meaning(path, now) != _meaning(path, before)
    except (OSError, SyntaxError, ValueError):  # gone, or half written
        return True


def _tree(content: bytes) -> ast.Module:
    """Return a file's syntax tree, made with no look of the collector at it: that takes twice as long."""
    collected = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(content)
    finally:
        if collected:
            gc.enable()


@cache
def _meaning(path: Path, content: bytes) -> str:
    text = _canonical(_tree(content)).encode() if path.suffix == ".py" else content
    return hashlib.sha256(text).hexdigest()


def _canonical(part: object) -> str:
    """Return a syntax tree as text, without docstrings, and without what versions of Python tell or not."""
    if isinstance(part, list):
        return f"[{','.join(filter(None, map(_canonical, part)))}]"
    if not isinstance(part, ast.AST):
        return ascii(part)  # which characters repr escapes depends on Python's tables
    match part:
        case ast.Expr(value=ast.Constant(value=str())):  # a docstring
            return ""
        case ast.JoinedStr(values=values):  # Python 3.12 ends some with an empty text
            part = ast.JoinedStr([value for value in values if getattr(value, "value", None) != ""])
    shown = []
    for name in part._fields:
        value = getattr(part, name, None)
        if value is not None and value != [] and name not in UNSTEADY:
            shown.append(f"{name}={_canonical(value)}")
    return f"{type(part).__name__}({','.join(shown)})"


@cache
def _imports(name: str, path: Path) -> tuple[str, ...]:
    """Return what a module imports: modules, and names that stand in one or are one."""
    return tuple(_imported(name, path))


def _imported(name: str, path: Path) -> Iterator[str]:
    if path.suffix != ".py":
        return
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(_tree(_content(path))):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=module, names=names, level=level):
                above = package[: len(package) + 1 - level] if level else []
                start = [*above, *([module] if module else [])]
                yield from (".".join([*start, alias.name]) for alias in names)
            case ast.Call(
                func=ast.Name(id="import_module" | "__import__") | ast.Attribute(attr="import_module"),
                args=[ast.Constant(value=str(called)), *_],
            ) if not called.startswith("."):
                yield called


def _file_of(name: str) -> Path | None:
    """Return the file of a module, or None if a name is no module's."""
    top, *below = _with_packages(name)
    spec = _spec(top)
    for part in below:  # by the finders of files: ``find_spec`` would import packages, or look for them
        finders = filter(None, map(get_importer, (spec and spec.submodule_search_locations) or ()))
        spec = next(filter(None, (finder.find_spec(part) for finder in finders)), None)
    return Path(spec.origin) if spec and spec.has_location and spec.origin else None


@cache
def _spec(top: str) -> ModuleSpec | None:
    """Find a module at the top level; below it, finding would import."""
    try:
        return find_spec(top)
    except ValueError:  # it is there, and nobody knows where from
        return None


@cache
def _editable(distribution_name: str) -> bool:
    """Return whether a distribution's files may change under its version: ``pip install -e`` says so."""
    origin = json.loads(distribution(distribution_name).read_text("direct_url.json") or "{}")
    return bool(origin.get("dir_info", {}).get("editable"))


def _with_packages(name: str) -> Iterator[str]:
    """Yield a dotted name and the packages that it is in."""
    return accumulate(name.split("."), "{}.{}".format)


def _top(name: str) -> str:
    return name.partition(".")[0]

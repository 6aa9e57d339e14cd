"""What a fingerprint covers: edits of a copy of the code change those that they decide, and no others."""

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Collection
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from engine_models.engines import ENGINES, engine_module
from studies.running.closure import NOT_COUNTED, NUMERICAL_CODE, ROOT, closure
from studies.running.provenance import ROW_MAKERS
from studies.running.registry import STUDIES, study_module
from tests.helpers.running import add_line, copied

#: Prints all fingerprints by study and engine, and each study's digest; nothing of an engine is imported.
CODE = """
import json, sys
from engine_models import engines
from studies.running.provenance import code_digest, fingerprint
from studies.running.registry import STUDIES
hashes = {f"{study} {engine}": fingerprint(study, engine) for study in STUDIES for engine in engines.ENGINES}
hashes |= {study: code_digest(study, engines.ENGINES) for study in STUDIES}
assert not {"exudyn", "pymunk", "numba", "newcomer"} & set(sys.modules)
print(json.dumps(hashes))
"""
#: Prints the files of an engine from outside.
FILES_OF_NEWCOMER = """
import json
from studies.running.closure import closure
print(json.dumps([*map(str, closure("newcomer.engine").files.values())]))
"""
#: Studies that compare with the converged solution, which is the reference's.
BY_THE_REFERENCE = ("agreement", "clearance", "work-precision", "stability", "extremes", "motions")

#: Files that decide no number.
OF_NOTHING = (
    "studies/running/finished_cases.py",
    "studies/ladders.py",
    "studies/running/failures.py",
    "studies/command/main.py",
    "engine_models/arms.py",
)


def fingerprints(folder: Path, *also: Path) -> dict[str, str]:
    """Return what the code in a folder has, with other folders on Python's path."""
    hashes: dict[str, str] = printed(CODE, folder, *also)
    return hashes


def printed(code: str, folder: Path, *also: Path) -> Any:
    """Return the JSON that code prints in a new process, in a folder and with others on Python's path."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, also))}
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


def changed(before: dict[str, str], after: dict[str, str]) -> set[str]:
    assert before.keys() == after.keys()
    return {name for name in before if before[name] != after[name]}


@pytest.fixture(scope="module")
def untouched(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return fingerprints(copied(tmp_path_factory.mktemp("untouched")))


@pytest.fixture
def code(tmp_path: Path) -> Path:
    return copied(tmp_path)


def is_part(file: str, study: str, engine: str) -> bool:
    """Return whether a file is one of those that a study with an engine is made of."""
    roots = (study_module(study), engine_module(engine), *ROW_MAKERS)
    return any(ROOT / file in closure(root).files.values() for root in roots)


@pytest.mark.parametrize(
    ("file", "studies", "engines"),
    [
        ("engine_models/scene/scene.py", STUDIES, ENGINES),
        ("studies/running/worker.py", STUDIES, ENGINES),
        ("engine_models/exudyn/kinematic_tree.py", (), ("exudyn",)),
        ("engine_models/pymunk/engine.py", (), ("pymunk",)),
        ("studies/judges/horizon.py", (*BY_THE_REFERENCE, "predictability"), ()),
        ("studies/stability.py", ("stability",), ()),
        *((file, (), ()) for file in OF_NOTHING),
    ],
)
def test_a_file_is_part_of_what_it_decides_and_of_nothing_else(
    file: str, studies: Collection[str], engines: Collection[str]
) -> None:
    for study, engine in product(STUDIES, ENGINES):
        assert is_part(file, study, engine) == (study in studies or engine in engines), (study, engine)


@pytest.mark.parametrize("study", STUDIES)
def test_the_reference_solver_is_part_of_its_own_runs_and_of_what_is_compared_with_them(study: str) -> None:
    assert is_part("reference_solver/methods.py", study, "reference")
    assert is_part("reference_solver/methods.py", study, "exudyn") or study not in BY_THE_REFERENCE


@pytest.mark.system
def test_edits_count_for_those_that_a_file_is_part_of_and_what_people_read_for_nobody(
    code: Path, untouched: dict[str, str]
) -> None:
    for package in NUMERICAL_CODE:
        for file in (code / package).rglob("*.py"):
            text = file.read_text(encoding="utf-8").replace('"""', '"""Edited.\n\n', 1)
            file.write_text(f"# A comment.\n{text}\n\n\n# Another.\n", encoding="utf-8")
    for name in OF_NOTHING:
        add_line(code / name, "AND_MORE = 1")
    assert changed(untouched, fingerprints(code)) == set()
    tree, judge = "engine_models/exudyn/kinematic_tree.py", "studies/judges/converged_truth.py"
    text = (code / judge).read_text(encoding="utf-8")
    assert "POINTWISE_M = 1e-8" in text
    (code / judge).write_text(text.replace("POINTWISE_M = 1e-8", "POINTWISE_M = 2e-8"), encoding="utf-8")
    add_line(code / tree, "AND_MORE = 1")
    pairs = [pair for pair in product(STUDIES, ENGINES) if is_part(tree, *pair) or is_part(judge, *pair)]
    expected = {f"{study} {engine}" for study, engine in pairs} | {study for study, _ in pairs}
    assert "energy pymunk" not in expected
    assert changed(untouched, fingerprints(code)) == expected


METADATA = "Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"


def write(folder: Path, *names: str, text: str = "STEP = R = K = 1\n") -> None:
    """Write files that have the same text."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@pytest.mark.system
def test_an_engine_from_outside_counts_by_content_and_version_and_for_no_other(
    code: Path, tmp_path_factory: pytest.TempPathFactory, untouched: dict[str, str]
) -> None:
    outside = tmp_path_factory.mktemp("outside")
    imports = ("from helping import STEP", "from .rule import R", "from newcomer.laws.hertz import K")
    write(outside, *(f"newcomer/{name}.py" for name in ("__init__", "laws/hertz", "rule")))
    write(outside, "helping.py", "library.py")
    write(outside, "newcomer/engine.py", text="\n".join((*imports, "import library\n")))
    files = [*outside.rglob("*.py")]
    # A library that is installed as its developer does it.
    editable = '{"url": "file:///library", "dir_info": {"editable": true}}'
    write(outside, "library-1.0.dist-info/direct_url.json", text=editable)
    for name in ("library", "newcomer"):
        write(outside, f"{name}-1.0.dist-info/METADATA", text=METADATA.format(name=name, version="1.0"))
        write(outside, f"{name}-1.0.dist-info/top_level.txt", text=f"{name}\n")
    add_line(code / "engine_models/engines.py", '_CLASSES["newcomer"] = ("newcomer.engine", "Newcomer")')
    add_line(code / "engine_models/engines.py", "ENGINES = tuple(_CLASSES)")

    def of_newcomer() -> str:
        hashes = fingerprints(code, outside)
        others = untouched.keys() - set(STUDIES)
        assert {name: hashes[name] for name in others} == {name: untouched[name] for name in others}
        return hashes["clearance newcomer"]

    seen = [of_newcomer()]
    write(outside, "newcomer-1.0.dist-info/METADATA", text=METADATA.format(name="newcomer", version="1.1"))
    seen.append(of_newcomer())
    for file in files:
        add_line(file, "# A comment.")
    assert of_newcomer() == seen[-1]
    add_line(outside / "newcomer/laws/hertz.py", "AND_MORE = 1")
    assert len({*seen, of_newcomer()}) == 3
    assert {Path(path) for path in printed(FILES_OF_NEWCOMER, code, outside)} >= {*files}


def test_nobody_names_an_engine_or_a_module_where_it_would_not_count() -> None:
    """What is called by name counts only if the name is a literal that is imported, or a registry's."""
    for package in NUMERICAL_CODE:
        for file in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if not (isinstance(node, ast.Call) and node.args):
                    continue
                called = getattr(node.func, "id", getattr(node.func, "attr", ""))
                literal = isinstance(node.args[0], ast.Constant)
                if called in ("make_engine", "engine_class"):
                    assert not literal, f"{file}:{node.lineno}"
                elif called in ("import_module", "__import__", "exec", "spec_from_file_location"):
                    by_name = ("engines.py", "outcome.py", "store.py")
                    assert literal or file.name in by_name, f"{file}:{node.lineno}"


def test_a_file_that_is_read_and_not_imported_would_not_count() -> None:
    files = [path for folder in NUMERICAL_CODE for path in (ROOT / folder).rglob("*") if path.is_file()]
    # Not what rows are held to, nor scenes and the gallery, which are in the rows.
    other = {"baselines.csv", "library", "gallery.toml"}
    assert {path.suffix for path in files if not other & {*path.parts}} <= {".py", ".pyc"}
    for module in NOT_COUNTED:
        assert (ROOT / f"{module.replace('.', '/')}.py").is_file()
        assert not closure("studies.clearance").files.keys() & {module}


#: Prints a hash of the meaning of all files of numerical code; needs nothing but Python.
DIGEST = """
import hashlib, pathlib, sys
sys.path.insert(0, sys.argv[1])
from studies.running.closure import NUMERICAL_CODE, ROOT, meaning
files = sorted(path for folder in NUMERICAL_CODE for path in (ROOT / folder).rglob("*.py"))
print(hashlib.sha256("".join(map(meaning, [*files, pathlib.Path(sys.argv[2])])).encode()).hexdigest())
"""
#: What versions of Python parse to different trees.
SYNTAX = r"""
X: list[int]
def f(a, /, b=None, *, c=()): return f"{a=}" f"{b!r:>{c}}" "text" f"{c:}" u"é\u200b" + f"" "", 1e400, b"\xff"
"""


def test_meaning_does_not_depend_on_the_version_of_python(tmp_path: Path) -> None:
    (tmp_path / "syntax.py").write_text(SYNTAX, encoding="utf-8")
    names = ["python3", *(f"python3.{minor}" for minor in range(10, 20))]
    digests = {}
    for python in {sys.executable, *filter(None, map(shutil.which, names))}:
        tell = "import sys; assert sys.version_info >= (3, 10); print(sys.version_info[:3])"
        version = subprocess.run([python, "-c", tell], capture_output=True, text=True, check=False)
        if version.returncode == 0:  # others are too old, or names of what is not installed
            command = [python, "-I", "-c", DIGEST, str(ROOT), str(tmp_path / "syntax.py")]
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            digests[version.stdout] = done.stdout
    assert len(set(digests.values())) == 1, digests

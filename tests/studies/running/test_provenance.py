"""What a fingerprint covers: edits of a copy of the code change those that they decide, and no others."""

import ast
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
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


def of_the_reference(study: str, engine: str) -> bool | None:
    """Return whether the reference decides, by its runs or its converged solutions; None says neither."""
    if engine == "reference" or study in BY_THE_REFERENCE:
        return True
    return None if engine in ("scipy", "pymunk") else study == "predictability"


def of_what_is_compiled(study: str, engine: str) -> bool | None:
    """Return whether what keeps machine code decides: it keeps Pymunk's loop too."""
    return engine == "pymunk" or of_the_reference(study, engine)


def is_part(file: str, study: str, engine: str) -> bool:
    """Return whether a file is one of those that a study with an engine is made of."""
    roots = (study_module(study), engine_module(engine), *ROW_MAKERS)
    return any(ROOT / file in closure(root).files.values() for root in roots)


@pytest.mark.parametrize(
    ("file", "decides"),
    [
        ("engine_models/scene/scene.py", lambda _study, _engine: True),
        ("engine_models/exudyn/kinematic_tree.py", lambda _, engine: engine == "exudyn"),
        ("engine_models/pymunk/engine.py", lambda _, engine: engine == "pymunk"),
        ("reference_solver/compiled/__init__.py", of_what_is_compiled),
        ("reference_solver/methods.py", of_the_reference),
        ("studies/judges/horizon.py", lambda study, _: study in (*BY_THE_REFERENCE, "predictability")),
        ("studies/stability.py", lambda study, _: study == "stability"),
        ("studies/predictability.py", lambda study, _: study == "predictability"),
        ("studies/running/worker.py", lambda _study, _engine: True),
        *((file, lambda _study, _engine: False) for file in OF_NOTHING),
    ],
)
def test_a_file_is_part_of_what_it_decides_and_of_nothing_else(
    file: str, decides: Callable[[str, str], bool | None]
) -> None:
    for study, engine in product(STUDIES, ENGINES):
        assert decides(study, engine) in (None, is_part(file, study, engine)), (study, engine)


@pytest.mark.parametrize("file", ["engine_models/exudyn/kinematic_tree.py", "studies/running/worker.py"])
def test_an_edit_counts_for_those_that_a_file_is_part_of_and_no_others(
    code: Path, untouched: dict[str, str], file: str
) -> None:
    add_line(code / file, "AND_MORE = 1")
    pairs = [(study, engine) for study, engine in product(STUDIES, ENGINES) if is_part(file, study, engine)]
    expected = {f"{study} {engine}" for study, engine in pairs} | {study for study, _ in pairs}
    assert changed(untouched, fingerprints(code)) == expected


def test_an_edit_of_what_is_no_part_of_anything_counts_for_nobody(
    code: Path, untouched: dict[str, str]
) -> None:
    for file in OF_NOTHING:
        add_line(code / file, "AND_MORE = 1")
    assert changed(untouched, fingerprints(code)) == set()


def test_comments_docstrings_and_help_count_for_nobody(code: Path, untouched: dict[str, str]) -> None:
    for package in NUMERICAL_CODE:
        for file in (code / package).rglob("*.py"):
            text = file.read_text(encoding="utf-8").replace('"""', '"""Edited.\n\n', 1)
            file.write_text(f"# A comment.\n{text}\n\n\n# Another.\n", encoding="utf-8")
    main = code / "studies/command/main.py"
    main.write_text(main.read_text(encoding="utf-8").replace('help="', 'help="Edited. '), encoding="utf-8")
    assert changed(untouched, fingerprints(code)) == set()


def test_a_constant_of_a_judge_counts(code: Path, untouched: dict[str, str]) -> None:
    judge = code / "studies/judges/converged_truth.py"
    text = judge.read_text(encoding="utf-8")
    judge.write_text(text.replace("POINTWISE_M = 1e-8", "POINTWISE_M = 2e-8"), encoding="utf-8")
    assert text != judge.read_text(encoding="utf-8")
    names = changed(untouched, fingerprints(code))
    assert {f"{study} {engine}" for study in BY_THE_REFERENCE for engine in ENGINES} < names
    assert "energy pymunk" not in names


@pytest.mark.system
def test_an_engine_from_outside_counts_by_content_and_version_and_for_no_other(
    code: Path, tmp_path_factory: pytest.TempPathFactory, untouched: dict[str, str]
) -> None:
    outside = tmp_path_factory.mktemp("outside")
    engine, metadata = outside / "newcomer", outside / "newcomer-1.0.dist-info"
    engine.mkdir()
    (engine / "__init__.py").write_text("")
    imports = (
        "from helping import STEP",
        "from .rule import RULE",
        "from newcomer.laws.hertz import K",
        "import library",
    )
    (engine / "engine.py").write_text("\n".join(imports))
    (engine / "laws").mkdir()  # without __init__.py
    (engine / "laws/hertz.py").write_text("K = 1\n")
    library = outside / "library-1.0.dist-info"  # installed as its developer does it
    library.mkdir()
    (library / "METADATA").write_text("Metadata-Version: 2.1\nName: library\nVersion: 1.0\n")
    (library / "top_level.txt").write_text("library\n")
    (library / "direct_url.json").write_text('{"url": "file:///library", "dir_info": {"editable": true}}')
    (outside / "library.py").write_text("L = 1\n")
    (engine / "rule.py").write_text("RULE = 1\n")
    (outside / "helping.py").write_text("STEP = 1\n")
    add_line(code / "engine_models/engines.py", '_CLASSES["newcomer"] = ("newcomer.engine", "Newcomer")')
    add_line(code / "engine_models/engines.py", "ENGINES = tuple(_CLASSES)")

    def of_newcomer() -> str:
        hashes = fingerprints(code, outside)
        own = {f"{study} newcomer" for study in STUDIES}
        assert {name: hashes[name] for name in hashes.keys() - own - set(STUDIES)} == {
            name: untouched[name] for name in untouched.keys() - set(STUDIES)
        }
        return hashes["clearance newcomer"]

    without_distribution = of_newcomer()
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: newcomer\nVersion: 1.0\n")
    (metadata / "top_level.txt").write_text("newcomer\n")
    seen = [without_distribution, of_newcomer()]
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: newcomer\nVersion: 1.1\n")
    seen.append(of_newcomer())
    own = ("rule.py", "__init__.py", "laws/hertz.py", "engine.py")
    files = [*(engine / name for name in own), outside / "helping.py", outside / "library.py"]
    for file in files:
        add_line(file, "# A comment.")
    assert of_newcomer() == seen[-1]
    add_line(engine / "laws/hertz.py", "AND_MORE = 1")
    seen.append(of_newcomer())
    assert len(set(seen)) == 4
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
    files = [path for path in files if not other & {*path.parts}]
    assert {path.suffix for path in files} <= {".py", ".pyc"}


@pytest.mark.parametrize("module", NOT_COUNTED)
def test_what_does_not_count_is_there(module: str) -> None:
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

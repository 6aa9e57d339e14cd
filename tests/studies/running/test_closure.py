"""What a run really imports is in the closure of its study and its engine, or decides no number."""

import json
import pickle
import subprocess
import sys

import pytest

from engine_models.engines import ENGINES, engine_module
from studies.running.case import Case
from studies.running.closure import NOT_COUNTED, NUMERICAL_CODE, closure, packages_distributions
from studies.running.outcome import load_study
from studies.running.provenance import ROW_MAKERS
from studies.running.registry import STUDIES, study_module

#: Runs a pickled case; prints its status and what each module of ours imported, by statements and by name.
RECORDED = """
import builtins, importlib, json, pickle, sys
from studies.running.closure import NUMERICAL_CODE
imports = {}
def note(importer, names):
    if importer.split(".")[0] in NUMERICAL_CODE:
        imports.setdefault(importer, set()).update(names)
def by_statement(name, globals=None, locals=None, fromlist=(), level=0, by=builtins.__import__):
    note((globals or {}).get("__name__") or "", [name, *(f"{name}.{part}" for part in fromlist or ())])
    return by(name, globals, locals, fromlist, level)
def by_name(name, package=None, by=importlib.import_module):
    note(sys._getframe(1).f_globals["__name__"], [name])
    return by(name, package)
builtins.__import__, importlib.import_module = by_statement, by_name
from studies.running.outcome import run_case
row, _ = run_case(pickle.load(sys.stdin.buffer))
modules = {name: sorted(names & sys.modules.keys()) for name, names in imports.items()}
print(json.dumps([row["status"], modules]))
"""


def imports_of_a_run(case: Case) -> tuple[str, dict[str, list[str]]]:
    """Run a case in a new process; return its status and what each module of ours imported there."""
    command = [sys.executable, "-c", RECORDED]
    done = subprocess.run(command, input=pickle.dumps(case), stdout=subprocess.PIPE, check=True)
    status, imports = json.loads(done.stdout)
    return status, imports


def shortest(study: str, engine: str) -> Case:
    cases = [case for case in load_study(study).cases(False) if case.engine == engine and not case.timed]
    return min(cases, key=lambda case: case.scene.end_time_s / case.run.step_s)


#: What runs cases beside ``ROW_MAKERS``, and why no row depends on it.
ONLY_RUNS = {
    "studies.running.runner": "says when a case runs and where, and hands its row on",
    "studies.running.cluster": "hands a case on to the processes of another machine",
    "studies.running.finished_cases": "keeps rows as they come",
    "studies.running.folder_lock": "keeps other runs away",
    "studies.running.whole_file": "writes files whole",
}


def test_what_runs_cases_and_does_not_count_is_named() -> None:
    runs = closure("studies.running.runner") | closure("studies.running.cluster")
    counted = {name for root in (*ROW_MAKERS, *STUDIES.values()) for name in closure(root).files}
    assert runs.files.keys() - counted == ONLY_RUNS.keys()


#: A study with all engines, and every other with one.
PAIRS = [("clearance", engine) for engine in ENGINES]
OF_ALL = [*ENGINES]
PAIRS += [(study, OF_ALL[n % len(OF_ALL)]) for n, study in enumerate(STUDIES) if study != "clearance"]


@pytest.mark.system
@pytest.mark.parametrize(("study", "engine"), PAIRS)
def test_what_a_run_imports_counts(study: str, engine: str) -> None:
    case = shortest(study, engine)
    status, imports = imports_of_a_run(case)
    assert status in ("ok", "failed")
    roots = (study_module(study), engine_module(engine), *ROW_MAKERS)
    parts = [closure(root) for root in roots]
    counted = {name for part in parts for name in part.files}
    distributions = {name for part in parts for name in part.distributions}
    owners = packages_distributions()
    waiting, reached = [*roots[:2], "studies.running.outcome"], set(NOT_COUNTED)
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        assert name in counted
        for target in imports.get(name, []):
            if (top := target.split(".")[0]) in NUMERICAL_CODE:
                waiting.append(target)
            elif top not in sys.stdlib_module_names:
                assert distributions & {*owners[top]}, f"{name} imports {target}"
    assert len(reached) > 30

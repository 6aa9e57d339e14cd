"""What a run really imports is in the closure of its study and its engine, or decides no number."""

import json
import pickle
import subprocess
import sys
from importlib.metadata import packages_distributions

import pytest

from engine_models.engines import ENGINES, engine_module
from studies.running.case import Case
from studies.running.closure import NOT_COUNTED, NUMERICAL_CODE, closure
from studies.running.outcome import load_study
from studies.running.provenance import ROW_MAKERS
from studies.running.registry import STUDIES, study_module

#: Runs a pickled case and prints its status and what each module imported, by either way of importing.
RECORDED = """
import builtins, importlib, json, pickle, sys
imports = {}
def recorded(importing):
    def record(name, *rest, **more):
        frame = sys._getframe(1)
        module = importing(name, *rest, **more)
        names = [name, *(f"{name}.{part}" for part in (rest[2:3] or [more.get("fromlist")])[0] or ())]
        imports.setdefault(frame.f_globals.get("__name__"), set()).update(names)
        return module
    return record
def named(name, package=None, import_module=importlib.import_module):
    imports.setdefault(sys._getframe(1).f_globals.get("__name__"), set()).add(name)
    return import_module(name, package)
builtins.__import__, importlib.import_module = recorded(builtins.__import__), named
from studies.running.outcome import run_case
row, _ = run_case(pickle.load(sys.stdin.buffer))
loaded = {name: sorted(names & sys.modules.keys()) for name, names in imports.items() if name}
print(json.dumps([row["status"], loaded]))
"""


def imports_of_a_run(case: Case) -> tuple[str, dict[str, list[str]]]:
    """Run a case in a new process; return its status and what each module imported there."""
    command = [sys.executable, "-c", RECORDED]
    done = subprocess.run(command, input=pickle.dumps(case), stdout=subprocess.PIPE, check=True)
    status, imports = json.loads(done.stdout)
    return status, imports


def shortest(study: str, engine: str) -> Case | None:
    cases = [case for case in load_study(study).cases(False) if case.engine == engine and not case.timed]
    return min(cases, key=lambda case: case.scene.end_time_s / case.run.step_s, default=None)


#: A study with all engines, and every other with one of them.
PAIRS = [("clearance", engine) for engine in ENGINES]
PAIRS += [(study, ENGINES[n % len(ENGINES)]) for n, study in enumerate(STUDIES) if study != "clearance"]


@pytest.mark.parametrize(("study", "engine"), PAIRS)
def test_what_a_run_imports_counts(study: str, engine: str) -> None:
    case = shortest(study, engine)
    if case is None:
        pytest.skip(f"{study} has no cases of {engine}")
    status, imports = imports_of_a_run(case)
    assert status in ("ok", "failed")
    roots = (study_module(study), engine_module(engine), *ROW_MAKERS)
    parts = [closure(root) for root in roots]
    counted = {name for part in parts for name in part.files}
    distributions = {name for part in parts for name in part.distributions}
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
                assert distributions & {*packages_distributions()[top]}, f"{name} imports {target}"
    assert len(reached) > 30

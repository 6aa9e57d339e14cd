"""After an edit of the code, exactly those cases run again that it decides."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from engine_models.engines import ENGINES
from tests.helpers.mischief import NAME
from tests.helpers.row_files import read_rows
from tests.helpers.running import add_line, copied

#: Runs a case of every engine that the study simulates, and one that only the study knows.
CODE = f"""
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from studies.running.runner import run_study
from engine_models.engines import ENGINES
from tests.helpers.mischief import case
cases = [case("simulate", engine=engine) for engine in ENGINES] + [case("work")]
run_study("{NAME}", cases, Path("results"), lambda: ThreadPoolExecutor(1))
"""
#: An engine from outside: SciPy's under another name.
OUTSIDE = """
from engine_models.scipy_ivp.engine import ScipyEngine
class Newcomer(ScipyEngine):
    pass
"""


def run(code: Path) -> dict[str, dict[str, Any]]:
    """Run what there is to run; return the rows by engine."""
    environment = {**os.environ, "PYTHONPATH": str(code / "outside")}
    subprocess.run([sys.executable, "-c", CODE], cwd=code, env=environment, check=True, capture_output=True)
    return {row["engine"]: row for row in read_rows(code / "results/rows.jsonl")}


def run_again(before: dict[str, dict[str, Any]], after: dict[str, dict[str, Any]]) -> set[str]:
    """Return the engines whose cases were run again: such a row says when it began."""
    return {engine for engine in after if after[engine] != before.get(engine)}


@pytest.mark.system
def test_an_edit_runs_again_what_it_decides_and_nothing_else(tmp_path: Path) -> None:
    code = copied(tmp_path)
    first = run(code)
    engines = {*ENGINES, "mischief"}
    assert {engine: row["status"] for engine, row in first.items()} == dict.fromkeys(engines, "ok")

    add_line(code / "engine_models/exudyn/kinematic_tree.py", "# A comment.")
    add_line(code / "studies/command/main.py", "AND_MORE = 1")
    add_line(code / "studies/ladders.py", "AND_MORE = 1")
    add_line(code / "studies/agreement.py", "AND_MORE = 1")
    add_line(code / "studies/running/finished_cases.py", "AND_MORE = 1")
    assert run_again(first, run(code)) == set()

    tree = code / "engine_models/exudyn/kinematic_tree.py"
    as_it_was = tree.read_text(encoding="utf-8")
    add_line(tree, "AND_MORE = 1")
    second = run(code)
    assert run_again(first, second) == {"exudyn"}
    (aside,) = code.glob("results/rows.*.jsonl")
    assert read_rows(aside) == [first["exudyn"]]

    (code / "outside").mkdir()
    (code / "outside/newcomer.py").write_text(OUTSIDE, encoding="utf-8")
    add_line(code / "engine_models/engines.py", '_CLASSES["newcomer"] = ("newcomer", "Newcomer")')
    add_line(code / "engine_models/engines.py", "ENGINES = tuple(_CLASSES)")
    third = run(code)
    assert run_again(second, third) == {"newcomer"}
    assert third["newcomer"]["farthest_m"] == third["scipy"]["farthest_m"]
    add_line(code / "outside/newcomer.py", "AND_MORE = 1")
    fourth = run(code)
    assert run_again(third, fourth) == {"newcomer"}

    tree.write_text(as_it_was, encoding="utf-8")
    fifth = run(code)
    assert run_again(fourth, fifth) == {"exudyn"}, "taken up again"
    assert fifth["exudyn"] == first["exudyn"]

    add_line(code / "tests/helpers/mischief.py", "AND_MORE = 1")
    assert run_again(fifth, run(code)) == {*engines, "newcomer"}

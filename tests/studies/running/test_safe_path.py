"""Files in the user's folder that are called as Python's modules: no process of ours takes one for those."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from studies.running.processes import SAFE_PATH, Processes, starting
from tests.helpers.row_files import read_rows

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.version_info < (3, 11), reason="Python 3.10 cannot keep the folder out"),
]

#: An engine in the user's folder, which is asked for, and Python's modules that this platform has.
ENGINE = "from engine_models.scipy_ivp.engine import ScipyEngine as Mine\n"
MODULES = [
    name
    for name in sorted(sys.stdlib_module_names)
    if name not in ("antigravity", "this") and find_spec(name)
]
SWEEP = (
    "sweep",
    "clearance-driven-0.5mm",
    "--vary",
    "clearance.B.radial_clearance_m=1e-5,1e-4",
    "--jobs",
    "2",
)


@pytest.fixture
def users(tmp_path: Path) -> Path:
    """A folder with a file for each module of Python's, which says that it was run, and an engine."""
    for name in MODULES:
        run = "import sys; open('executed', 'a').write(__name__); sys.exit(__name__)"
        (tmp_path / f"{name}.py").write_text(f"{run}\n")
    (tmp_path / "my_module.py").write_text(ENGINE)
    return tmp_path


def crankslider(folder: Path, *arguments: str) -> None:
    """Run the command as users do, in their folder."""
    command = [str(Path(sys.executable).with_name("crankslider")), *arguments]
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", SAFE_PATH)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, (folder / "executed").exists()) == (0, False), done.stderr


def test_processes_of_a_sweep_run_nothing_there(users: Path) -> None:
    crankslider(users, *SWEEP, "--revolutions", "0.1")


def test_of_a_study_they_run_the_engine_that_is_asked_for_and_nothing_else(users: Path) -> None:
    mine = ("--engine", "my_module:Mine")
    crankslider(users, "run", "agreement", *mine, "--jobs", "2", "--out", "results")
    rows = read_rows(users / "results" / "agreement" / "rows.jsonl")
    assert {(row["engine"], row["status"]) for row in rows} == {("my_module:Mine", "ok")}
    crankslider(users, "run", "agreement", "--engine", "scipy", "--out", "results")
    crankslider(users, "report")


@pytest.mark.parametrize("before", [None, "", "1"])
def test_what_the_user_has_set_is_as_it_was_when_processes_have_begun(
    before: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    if before is None:
        monkeypatch.delenv(SAFE_PATH, raising=False)
    else:
        monkeypatch.setenv(SAFE_PATH, before)
    with Processes(1) as pool:
        assert pool.submit(os.getpid).result() != os.getpid()
    with starting():
        assert os.environ[SAFE_PATH] == "1"
    assert os.environ.get(SAFE_PATH) == before

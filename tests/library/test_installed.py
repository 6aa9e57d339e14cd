"""What a user meets after ``pip install``, in a folder of their own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
SOURCES = ("crankslider", "reference_solver", "engine_models", "studies", "reports")
RUN = """
import crankslider as cs
run = cs.simulate('ideal-free', end=0.01, samples=4)
run.write(animate='film.html')
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the installed wheel in it, built of copies."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("site")
    for name in (*SOURCES, "pyproject.toml", "README.md", "LICENSE"):
        if (ROOT / name).is_dir():
            ignored = shutil.ignore_patterns("published", "__pycache__")
            shutil.copytree(ROOT / name, source / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, source)
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, "--target", target, source], check=True)
    return target


def python(site: Path, folder: Path, code: str) -> "subprocess.CompletedProcess[str]":
    """Return what Python says in a folder where our packages are installed."""
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_installed_library_and_command_run_in_a_folder_of_the_users(site: Path, tmp_path: Path) -> None:
    same = "print(cs.__file__, len(run.frame), cs.Scene is type(cs.scenes['ideal-free']))"
    done = python(site, tmp_path, f"{RUN}\n{same}")
    assert (done.stderr, done.stdout.split()) == ("", [str(site / "crankslider/__init__.py"), "5", "True"])
    assert (site / "crankslider/py.typed").exists()
    script = str(site / "bin" / "crankslider")
    command = [sys.executable, script, "simulate", "ideal-free", "--end", "0.01"]
    environment = {**os.environ, "PYTHONPATH": str(site)}
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert len(run.stdout.splitlines()) == 202


def test_a_package_of_the_users_in_the_place_of_ours_is_said_in_one_line(site: Path, tmp_path: Path) -> None:
    (tmp_path / "reference_solver.py").write_text("mine = 'mine'\n")
    done = python(site, tmp_path, RUN)
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ImportError: reference_solver: expected crankslider's own, got ")

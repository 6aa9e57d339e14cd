"""What a user meets after ``pip install``, in a folder of their own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
SOURCES = ("crankslider.py", "reference_solver", "engine_models", "studies", "reports")
RUN = """
import crankslider as cs
run = cs.simulate('ideal-free', end=0.01, samples=4)
run.animate('film.html')
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


@pytest.fixture
def users(tmp_path: Path) -> Path:
    """Return a folder with packages of the user's that are called as ours."""
    for name in ("studies", "reports"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("mine = 'mine'\n")
        (tmp_path / name / "own.py").write_text("mine = 'mine'\n")
    (tmp_path / "studies" / "ladders.py").write_text("mine = 'mine'\n")
    return tmp_path


def test_the_library_is_the_installed_one_and_the_packages_below_may_come_first(
    site: Path, tmp_path: Path
) -> None:
    first = "from engine_models.scene.library import SCENES"
    same = "print(cs.__file__, studies.__file__, len(run.frame), type(SCENES['ideal-free']()) is cs.Scene)"
    done = python(site, tmp_path, f"{first}\n{RUN}\nimport studies; {same}")
    files = [str(site / "crankslider.py"), str(site / "studies" / "__init__.py")]
    assert (done.stderr, done.stdout.split()) == ("", [*files, "5", "True"])


def test_folders_of_the_user_may_have_the_names_of_ours(site: Path, users: Path) -> None:
    done = python(site, users, RUN + "from studies.own import mine; from reports import own; print(mine)")
    assert (done.stdout, done.stderr) == ("mine\n", "")


def test_the_users_packages_may_come_first(site: Path, users: Path) -> None:
    done = python(site, users, f"import studies, reports.own\n{RUN}\nprint(studies.mine, reports.own.mine)")
    assert (done.stdout, done.stderr) == ("mine mine\n", "")


def test_a_module_of_the_users_in_the_place_of_ours_is_said(site: Path, users: Path) -> None:
    done = python(site, users, f"import studies.ladders\n{RUN}")
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ImportError: studies.ladders: expected crankslider's own, got ")
    assert last.endswith("ladders.py: import crankslider before it")


def test_the_command_runs_in_a_folder_like_that(site: Path, users: Path) -> None:
    command = [sys.executable, str(site / "bin" / "crankslider"), "simulate", "ideal-free", "--end", "0.01"]
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(command, cwd=users, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 202

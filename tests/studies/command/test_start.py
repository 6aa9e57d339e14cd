"""What a command loads before it begins: what it does not need would be most of a short run's time."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.command import crankslider

CALL = "import sys; from studies.command.main import main\ntry: main()\nfinally: print(*sys.modules)"
SIMULATE = ("simulate", "ideal-free", "--end", 0.01, "--out")
#: Parts of SciPy, which take as long to load as all else that a run by DOP853 needs.
SLOW = {"scipy.integrate", "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.stats"}


def modules(*arguments: object) -> set[str]:
    """Return what a process has loaded that was given a command."""
    command = [sys.executable, "-c", CALL, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("run", "--help")])
def test_help_comes_without_numbers(arguments: tuple[str, ...]) -> None:
    assert not modules(*arguments) & {"numpy", "numba", "matplotlib"}


def test_a_kernel_that_is_kept_is_loaded_without_what_a_compiler_knows(tmp_path: Path) -> None:
    assert crankslider(*SIMULATE, tmp_path / "first.csv").code == 0  # now there is one
    loaded = modules(*SIMULATE, tmp_path / "second.csv")
    assert "numba" in loaded
    assert loaded & {"numba.np.arraymath", "scipy.linalg", "pandas", "matplotlib", "rich.progress"} == set()


def test_a_run_by_dop853_loads_nothing_of_scipy_but_a_table(tmp_path: Path) -> None:
    assert modules(*SIMULATE, tmp_path / "run.csv", "--set", "method=dop853") & SLOW == set()


def test_what_runs_members_loads_nothing_of_scipy_but_a_table() -> None:
    call = "import sys, studies.sweeps.measure; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", call], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) & SLOW == set()

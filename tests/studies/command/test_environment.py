"""A command does its work, or says why not in one line, whatever environment it is started in."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from engine_models.scene.library import ideal_free
from tests.helpers.command import crankslider

COMMAND = Path(sys.executable).with_name("crankslider")
IDEAL = "simulate ideal-free --end 0.0005 --samples 2"
LOOSE = "simulate clearance-free-0.5mm --end 0.0005 --samples 2"
SWEEP = "sweep clearance-driven-0.5mm --vary crank.mass_kg=0.1,0.2 --revolutions 0.01"


def in_shell(words: str, folder: Path, **variables: str) -> tuple[int, str, str]:
    """Run ``crankslider`` in a shell with more in its environment; return exit code, stdout and stderr."""
    environment = {**os.environ, **variables}
    environment.pop("PYTHONUNBUFFERED", None)  # with which streams hold nothing back
    line = f"exec '{COMMAND}' {words}"
    done = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, check=False)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


@pytest.mark.parametrize("engine", ["reference", "scipy", "pymunk"])
@pytest.mark.parametrize(
    "variables",
    [
        {"NUMBA_DISABLE_JIT": "1"},
        {"NUMBA_NUM_THREADS": "0", "NUMBA_OPT": "nonsense", "NUMBA_DUMP_LLVM": "1"},
        {"PYTHONWARNINGS": "error", "PYTHONOPTIMIZE": "2"},
    ],
    ids="-".join,
)
def test_no_variable_changes_a_run(engine: str, variables: dict[str, str], tmp_path: Path) -> None:
    words = f"{LOOSE} --engine {engine}"
    expected = crankslider(*words.split())
    assert in_shell(words, tmp_path, **variables) == (0, expected.stdout, expected.stderr)


@pytest.mark.parametrize("command", ["truth ideal-free --end 0.0005 --samples 2", "engines", "--help"])
def test_no_variable_changes_what_another_command_says(command: str, tmp_path: Path) -> None:
    usual = {"COLUMNS": "80", "TERM": "xterm"}
    odd = {"COLUMNS": "0", "NUMBA_DISABLE_JIT": "1", "NUMBA_NUM_THREADS": "x", "PYTHONWARNINGS": "error"}
    assert in_shell(command, tmp_path, **odd) == in_shell(command, tmp_path, **usual)


def test_workers_do_not_inherit_what_their_command_ignores(tmp_path: Path) -> None:
    odd = {"NUMBA_DISABLE_JIT": "1", "NUMBA_NUM_THREADS": "0", "PYTHONWARNINGS": "error"}
    code, stdout, stderr = in_shell(SWEEP, tmp_path, **odd)
    assert (code, stdout) == (0, ""), stderr
    assert stderr.endswith("note: 2 rows are in sweep.parquet\n")


def test_a_picture_needs_no_backend_and_no_glyph(tmp_path: Path) -> None:
    (tmp_path / "named.toml").write_text(ideal_free().replace("name", "曲柄").to_toml(), encoding="utf-8")
    words = f"simulate named.toml {IDEAL.partition('free ')[2]} --out a.csv --plot a.png --quiet"
    odd = {"MPLBACKEND": "nonsense", "PYTHONWARNINGS": "error"}
    assert in_shell(words, tmp_path, **odd) == (0, "", "")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_what_is_shown_is_utf_8_in_every_locale(tmp_path: Path) -> None:
    scene = ideal_free().replace("name", "Kürbel").to_toml()
    (tmp_path / "named.toml").write_text(scene, encoding="utf-8")
    for odd in (
        {"PYTHONIOENCODING": "ascii"},
        {"PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"},
    ):
        assert in_shell("show named.toml", tmp_path, **odd) == (0, scene, "")


CLOSED = "error: --out: expected a place that can be written, got stdout, which is closed\n"
#: A command, what is done to its streams, and its exit code and stderr.
STREAMS = {
    "no stdout": (IDEAL, ">&-", 2, CLOSED),
    "no stdout, of the truth": ("truth ideal-free", ">&-", 2, CLOSED),
    "no stdout to list on": ("scenes", ">&-", 2, "error: output: not writable\n"),
    "no stdout for help": ("--help", ">&-", 2, "error: output: not writable\n"),
    "no stderr": (IDEAL, "2>&-", 0, ""),
    "no stderr to refuse on": ("simulate nothing", "2>&-", 2, ""),
    "full stderr": (IDEAL, "2>/dev/full", 0, ""),
}


@pytest.mark.parametrize("case", STREAMS)
def test_a_run_without_a_stream_that_it_needs_says_so_and_others_are_whole(case: str, tmp_path: Path) -> None:
    words, streams, code, said = STREAMS[case]
    expected = "" if code else crankslider(*words.split()).stdout
    assert in_shell(f"{words} {streams}", tmp_path) == (code, expected, said)


@pytest.mark.parametrize("streams", [">&-", "<&- >&- 2>&-", ">/dev/full 2>/dev/full"])
def test_files_are_whole_whatever_streams_are(streams: str, tmp_path: Path) -> None:
    assert in_shell(f"{IDEAL} --out a.csv --quiet {streams}", tmp_path) == (0, "", "")
    assert (tmp_path / "a.csv").read_text() == crankslider(*IDEAL.split()).stdout
    assert in_shell(f"{SWEEP} --quiet {streams}", tmp_path) == (0, "", "")
    assert len(pd.read_parquet(tmp_path / "sweep.parquet")) == 2


def test_progress_that_nobody_can_hear_ends_no_sweep(tmp_path: Path) -> None:
    assert in_shell(f"{SWEEP} 2>/dev/full", tmp_path) == (0, "", "")
    assert len(pd.read_parquet(tmp_path / "sweep.parquet")) == 2

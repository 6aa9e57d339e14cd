"""What only a process of its own shows: streams, odd environments, Ctrl-C, and what a command loads."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from engine_models.scene.library import ideal_free
from tests.helpers.running import HEAR

COMMAND = Path(sys.executable).with_name("crankslider")
MAIN = "from crankslider.command import main; main()"
IDEAL = "simulate ideal-free --end 0.0005 --samples 2 --quiet --out -"


def in_shell(words: str, folder: Path, **variables: str) -> tuple[int, str, str]:
    """Run ``crankslider`` in a shell with more in its environment; return exit code, stdout and stderr."""
    environment = {**os.environ, **variables}
    environment.pop("PYTHONUNBUFFERED", None)  # with which streams hold nothing back
    line = f"exec '{COMMAND}' {words}"
    done = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, check=False)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def test_what_is_shown_is_utf_8_in_every_locale(tmp_path: Path) -> None:
    scene = ideal_free().replace("name", "Kürbel").to_toml()
    (tmp_path / "named.toml").write_text(scene, encoding="utf-8")
    odd = {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
    assert in_shell("show named.toml", tmp_path, **odd) == (0, scene, "")


# Streams


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (f"{IDEAL} >/dev/full", "output: No space left on device"),
    ],
)
def test_a_run_without_a_stream_that_it_needs_says_so(words: str, said: str, tmp_path: Path) -> None:
    assert in_shell(words, tmp_path) == (2, "", f"error: {said}\n")
    assert not list(tmp_path.iterdir())


def test_a_reader_that_has_seen_enough_causes_no_complaint() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([COMMAND, "scenes"], stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, b"")


# Signals

#: What to say first, so that a run says when it begins.
TELL = """
from functools import wraps
from crankslider import library
simulate = library.simulate
library.simulate = wraps(simulate)(lambda **it: print("it runs", flush=True) or simulate(**it))
"""


@pytest.mark.parametrize("engine", ["reference", "exudyn"])
def test_an_interrupted_run_leaves_an_existing_file_alone(engine: str, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("before")
    long = ("simulate", "ideal-free", "--engine", engine, "--end", "1000", "--out", str(out))
    command = [sys.executable, "-c", HEAR + TELL + MAIN, *long]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert run.stdout
    assert run.stdout.readline() == "it runs\n"
    assert list(tmp_path.iterdir()) == [out], "a kill now would leave nothing"
    run.send_signal(signal.SIGINT)
    stdout, stderr = run.communicate(timeout=60)
    assert (run.returncode, stdout, stderr) == (130, "", "error: interrupted\n")
    assert out.read_text() == "before"
    assert list(tmp_path.iterdir()) == [out]


def test_help_and_lists_come_without_numbers() -> None:
    """What a command does not need would be most of its time."""
    for words, unloaded in (
        ("--help", {"numpy", "numba", "matplotlib"}),
        ("show ideal-free", {"exudyn", "pymunk", "numba", "scipy", "pandas", "matplotlib"}),
    ):
        loaded = f"import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr)); {MAIN}"
        command = [sys.executable, "-c", loaded, *words.split()]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert not unloaded & set(done.stderr.split())

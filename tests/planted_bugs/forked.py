"""A process that has imported the libraries, and runs pytest in copies of itself.

To import them takes longer than most bugs to be told of. It knows nothing of the project, of which each copy
imports its own. It reads a line of JSON for each run, the folder, pytest's arguments and seconds, and answers
with pytest's exit code, or -1 where there was no end within those seconds.
"""

import json
import os
import signal
import sys
import time
from importlib import import_module

import pytest

#: What takes a moment to import. Not Exudyn, of which some tests choose the build.
LIBRARIES = (
    *("numpy", "pandas", "numba", "matplotlib.figure", "matplotlib.backends.backend_agg", "scipy.integrate"),
    *(
        "scipy.stats",
        "scipy.interpolate",
        "hypothesis",
        "jinja2",
        "pydantic",
        "pymunk",
        "rich.progress",
        "typer",
    ),
)


def run(folder: str, arguments: list[str], limit_s: float) -> int:
    """Run pytest in a copy of this process and in a folder; return its exit code, -1 past the limit."""
    child = os.fork()
    if child == 0:
        os.setsid()
        os.chdir(folder)
        sys.path[0] = folder
        with open("output.txt", "w", encoding="utf-8") as output:
            os.dup2(output.fileno(), 1)
            os.dup2(output.fileno(), 2)
        code = int(pytest.main(arguments))
        sys.stdout.flush()
        os._exit(code)
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -1


if __name__ == "__main__":
    for library in LIBRARIES:
        import_module(library)
    for line in sys.stdin:
        print(run(*json.loads(line)), flush=True)

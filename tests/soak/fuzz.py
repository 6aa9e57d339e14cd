"""Scenes and options as nobody would write them: no traceback, every refusal one line, no wrong number.

``python -m tests.soak.fuzz [SEED [CASES]]`` prints what came of each, and every case that broke the rules.
"""

import random
import sys
import tempfile
from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from engine_models.engines import ENGINES, engine_class
from engine_models.scene.file import from_toml
from engine_models.scene.library import SCENES
from engine_models.scene.plain_words import fields
from engine_models.scene.scene import Scene
from studies.running.execution import CaseEnded, Limits
from studies.running.processes import Processes
from tests.helpers.command import Finished, crankslider

#: Beyond it a case is ended: compiling a kernel takes some seconds, and absurd scenes have absurd runs.
LIMITS = Limits(time_limit_s=120.0, memory_limit_bytes=2 * 10**9)
CODES = {0: "ran", 1: "failed", 2: "refused"}
#: What a case comes to when it breaks the rules.
BROKEN = "broken"
#: What lines begin with that are said beside a result.
ASIDE = ("note: ", "warning: ")

NASTY: list[Any] = [0, -1, 1, 2, 0.5, 1e-9, -0.0, 1e6, 1e300, 5e-324, 2**70, float("nan"), float("inf")]
NASTY += ["", "x", "\u2028", "1e3", "free", "rigid", "hertz", True, False, [], [1.0], {}, {"a": 1}]
STRINGS = ["", "0", "-1", "1_0", "１", "nan", "inf", "1e999", "1e-320", "x" * 500, "\n", "\x1b[2J", "true"]
PIECES = ["", "\x00", "\n", "[", "]", "=", '"', "'''", "#", "\ufeff", "1e", "[a.b]\n", "\u2028", "{" * 500]


@dataclass(frozen=True)
class Attempt:
    """A call of ``crankslider simulate``: the scene's file, and the options without it."""

    scene: bytes
    engine: str
    options: list[str]


def fuzz(seed: int, cases: int) -> dict[str, int]:
    """Make and run cases from a seed; return how many ran, failed, were refused, ended, and are broken.

    Each engine has a process of its own, as it would on the command line.
    """
    some = random.Random(seed)
    outcomes: Counter[str] = Counter()
    with ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        processes = {engine: stack.enter_context(Processes(1)) for engine in ENGINES}
        attempts = [attempt(some) for _ in range(cases)]
        running = [
            (each, processes[each.engine].submit_within(LIMITS, run, each, Path(folder) / f"{number}.toml"))
            for number, each in enumerate(attempts)
        ]
        for number, (each, future) in enumerate(running):
            try:
                outcome, words = future.result()
            except CaseEnded as end:
                outcome, words = end.status, end.reason
            outcomes[outcome] += 1
            if outcome not in CODES.values():
                print(f"case {number} of seed {seed}: {outcome}: {words}\n{each}", flush=True)
    return dict(outcomes)


def attempt(some: random.Random) -> Attempt:
    """Return a call that is unusual in one to three places; every other one is wrong in one more."""
    data = SCENES[some.choice(list(SCENES))]().model_dump(exclude_none=True)
    engine, end = some.choice(list(ENGINES)), 10 ** some.uniform(-4, -2)
    options = ["--engine", engine, "--end", repr(end), "--samples", "20"]
    for _ in range(some.randint(1, 3)):
        section, key = some.choice([(part, key) for part, key in places(data) if type(part[key]) is float])
        section[key] *= 10 ** some.choice([some.uniform(-1, 1), some.uniform(-1, 1), some.uniform(-9, 9)])
    step, tolerance = f"{end * 10 ** some.uniform(-3, 0):g}", f"{10 ** some.uniform(-9, -3):g}"
    more = [[], ["--step", step], ["--tolerance", tolerance], ["--set", setting(some, engine)]]
    options += some.choice(more)
    wrong = some.choice(["", "", "", "", "value", "option", "setting", "text"])
    if wrong == "value":
        change_value(some, data)
    elif wrong == "option":
        options += [some.choice(["--step", "--tolerance", "--samples"]), some.choice(STRINGS)]
    elif wrong == "setting":
        options += ["--set", f"{setting(some, engine).partition('=')[0]}={some.choice(STRINGS)}"]
    text = tomli_w.dumps(data)
    scene = (with_text_changed(some, text) if wrong == "text" else text).encode()
    return Attempt(scene, engine, options)


def with_text_changed(some: random.Random, text: str) -> str:
    """Return a text with a piece replaced, its lines mixed up, its end missing, or a mark before it."""
    start, lines = some.randrange(len(text) + 1), text.splitlines(keepends=True)
    replaced = text[:start] + some.choice(PIECES) + text[start + some.choice([0, 1, 5]) :]
    mixed = "".join(some.sample(lines, len(lines)))
    return some.choice([replaced, replaced, replaced, mixed, text[:start], "\ufeff" + text])


def change_value(some: random.Random, data: dict[str, Any]) -> None:
    """Replace a value of a scene, leave it out, or add a key."""
    section, key = some.choice(places(data))
    change = some.random()
    if change < 0.6:
        section[key] = some.choice(NASTY)
    elif change < 0.8:
        del section[key]
    else:
        section[some.choice(["x", "O", "rod", "kind", "\x1b", "k" * 300])] = some.choice(NASTY)


def places(data: dict[str, Any]) -> list[tuple[dict[str, Any], str]]:
    """Return every section with each of its keys."""
    below = [place for value in data.values() if isinstance(value, dict) for place in places(value)]
    return [(data, key) for key in data] + below


def setting(some: random.Random, engine: str) -> str:
    """Return a setting of an engine with a value that it may have."""
    key, schema = some.choice(list(fields(engine_class(engine)).items()))
    if schema["type"] == "string":
        return f"{key}={some.choice(schema['enum'])}"
    if schema["type"] == "boolean":
        return f"{key}={some.choice(['true', 'false'])}"
    value = schema["default"] * 10 ** some.uniform(-2, 2)
    return f"{key}={max(1, round(value)) if schema['type'] == 'integer' else value:g}"


def run(each: Attempt, file: Path) -> tuple[str, str]:
    """Make the call; return what came of it, and of a broken rule what it is."""
    file.write_bytes(each.scene)
    done = crankslider("simulate", file, *each.options)
    file.unlink()
    wrong = wrongs(done, each)
    return (BROKEN, wrong) if wrong else (CODES[int(str(done.code))], done.stderr)


def wrongs(done: Finished, each: Attempt) -> str:
    """Return what is wrong with a finished call, empty if nothing is."""
    lines = [line for line in done.stderr.splitlines() if not line.startswith(ASIDE)]
    if done.code not in CODES or "bug at" in done.stderr or "Traceback" in done.stderr:
        return f"exit {done.code}: {done.stderr}"
    if done.code != 0:
        told = len(lines) == 1 and lines[0].startswith("error: ") and len(lines[0]) < 2000 and not done.stdout
        return "" if told else f"exit {done.code} without one line: {lines}"
    if lines:
        return f"words beside a result: {lines}"
    header = done.stdout.partition("\n")[0].split(",")
    rows = np.loadtxt(StringIO(done.stdout), delimiter=",", skiprows=1, ndmin=2)
    if not np.isfinite(rows).all():
        return f"not finite: {[header[k] for k in np.unique(np.argwhere(~np.isfinite(rows))[:, 1])]}"
    samples = max(k for k, word in enumerate(each.options) if word == "--samples")
    times = np.linspace(0.0, float(each.options[3]), int(float(each.options[samples + 1])) + 1)
    if len(rows) != len(times) or not np.allclose(rows[:, 0], times, rtol=1e-12, atol=0.0):
        return f"times: expected {times}, got {rows[:, 0]}"
    scene = from_toml(each.scene.decode("utf-8-sig"))
    assert isinstance(scene, Scene)
    start = scene.start.crank_angle_rad
    came = rows[0, header.index("crank_angle_rad")]
    return "" if abs(came - start) <= 1e-9 * max(1.0, abs(start)) else f"start: expected {start}, got {came}"


if __name__ == "__main__":
    seed, cases = (int(word) for word in [*sys.argv[1:], *["1", "2000"][len(sys.argv) - 1 :]])
    counts = fuzz(seed, cases)
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    sys.exit(BROKEN in counts)

"""Calls of the library with arguments that nobody would give: BadInput in one line, Failed, or what is right.

``python -m tests.soak.library [SEED [CALLS]]`` prints what came of them, and every call that broke the rules.
"""

import math
import random
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import crankslider as cs
from engine_models.scene.plain_words import shown
from studies.running.execution import TIMED_OUT, CaseEnded, Limits
from studies.running.processes import Processes
from tests.soak.fuzz import BROKEN, NASTY, STRINGS

#: Beyond it a call is ended: some ask for hours.
LIMITS = Limits(time_limit_s=20.0, memory_limit_bytes=2 * 10**9)
LOOSE = cs.scenes["clearance-driven-0.5mm"]
NUMBERS = [1e-4, 3, -1.0, math.nan, math.inf]
NUMPYS: list[Callable[[Any], Any]] = [
    np.float32,
    np.float64,
    np.longdouble,
    np.complex128,
    np.array,
    np.atleast_1d,
    np.atleast_2d,
]


def nasty_values() -> list[Any]:
    """Return values that few arguments or none can take, and numbers and texts as NumPy has them."""
    ring: list[Any] = []
    ring.append(ring)
    deep: dict[str, Any] = {}
    for _ in range(5000):
        deep = {"a": deep}
    values = [*NASTY, *STRINGS, None, 10**5000, -(10**5000), ring, deep, {1: 2}, (), {1}, object(), int, len]
    values += [cs, LOOSE, ..., b"x", "\ud800", "a\0b", "a\nb", "/", ".", "x" * 5000, Path("a\0b"), range(3)]
    values += [np.int64(3), np.bool_(True), np.datetime64("2020"), np.timedelta64(1, "ns"), np.str_("rk4")]
    return values + [kind(number) for kind in NUMPYS for number in NUMBERS]


def require_run(run: cs.Run, asked: Mapping[str, Any]) -> None:
    """Require finite samples, at the times asked for."""
    assert np.isfinite(run.frame.to_numpy()).all()
    scene = asked["scene"] if isinstance(asked["scene"], cs.Scene) else cs.scenes[str(asked["scene"])]
    end = scene.end_time_s if asked["end"] is None else float(asked["end"])
    times = np.linspace(0.0, end, int(asked["samples"]) + 1)
    assert len(run.frame) == len(times) or any("samples end there" in doubt for doubt in run.warnings)
    np.testing.assert_allclose(run.frame.index, times[: len(run.frame)], rtol=1e-9)


def require_mass(scene: cs.Scene, asked: Mapping[str, Any]) -> None:
    """Require the crank's mass that was asked for, where it was."""
    if asked["field"] == "crank.mass_kg":
        assert scene.crank.mass_kg == float(asked["value"]) > 0


def require_rows(swept: Any, asked: Mapping[str, Any]) -> None:
    """Require the values of fields that were asked for in the rows."""
    for field, values in (asked["vary"] or {}).items():
        np.testing.assert_array_equal(np.unique(swept.frame[field]), np.unique(np.asarray(values, float)))


def require_refusal(result: object, _: Mapping[str, Any]) -> None:
    """Refuse any result."""
    raise AssertionError(f"expected a refusal, got {type(result).__name__}")


SHORT: dict[str, Any] = {"scene": "ideal-free", "end": 5e-4, "samples": 4}
SWEEP: dict[str, Any] = {"scene": LOOSE, "vary": {"crank.mass_kg": [0.1, 0.2]}, "engine": "reference"}
SWEEP |= {
    "settings": None,
    "scheduler": None,
    "revolutions": 0.01,
    "jobs": 1,
}
SWEEP |= {
    "members": None,
    "jitter": 0.0,
    "seed": 0,
    "transient": 0.0,
    "step": 1e-5,
    "out": None,
}
#: What is called with one argument changed, and what has to come: of the comparison two are wrong already.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any], Callable[[Any, Mapping[str, Any]], None]]] = {
    "load": (cs.load, {"path": "no.toml"}, require_refusal),
    "replace": (LOOSE.replace, {"field": "crank.mass_kg", "value": 1.0}, require_mass),
    "simulate": (cs.simulate, {**SHORT, "engine": "reference", "step": 1e-5, "settings": {}}, require_run),
    "sharpen": (cs.simulate, {**SHORT, "tolerance": 1e-6, "method": "dop853"}, require_run),
    "truth": (cs.truth, SHORT, require_run),
    "compare": (cs.compare, {"scene": "no.toml", "engines": ["none"], "folder": None}, require_refusal),
    "sweep": (cs.sweep, SWEEP, require_rows),
}
#: Those that start processes of their own, which one of ours could not.
WITH_PROCESSES = ("compare", "sweep")


def call(seed: int, number: int) -> tuple[str, str]:
    """Make a call; return what came of it, and what was called with what."""
    some = random.Random(f"{seed} {number}")
    name, value = some.choice(list(CALLS)), some.choice(nasty_values())
    function, usual, require = CALLS[name]
    argument = some.choice([*usual, "unknown"])
    asked, what = {**usual, argument: value}, f"{name} with {argument} = {shown(value)}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # doubts about a run
            result = function(**asked)
        require(result, asked)
    except cs.Failed:
        return "failed", what
    except cs.BadInput as refusal:
        said = str(refusal)
        is_clear = said.isprintable() and "expected" in said and len(said) < 2000
        return ("refused", what) if is_clear else (BROKEN, f"{what}: {said}")
    except Exception:
        return BROKEN, f"{what}: {traceback.format_exc(limit=-3)}"
    return "ran", what


def fuzz(seed: int, calls: int) -> dict[str, int]:
    """Make so many calls from a seed; return how many ran, failed, were refused, took long, are broken."""
    outcomes: Counter[str] = Counter()
    with Processes(1) as processes:
        for number in range(calls):
            name = random.Random(f"{seed} {number}").choice(list(CALLS))
            try:
                if name in WITH_PROCESSES:
                    outcome, what = call(seed, number)
                else:
                    outcome, what = processes.submit_within(LIMITS, call, seed, number).result()
            except CaseEnded as end:
                outcome, what = end.status if end.status == TIMED_OUT else BROKEN, end.reason
            outcomes[outcome] += 1
            if outcome == BROKEN:
                print(f"call {number} of seed {seed}: {what}", flush=True)
    return dict(outcomes)


if __name__ == "__main__":
    seed, calls = (int(word) for word in [*sys.argv[1:], *["1", "500"][len(sys.argv) - 1 :]])
    counts = fuzz(seed, calls)
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    sys.exit(BROKEN in counts)

"""What a timed run does in Python: few calls of the project's, and none for a step."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES

#: Files of the project, whose functions are counted.
OURS = str(Path(__file__).parents[2])
PACKAGES = tuple(f"{OURS}/{name}/" for name in ("engine_models", "reference_solver"))


@dataclass(frozen=True)
class Timed:
    """A run whose timed part calls at most ``most`` functions of the project's.

    ``coarse`` and ``fine`` are settings that take ever more steps over the same events.
    """

    engine: str
    scene: str
    end_s: float
    most: int
    coarse: dict[str, Any]
    fine: dict[str, Any]


SHARPER = {"step_tolerance": 1e-8}, {"step_tolerance": 1e-11}
#: The reference: its loop is called, and Numba looks at the addresses of what that calls. Exudyn has all in
#: one call.
RUNS = [
    Timed("reference", "ideal-free", 1.0, 5, *({"method": "dop853", **one} for one in SHARPER)),
    Timed("reference", "clearance-free-0.5mm", 0.03, 7, *({"method": "dop853", **one} for one in SHARPER)),
    Timed("reference", "rigid-free-0.5mm", 0.06, 9, *({"method": "dop853", **one} for one in SHARPER)),
    Timed("exudyn", "clearance-free-0.5mm", 0.03, 2, *({"solver": "DOPRI5", **one} for one in SHARPER)),
]


class Counter:
    """Counts calls of the project's functions between the two looks at the clock that time a run."""

    def __init__(self) -> None:
        self.calls, self.names = 0, dict[str, int]()
        self._clock, self._on = time.perf_counter, False

    def look(self) -> float:
        """Begin or end counting, as a look at the clock begins or ends the timing."""
        self._on = not self._on
        sys.setprofile(self._seen if self._on else None)
        return self._clock()

    def _seen(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(PACKAGES):
            self.calls += 1
            self.names[code.co_name] = self.names.get(code.co_name, 0) + 1


@contextmanager
def counted(monkeypatch: pytest.MonkeyPatch) -> Iterator[Counter]:
    """Count what a timed run calls; its clock is ``time.perf_counter``, looked at before and after."""
    counter = Counter()
    with monkeypatch.context() as patch:
        patch.setattr(time, "perf_counter", counter.look)
        try:
            yield counter
        finally:
            sys.setprofile(None)


@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"{run.engine}-{run.scene}")
def test_a_timed_run_calls_few_functions_of_ours(run: Timed, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = SCENES[run.scene]().model_copy(update={"end_time_s": run.end_s})
    calls = []
    for settings in (run.coarse, run.fine):
        engine, longest = make_engine(run.engine, **settings), RunSettings(run.end_s, 1)
        engine.simulate(scene, longest)  # all is compiled then
        with counted(monkeypatch) as counter:
            getattr(engine, "bare_run", engine.simulate)(scene, longest)
        assert counter.calls <= run.most, f"{counter.calls} calls: {counter.names}"
        calls.append(counter.calls)
    assert calls[0] == calls[1], f"more steps, more calls: {calls}"

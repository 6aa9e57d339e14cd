"""Work-precision's rounds: each times every rung, in an order of its own that comes out again."""

from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

from engine_models import arms
from engine_models.engine import BareRun, FloatArray
from engine_models.engines import make_engine
from studies.running.outcome import run_case
from studies.work_precision import study as work_precision


def test_every_round_times_the_same_rungs_in_an_order_of_its_own() -> None:
    rounds: dict[object, list[str]] = {}
    for case in work_precision.cases(full=False):
        if "round" in case.columns:
            columns = {name: value for name, value in case.head().items() if name != "round"}
            rounds.setdefault(case.columns["round"], []).append(str(columns))
    assert len(rounds) == work_precision.ROUNDS
    first, *others = rounds.values()
    assert all(set(order) == set(first) for order in others)
    assert len({tuple(order) for order in rounds.values()}) == len(rounds)


def test_the_order_of_cases_comes_out_again() -> None:
    one, again = ([case.key("") for case in work_precision.cases(full=False)] for _ in range(2))
    assert one == again


def ending(position: FloatArray) -> SimpleNamespace:
    """Return the recorded run of an engine that ends in a position, (bodies, 3)."""
    return SimpleNamespace(position=position[None])


def test_what_the_first_run_of_a_process_loads_is_in_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine whose first run is slow, timed where there is time for one run only."""
    runs = count()

    class Loading:
        def simulate(self, *_: object) -> SimpleNamespace:
            next(runs)
            return ending(np.zeros((3, 3)))

        def bare_run(self, *_: object) -> BareRun:
            return BareRun(1.0 if next(runs) else 9.0, np.zeros((3, 3)))

    engine = Loading()
    monkeypatch.setattr(work_precision, "make_engine", lambda *_, **__: engine)
    monkeypatch.setattr(work_precision, "REPEAT_S", 0.0)
    timed = next(case for case in work_precision.cases(full=False) if "round" in case.columns)
    for _ in range(2):
        row, _ = work_precision.measure(timed)
        assert (row["solve_time_s"], row["repeats"]) == (1.0, 1)
    assert next(runs) == 3, "loaded once"


@pytest.mark.parametrize(
    ("scene", "off_m", "holds"),
    [
        # A clearance of 0.5 mm and a crank of 50 mm: a hundredth of that.
        ("clearance-free-0.5mm", 4.9e-4, True),
        ("clearance-free-0.5mm", 5.1e-4, False),
        ("ideal-free", 4.9e-4, True),
        ("ideal-free", 5.1e-4, False),
        ("ideal-free", np.nan, False),
        ("ideal-free", np.inf, False),
    ],
)
def test_a_timed_run_that_ends_elsewhere_has_failed_and_says_when(
    scene: str, off_m: float, holds: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of three bodies is off, in one direction, in the second repeat of three only."""
    ends, recorded = count(), np.arange(9.0).reshape(3, 3)

    class Drifting:
        def simulate(self, *_: object) -> SimpleNamespace:
            return ending(recorded)

        def bare_run(self, *_: object) -> BareRun:
            end = recorded.copy()
            end[1, 1] += off_m if next(ends) == 1 else 0.0
            return BareRun(1.0, end)

    engine = Drifting()
    monkeypatch.setattr(work_precision, "make_engine", lambda *_, **__: engine)
    monkeypatch.setattr(work_precision, "REPEATS", 3)
    monkeypatch.setattr(work_precision, "REPEAT_S", 1e9)
    timed = next(c for c in work_precision.cases(False) if c.timed and c.scene.name == scene)
    row, _ = run_case(timed)
    if holds:
        assert (row["status"], row["repeats"]) == ("ok", 2)
        assert row["end_apart_m"] == pytest.approx(off_m)
    else:
        what = f"off by {off_m:.3g} m from the recorded run's" if np.isfinite(off_m) else "not finite"
        assert (row["status"], row["exception"]) == ("failed", "SimulationFailed")
        assert row["reason"] == f"the timed run's end at t = {timed.scene.end_time_s:.6g} s is {what}"


@pytest.mark.parametrize("safety", [0.9, 0.8])
def test_a_timed_run_of_exudyn_that_overflows_has_failed(safety: float) -> None:
    """DOPRI5 at 1e-7, by Exudyn's own safety factor and by the one that is the default here.

    Exudyn reports success, with coordinates that are not finite.
    """
    scene = next(scene for scene in work_precision.scenes(False) if scene.name == "clearance-free-0.5mm")
    added = {"step_tolerance": 1e-7, "step_safety": safety}
    rung = next(r for r in work_precision.ladder(scene, False) if r.arm is arms.DOPRI5)
    case = work_precision.case_of("work-precision", scene, replace(rung, added=added), 1, timed=True)
    bare = make_engine("exudyn", **case.settings).bare_run(scene, case.run)
    row, _ = run_case(case)
    assert np.isfinite(bare.position).all() == (row["status"] == "ok") == (safety == 0.8)
    assert row["status"] == "ok" or "non-finite state at t = 0.0" in str(row["reason"])

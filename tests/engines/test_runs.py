"""What a run of any engine costs and tells on its way: progress, time, memory, compiling, its own error."""

from typing import Any

import numpy as np
import pytest

from engine_models import watch
from engine_models.convergence.step_halving import FEWEST_SAMPLES, simulate_to_tolerance
from engine_models.engine import RunSettings, SimulationFailed
from engine_models.engines import ENGINES, make_engine
from engine_models.mechanics.states import observed
from engine_models.minimal import run as minimal_runs
from engine_models.reference import run as reference_runs
from engine_models.scene.library import SCENES
from engine_models.watch import told_to
from tests.engines.mechanism_texts import TEXTS
from tests.engines.mechanism_texts import scene as mechanism
from tests.engines.runs import engine as made
from tests.engines.runs import true_solution
from tests.helpers.arrays import arrays
from tests.helpers.command import crankslider
from tests.helpers.ideal_crank_slider import exact
from tests.scenes import scene

each = pytest.mark.parametrize("engine", ENGINES)

# Progress.


@each
@pytest.mark.parametrize("name", ["ideal-driven", "clearance-driven-0.1mm"])
def test_every_engine_tells_how_far_it_has_come_and_computes_the_same(engine: str, name: str) -> None:
    of = SCENES[name]().replace("end_time_s", 1e-3)
    settings, times = RunSettings(1e-5, 5), list[float]()
    with told_to(times.append):
        heard = make_engine(engine).simulate(of, settings)
    assert times
    assert 0 <= min(times) <= max(times) <= 1e-3 * (1 + 1e-6)
    assert arrays(heard) == arrays(make_engine(engine).simulate(of, settings))


@each
def test_what_a_listener_raises_ends_the_run(engine: str) -> None:
    def interrupt(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), told_to(interrupt):
        make_engine(engine).simulate(SCENES["ideal-free"](), RunSettings(1e-5, 5))


def rubbing(speed_m_s: float) -> dict[str, object]:
    return {"friction": {"law": "tanh", "coefficient": 0.1, "regularisation_speed_m_s": speed_m_s}}


@pytest.mark.parametrize(
    ("engine", "name", "changes"),
    [
        ("reference", "clearance", {"radial_clearance_m": 1e-200}),
        ("reference", "clearance", rubbing(1e-14)),
        ("reference", "rigid", rubbing(1e-200)),
        ("scipy", "clearance", rubbing(1e-14)),
    ],
)
def test_a_run_whose_steps_collapse_ends_and_says_so(
    engine: str, name: str, changes: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(minimal_runs, "OUTLASTING", 5_000)
    monkeypatch.setattr(reference_runs, "LOOK_UP_STEPS", 20_000)
    of = SCENES[f"{name}-driven-0.1mm"]().replace({f"clearance.B.{key}": changes[key] for key in changes})
    with pytest.raises(SimulationFailed, match=r"^steps of .* at t = .* do not come to the end of the run"):
        make_engine(engine).simulate(of, RunSettings(1e-5, 10))


# Time.


@pytest.mark.parametrize("name", ["clocked", "rubbing", "bearing"])
@pytest.mark.parametrize("engine", ["reference", "pymunk", "scipy method=DOP853", "scipy method=LSODA"])
def test_a_bare_run_ends_where_the_watched_one_does(engine: str, name: str) -> None:
    """A sample at the end may be on a method's interpolant: round-off of it."""
    of, settings = scene(name), RunSettings(scene(name).end_time_s / 4000, 2)
    bare, watched = (getattr(made(engine), how)(of, settings) for how in ("bare_run", "simulate"))
    np.testing.assert_allclose(bare.position, watched.position[-1], rtol=1e-12, atol=1e-14)


# Memory.


@pytest.mark.parametrize(
    ("options", "refusal"),
    [
        (("--samples", "90000"), "samples: expected at most"),
        (("--engine", "exudyn", "--step", "1e-9"), "step: expected at least"),
    ],
)
def test_a_run_too_large_for_the_memory_is_refused_in_one_line(
    options: tuple[str, ...], refusal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch, "free_bytes", lambda: 5_000_000)
    done = crankslider("simulate", "ideal-driven", *options)
    assert done.code == 2
    assert done.stderr.startswith(f"error: {refusal}")
    assert done.stderr.count("\n") == 1


# Errors that a run tells of itself.

#: An order of 1, the hardest case for the estimate: each halving only halves the error.
FIRST_ORDER = {"iterations": 10, "error_bias": 0.9**60, "half_kick_start": False}


@pytest.mark.parametrize("tolerance_m", [1e-3, 1e-7])
@pytest.mark.parametrize("name", ["ideal-free", "ideal-compressor"])
@pytest.mark.parametrize(
    ("engine", "settings"),
    [*((name, {}) for name in ENGINES), ("pymunk", FIRST_ORDER)],
    ids=[*ENGINES, "order 1"],
)
def test_the_promised_tolerance_is_kept(
    engine: str, settings: dict[str, Any], name: str, tolerance_m: float
) -> None:
    tolerance_m = max(tolerance_m, 5e-5 if settings else 0.0)
    of = SCENES[name]().replace("end_time_s", 0.05)
    run, true = simulate_to_tolerance(make_engine(engine, **settings), of, tolerance_m, 7), exact(of, 7)
    error = np.abs(run.position[:, -1, 0] - true.position[:, -1, 0]).max()
    assert error <= tolerance_m, f"{error:.3g} m with {run.steps} steps"
    np.testing.assert_allclose(run.time_s, true.time_s, rtol=1e-12)
    if engine == "exudyn" and tolerance_m < 1e-6:
        assert FEWEST_SAMPLES <= simulate_to_tolerance(make_engine(engine), of, 1e-2, 7).steps < run.steps


@pytest.mark.parametrize(
    ("name", "lever", "engine", "tolerance"),
    [("quick-return", 1.0, "reference", 1e-9), ("andrews-squeezer", 0.04, "scipy", 1e-8)],
)
def test_a_tolerance_of_what_a_mechanism_observes_is_kept(
    name: str, lever: float, engine: str, tolerance: float
) -> None:
    """Of an angle it is that of the longest lever's end, K7's from H to A."""
    of = mechanism(TEXTS[name])
    run = simulate_to_tolerance(make_engine(engine), of, tolerance, 10)
    assert lever * np.abs(observed(of, run)[0] - observed(of, true_solution(of, 10))[0]).max() <= tolerance


def test_one_sample_alone_does_not_converge_by_chance() -> None:
    """4.2 m of crank path between two samples: at the end alone positions of two bad runs may well agree."""
    of = SCENES["ideal-free"]()
    run = simulate_to_tolerance(make_engine("reference"), of, 1e-3, 1)
    assert len(run.time_s) == 2
    assert abs(run.position[:, -1, 0][-1] - exact(of, 1).position[:, -1, 0][-1]) <= 1e-3


@pytest.mark.parametrize("tolerance_m", [1e-18, 1e-300])
def test_a_tolerance_below_round_off_is_refused(tolerance_m: float) -> None:
    # The first step is no shorter for it, or 1e-300 m would take for ever.
    of = SCENES["ideal-free"]().replace("end_time_s", 0.01)
    with pytest.raises(SimulationFailed, match=f"not known to {tolerance_m:g} m: two methods part at t"):
        simulate_to_tolerance(make_engine("reference"), of, tolerance_m, 100)

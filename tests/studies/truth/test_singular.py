"""Where the truth has no answer it says so: singular loops, steps without a number, starts left open."""

from typing import Any

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.mechanics.assembly import started_from
from engine_models.scene.data import SceneError
from engine_models.scene.parts import AnyScene
from studies.truth.motion import STEP, Motion
from studies.truth.solver import TrueSolver
from studies.truth.stepping import Method, collocated, extrapolated, extrapolation, radau
from tests.engines.mechanism_texts import FOUR_BAR, four_bars, scene

METHODS = (TrueSolver("collocation", 1e-13), TrueSolver("extrapolation", 1e-14))


@pytest.mark.parametrize(("count", "solver"), [(1, METHODS[1]), (2, METHODS[0]), (2, METHODS[1])])
def test_no_step_passes_a_singular_position(count: int, solver: TrueSolver) -> None:
    """All loops of a row are singular at once, where the sign of their determinant need not change."""
    with pytest.raises(SimulationFailed, match=r"step.*by t = 0\.7[01]"):
        solver.simulate(scene(four_bars(count, 0.8)), RunSettings(1.0, 1))


@pytest.mark.parametrize(
    ("step", "method"), [(collocated, radau(7, 1e-13)), (extrapolated, extrapolation(1e-14))]
)
def test_a_step_over_places_where_no_loop_closes_is_taken_again(step: Any, method: Method) -> None:
    """A crank that cannot turn round: its loops close nowhere in much of a first step of a turn."""
    of = scene(FOUR_BAR.replace("B = 0.25", "B = 0.15"))
    usual, long = Motion(of, step, method), Motion(of, step, method)
    long.clock[STEP] = 0.3
    assert usual.to(0.3)
    assert long.to(0.3)
    off = np.abs(long.z[: long.size] - usual.z[: usual.size]).max()
    assert off < 1e-10, f"off by {off:.1e}"


def told(off_m: float) -> AnyScene:
    """Return a four-bar that begins with told states, its rocker a little aside."""
    of = scene(FOUR_BAR)
    run = METHODS[0].simulate(of, RunSettings(of.end_time_s, 1))
    position = run.position[0].copy()
    position[2, 0] += off_m
    return started_from(of, position, run.velocity[0])


def test_a_told_start_of_nine_digits_is_closed_and_one_of_fewer_is_refused() -> None:
    exact, near = (METHODS[0].simulate(told(off), RunSettings(1.0, 1)) for off in (0.0, 2e-10))
    assert np.abs(near.position - exact.position).max() < 1e-15, "angles decide, and close the joints"
    with pytest.raises(SceneError, match="open by 2e-09 m"):
        told(2e-9)

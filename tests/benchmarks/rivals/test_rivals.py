"""The scripts beside the study solve the problem: small errors that fall, in steps as asked."""

import numpy as np
import pytest

from reports.results import SLIDER
from tests.benchmarks.rivals import exudyn_alone, scipy_minimal
from tests.benchmarks.rivals.problem import ROD_M
from tests.benchmarks.rivals.race import IDEAL, LOOSE, LOOSE_DRIVEN, RIVALS, Rival, true

#: The largest error of a script's finest setting, in parts of its signal's largest value: twice what was
#: measured of the coarsest of them, Pymunk's of order 1.
ACCURATE = 4e-3
#: Scripts of order 2 or more, at steps a quarter as long, are off by at most this part of what they were.
FALLS = 0.1
#: Exudyn's and SciPy's clearance by tolerances of 1e-9 and 1e-10 are each off by a few 1e-7 m.
TOGETHER_M = 1e-6
#: With walls 2e-9 m are measured at the finest tolerance: chaos has had rounding grow.
WALLS_M = 2e-8
BY_STEPS = [
    rival for rival in RIVALS if rival.module in ("exudyn_alone", "pymunk_alone") and rival.scene != LOOSE
]
BY_TOLERANCE = [rival for rival in RIVALS if rival.scene == IDEAL and rival not in BY_STEPS]


def _skip_without(rival: Rival) -> None:
    if rival.engine == "heyoka":
        pytest.importorskip("heyoka")


@pytest.mark.parametrize(
    "rival", [*BY_STEPS, *BY_TOLERANCE], ids=lambda rival: f"{rival.module}-{rival.scene}"
)
def test_a_script_solves_the_ideal_crank_slider(rival: Rival) -> None:
    _skip_without(rival)
    size = ROD_M if rival.column == SLIDER else np.abs(true(rival.scene, rival.column)).max()
    assert rival.error(rival.settings[-1]) < ACCURATE * size


@pytest.mark.parametrize("rival", [r for r in BY_STEPS if (r.engine, r.scene) != ("pymunk", IDEAL)], ids=str)
def test_a_script_of_order_two_converges(rival: Rival) -> None:
    coarse, fine = rival.settings
    assert fine == 4 * coarse
    assert rival.error(fine) < FALLS * rival.error(coarse)


@pytest.mark.parametrize("rival", BY_STEPS, ids=str)
def test_a_script_takes_the_steps_that_it_is_asked_for(rival: Rival) -> None:
    steps = int(rival.settings[0])
    assert rival.solve(steps, 1).steps == steps


def test_exudyn_and_scipy_on_their_own_agree_with_clearance() -> None:
    one, other = exudyn_alone.clearance_free(1e-9, 24), scipy_minimal.clearance_free(1e-10, 24)
    apart = np.abs(one.signal - other.signal).max()
    assert apart < TOGETHER_M, f"{apart:.1e} m"


def test_heyoka_and_scipy_on_their_own_agree_with_clearance() -> None:
    pytest.importorskip("heyoka")
    from tests.benchmarks.rivals import heyoka_minimal

    one, other = heyoka_minimal.clearance_free(1e-12, 24), scipy_minimal.clearance_free(1e-10, 24)
    apart = np.abs(one.signal - other.signal).max()
    assert apart < TOGETHER_M, f"{apart:.1e} m"


def test_heyoka_on_its_own_is_right_with_a_wall() -> None:
    pytest.importorskip("heyoka")
    rival = next(one for one in RIVALS if one.scene == LOOSE_DRIVEN)
    assert (error := rival.error(rival.settings[-1])) < WALLS_M, f"{error:.1e} m"

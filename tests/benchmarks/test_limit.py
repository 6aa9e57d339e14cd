"""heyoka's scripts solve the scenes that the reference is timed on beside them."""

import numpy as np
import pytest

from studies.accuracy import SAMPLES


def test_heyokas_sliders_are_the_true_ones() -> None:
    """At 1e-12; measured 2e-9 m with walls, where chaos has had rounding grow."""
    pytest.importorskip("heyoka")
    from tests.benchmarks.limit import DRIVEN, IDEAL, LOOSE, solve, true_slider_m

    for name in (IDEAL, LOOSE, DRIVEN):
        off = np.abs(solve(name, 1e-12, SAMPLES).slider_m - true_slider_m(name)).max()
        assert off < 2e-8, f"{name}: {off:.1e} m"

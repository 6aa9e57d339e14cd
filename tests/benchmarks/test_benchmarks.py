"""What the benchmarks time does the same as what it stands beside."""

from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks.kernel import KERNEL, ROUND_OFF, C, compiler, contenders, part


@pytest.mark.skipif(compiler() is None, reason="no C compiler")
def test_the_c_loop_follows_the_kernel(tmp_path: Path) -> None:
    steppers, q, v = contenders(tmp_path)
    assert part(steppers[C], steppers[KERNEL], q, v) < ROUND_OFF


def test_heyokas_sliders_are_the_true_ones() -> None:
    """At 1e-12; measured 2e-9 m with walls, where chaos has had rounding grow."""
    pytest.importorskip("heyoka")
    from studies.accuracy import SAMPLES
    from tests.benchmarks.limit import DRIVEN, IDEAL, LOOSE, solve, true_slider_m

    for name in (IDEAL, LOOSE, DRIVEN):
        off = np.abs(solve(name, 1e-12, SAMPLES).slider_m - true_slider_m(name)).max()
        assert off < 2e-8, f"{name}: {off:.1e} m"

"""The benchmark's hand-written C loops do what the kernels do, so that their times can be compared."""

from pathlib import Path

import numpy as np
import pytest

from engine_models.scene.format import ContactLaw as LawName
from engine_models.scene.library import clearance, clearance_driven_05
from reference_solver.solver import StepChoice
from tests.benchmarks.c_loop import CLoop, compiler
from tests.benchmarks.clearance import ByC, difference, run_by_kernel
from tests.benchmarks.kernel import STEP_S, Kernel, check
from tests.helpers.kernels import scene_case

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def test_the_ideal_loop_follows_the_kernel(tmp_path: Path) -> None:
    mechanism, q, v, _ = scene_case("ideal-driven")
    check(CLoop(mechanism, STEP_S, tmp_path), Kernel(mechanism, q), q, v)


@pytest.mark.parametrize(
    ("law", "restitution", "end_time_s", "kinds"),
    # Bounces, until rounding shows; and a pin that stays, and comes to where the law would pull.
    [("lankarani-nikravesh", 0.9, 0.003, {1, -1}), ("flores", 0.1, 0.024, {1, -1, 2, 3})],
)
def test_the_clearance_loop_follows_the_kernel(
    law: LawName, restitution: float, end_time_s: float, kinds: set[int], tmp_path: Path
) -> None:
    joint = {"B": clearance(5e-4, law, restitution)}
    scene = clearance_driven_05().model_copy(update={"clearance": joint, "end_time_s": end_time_s})
    choice = StepChoice(4e-5, 25)
    ours, theirs = ByC(scene, choice, tmp_path).run(), run_by_kernel(scene, choice)
    assert difference(ours, theirs) is None
    assert set(theirs.what) == kinds
    # Small beside the other sums, but far above rounding at steps as long as these.
    np.testing.assert_allclose(ours.sums[-1], theirs.sums[-1], rtol=1e-2)

"""The compiled kernel agrees with the readable equations and contains only what the mechanism needs."""

import numpy as np
import pytest

from reference_solver.compiled.kernel import Topology
from reference_solver.compiled.kernel import source_of as source_of_marked
from reference_solver.mechanism.constraints import row_slices
from reference_solver.mechanism.mechanism import Body, Mechanism
from tests.helpers.kernels import CASES, VARIANTS, check_faces

#: The two faces sum in different orders. Measured: up to 12 units in the last place on the scenes, 82 in the
#: multipliers of the case with everything, where spring forces ten times larger cancel. A wrong term shows
#: at a millionth or more.
ROUND_OFF = 200 * float(np.finfo(float).eps)


@pytest.mark.parametrize("stabilisation", VARIANTS)
@pytest.mark.parametrize("case", CASES)
def test_a_compiled_step_agrees_with_the_readable_one_to_round_off(case: str, stabilisation: str) -> None:
    mechanism, q, v, h = CASES[case]()
    after_q = check_faces(mechanism, q, v, h, VARIANTS[stabilisation], ROUND_OFF)
    moved = np.abs(after_q - q).max()
    assert moved > 1e-5, f"the step moved nothing by more than {moved:.1e}"


def source_of(mechanism: Mechanism, projected: bool = False) -> str:
    return source_of_marked(Topology(mechanism, None, projected).marked())


def sums(source: str) -> list[str]:
    """Return what a step adds to the sums of a driver's work and of what a stabilisation removes."""
    _, _, step = source.partition("def stepped")
    return step.partition("return ")[2].partition("\n")[0].split(", ")[-2:]


def test_a_kernel_contains_nothing_that_its_mechanism_does_not() -> None:
    free, driven = (CASES[name]() for name in ("ideal-free", "ideal-driven"))
    free_source, driven_source = source_of(free[0]), source_of(driven[0])
    free_source, driven_source = (text.partition("def answer")[2] for text in (free_source, driven_source))
    assert "sqrt(" not in free_source, "no spring, no length"
    assert sums(free_source) == ["0.0", "0.0"], "no driver, no driver's work"
    assert "project" not in free_source
    work, removed = sums(driven_source)
    assert work != "0.0"
    assert removed == "0.0", "no stabilisation, no energy that it removes"
    assert sums(source_of(driven[0], projected=True))[1] != "0.0"
    # Eight rows and the two angles that carry arms: the slider's angle has neither sine nor cosine.
    assert free_source.count("cos(") == free_source.count("sin(") == 2
    assert row_slices(free[0])[-1].stop == 8
    assert "lambda8" not in free_source
    assert "lambda8" in driven_source
    without_gravity = Mechanism(free[0].bodies, free[0].constraints)
    assert len(source_of(without_gravity).partition("def answer")[2]) < len(free_source)


def test_another_mechanism_of_the_same_topology_has_the_same_source() -> None:
    mechanism, *_ = CASES["ideal-driven"]()
    heavier = Mechanism(
        tuple(Body(3 * b.mass_kg, 2 * b.inertia_kg_m2) for b in mechanism.bodies),
        mechanism.constraints,
        gravity_m_s2=1.62,
    )
    assert source_of(heavier) == source_of(mechanism)

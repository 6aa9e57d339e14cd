"""Kernels of large mechanisms: what they call instead of putting it in its place changes no result."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import SCENES
from reference_solver.compiled import kernel
from reference_solver.compiled.kernel import LARGEST_INLINE, Topology, source_of
from reference_solver.mechanism.contact_laws import ContactLaw
from reference_solver.mechanism.mechanism import GROUND, ClearanceJoint
from reference_solver.methods import RK4, Method, dop853
from reference_solver.solver import ErrorControl, StepChoice, solve
from tests.helpers.chains import chain, chain_start
from tests.helpers.kernels import VARIANTS, check_faces, everything_case
from tests.helpers.singular import parallelograms

#: The two faces sum in different orders. Measured: 51 units in the last place of the largest multiplier.
ROUND_OFF = 200 * float(np.finfo(float).eps)
LOOPS = 1 + LARGEST_INLINE // 2
CHOICES: dict[str, StepChoice | ErrorControl] = {"rk4": StepChoice(5e-5, 50), "dop853": ErrorControl(1e-9)}


@pytest.fixture
def compiled_from() -> Iterator[Callable[[int], None]]:
    """What sets the number of bodies beyond which kernels call, and those from which readable faces run."""
    with pytest.MonkeyPatch.context() as patch:

        def set_largest(bodies: int) -> None:
            patch.setattr(kernel, "LARGEST_INLINE", bodies)
            source_of.cache_clear()

        yield set_largest
    source_of.cache_clear()


@pytest.mark.parametrize("method", [RK4, dop853()], ids=["rk4", "dop853"])
def test_only_a_large_mechanism_has_functions_that_are_called(method: Method) -> None:
    for links, decorated in ((LARGEST_INLINE, 0), (LARGEST_INLINE + 1, 3)):
        text = source_of(Topology(chain(links), projected=True, method=method).marked())
        assert text.count("@called(") == decorated
        assert ("zeros(" in text) == (decorated > 0 and method is RK4)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_step_of_a_large_mechanism_agrees_with_the_readable_one(variant: str) -> None:
    passing = parallelograms(LOOPS)
    check_faces(passing.mechanism, passing.q, passing.v, 1e-3, VARIANTS[variant], ROUND_OFF)


@pytest.mark.parametrize("variant", VARIANTS)
def test_all_there_is_agrees_where_it_is_called(variant: str, compiled_from: Callable[[int], None]) -> None:
    compiled_from(0)
    check_faces(*everything_case(), VARIANTS[variant], ROUND_OFF)


@pytest.mark.parametrize("choice", [StepChoice(1e-3), ErrorControl(1e-8)], ids=["rk4", "dop853"])
def test_a_large_mechanism_passes_singular_positions_as_one_pendulum(
    choice: StepChoice | ErrorControl, compiled_from: Callable[[int], None]
) -> None:
    compiled_from(LARGEST_INLINE)
    passing = parallelograms(LOOPS, 3.0)
    run = solve(passing.mechanism, passing.q, passing.v, end_time_s=3.0, samples=30, step=choice)
    angle = passing.angle(run.time_s)
    assert angle[0] - angle[-1] > 2 * np.pi, "it has gone round"
    assert np.abs(run.q[:, 2] - angle).max() < 1e-7


#: Pins in clearance, and one that comes to follow its rigid wall; tables of gas, and branches in loads.
ENDS_S = {"clearance-free-OAB": 3.2e-3, "rigid-driven-0.02mm": 8e-4, "ideal-compressor": 0.01}


@pytest.mark.parametrize("method", CHOICES)
@pytest.mark.parametrize("name", ENDS_S)
def test_contacts_rigid_walls_and_tables_run_alike_where_they_are_called(
    name: str, method: str, compiled_from: Callable[[int], None]
) -> None:
    scene, runs = SCENES[name](), []
    mechanism, (q, v) = mechanism_of(scene), (part.ravel() for part in start_state(scene))
    for largest in (LARGEST_INLINE, 0):
        compiled_from(largest)
        runs.append(solve(mechanism, q, v, end_time_s=ENDS_S[name], samples=20, step=CHOICES[method]))
    inline, called = runs
    assert (called.events["what"] == inline.events["what"]).all()
    assert len(called.mode_changes) == len(inline.mode_changes) == (name == "rigid-driven-0.02mm")
    for field in ("q", "v", "multipliers", "normal_force_N", "friction_force_N"):
        one, other = getattr(called, field), getattr(inline, field)
        assert np.abs(one - other).max(initial=0.0) <= 1e-6 * np.abs(other).max(initial=0.0), field


def test_a_large_mechanism_with_clearance_runs_alike_by_both_methods(
    compiled_from: Callable[[int], None],
) -> None:
    compiled_from(LARGEST_INLINE)
    links, law = LARGEST_INLINE + 1, ContactLaw(1e6, 1.5, 0.5)
    _, *joints = chain(links).constraints
    pin = ClearanceJoint(GROUND, (0.0, 0.0), 0, (-0.05, 0.0), 1e-3, 0.01, law)
    mechanism = replace(chain(links), constraints=tuple(joints), contacts=(pin,))
    q, v = chain_start(np.linspace(-1.2, -1.6, links), np.zeros(links))
    rk4, controlled = (
        solve(mechanism, q, v, end_time_s=0.03, samples=10, step=choice)
        for choice in (StepChoice(2e-4, 100), ErrorControl(1e-10))
    )
    assert len(rk4.events) == len(controlled.events) > 0, "it has touched"
    assert np.abs(rk4.q - controlled.q).max() < 1e-7

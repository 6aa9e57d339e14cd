"""Kernels: machine code has what a mechanism needs and no more, and one text serves all of a topology."""

import re
from dataclasses import replace

import numpy as np
import pytest

from engine_models.reference.solution import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from reference_solver import kernel
from reference_solver.equations import Equations
from reference_solver.kernel import Program, Topology, program_of
from reference_solver.mechanism.data import Body
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.methods import RK4, Method, dop853
from reference_solver.solver import solve
from tests.helpers.chains import chain, chain_start


def text_of(mechanism: Mechanism, name: str, projected: bool = False) -> str:
    """Return the text of a function of a mechanism's kernel."""
    text = program(mechanism, projected).text
    return text.partition(f"define double @{name}(")[2].partition("\n}\n")[0]


def program(mechanism: Mechanism, projected: bool = False, method: Method = RK4) -> Program:
    return program_of(Topology(mechanism, projected=projected, method=method).marked())


def stored(text: str) -> list[str]:
    """Return what a function stores, in order."""
    return re.findall("store double ([^,]*), ptr", text)


def test_a_kernel_contains_nothing_that_its_mechanism_does_not() -> None:
    zero = "0x0000000000000000"
    free, driven = (mechanism_of(IDEAL_SCENES[name]()) for name in ("ideal-free", "ideal-driven"))
    rates = text_of(free, "rates")
    assert "sqrt" not in rates, "no spring, no length"
    assert stored(rates)[18:20] == [zero, zero], "no driver's work, no energy that is removed"
    work, removed = stored(text_of(driven, "rates"))[18:20]
    assert work != zero
    assert removed == zero, "no stabilisation"
    assert "fmul" not in text_of(free, "project"), "a state goes through as it is"
    assert "fmul" in text_of(free, "project", projected=True)
    # Eight rows and the two angles that carry arms: the slider's angle has neither sine nor cosine.
    assert rates.count("@cos(") == rates.count("@sin(") == 2
    assert len(stored(text_of(free, "forces"))) == 8
    assert len(stored(text_of(driven, "forces"))) == 9
    assert len(text_of(replace(free, gravity_m_s2=0.0), "rates")) < len(rates)


def test_another_mechanism_of_the_same_topology_has_the_same_program() -> None:
    mechanism = mechanism_of(IDEAL_SCENES["ideal-driven"]())
    bodies = tuple(Body(3 * b.mass_kg, 2 * b.inertia_kg_m2) for b in mechanism.bodies)
    assert program(replace(mechanism, bodies=bodies, gravity_m_s2=1.62)) is program(mechanism)


@pytest.mark.parametrize("method", [RK4, dop853()], ids=["rk4", "dop853"])
def test_only_the_step_of_a_large_mechanism_calls_its_parts(method: Method) -> None:
    for links, calls in ((kernel.LARGEST_INLINE, 0), (kernel.LARGEST_INLINE + 1, 4)):
        text = program(chain(links), True, method).text
        assert text.count("call double @rates(") == (calls if method is RK4 else 0)


def test_a_long_chain_moves_by_the_accelerations_of_its_whole_matrix() -> None:
    links = 41
    q, v = chain_start(np.linspace(0, 1, links), np.linspace(1, -1, links))
    run = solve(chain(links), q, v, end_time_s=1e-3, samples=1, step=1e-3, stabilisation="none")
    equations = Equations(chain(links), q)
    B, weight = equations.constraint_matrix(q), equations.inverse_mass
    right = -equations.centripetal(q, v) - B @ (weight * equations.applied_force(0.0, q, v))
    dense = np.linalg.solve((B * weight) @ B.T, right)
    assert np.abs(run.multipliers[0] - dense).max() <= 1e-9 * np.abs(dense).max()

"""Runge-Kutta methods as tables: the conditions of their order, and the order of their step."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import DOP853

from reference_solver.methods import RK4, dop853, step

FloatArray = NDArray[np.float64]


def test_the_classical_tableau_meets_all_conditions_of_order_four() -> None:
    size = len(RK4.nodes)
    A, b, c = np.zeros((size, size)), np.array(RK4.weights), np.array(RK4.nodes)
    for row, entries in enumerate(RK4.matrix):
        A[row, : len(entries)] = entries
    np.testing.assert_allclose(A.sum(axis=1), c, atol=1e-15)
    conditions = {  # Butcher 1963: a sum for each rooted tree up to four nodes
        "1": (b.sum(), 1),
        "c": (b @ c, 1 / 2),
        "c^2": (b @ c**2, 1 / 3),
        "Ac": (b @ A @ c, 1 / 6),
        "c^3": (b @ c**3, 1 / 4),
        "c Ac": ((b * c) @ A @ c, 1 / 8),
        "A c^2": (b @ A @ c**2, 1 / 12),
        "AAc": (b @ A @ A @ c, 1 / 24),
    }
    for tree, (found, expected) in conditions.items():
        assert abs(found - expected) < 1e-15, tree


def test_the_table_of_order_eight_is_that_of_scipys_own_solver() -> None:
    method = dop853()
    assert method.embedded is not None
    rows = {
        "nodes": (method.nodes, DOP853.C),
        "weights": (method.weights, DOP853.B),
        "error estimates": (method.embedded.estimates, [DOP853.E5[:12], DOP853.E3[:12]]),
        "nodes of dense output": (method.embedded.nodes, DOP853.C_EXTRA),
        "matrix of dense output": (method.embedded.matrix, DOP853.A_EXTRA),
        "dense output": (method.embedded.dense, DOP853.D),
    }
    for name, (found, expected) in rows.items():
        np.testing.assert_array_equal(found, expected, name)
    for k, row in enumerate(method.matrix):
        np.testing.assert_array_equal(row, DOP853.A[k, :k])


@dataclass
class Answer:
    """What an oscillator answers at a state."""

    accelerations: FloatArray
    powers: dict[str, float] = field(default_factory=dict)
    removed_W: float = 0.0
    damper_per_s: float = 0.0
    condition: float = 1.0


def test_a_step_of_an_oscillator_is_its_taylor_series_up_to_order_four() -> None:
    h, q, v = 0.25, np.array([1.0]), np.array([0.5])

    def answer(t: float, q: FloatArray, v: FloatArray) -> Answer:  # noqa: ARG001
        return Answer(-q, {"speed": float(v[0])}, removed_W=float(q[0]))

    found = step(RK4, answer, None, 0.0, q, v, h)
    series = sum(
        np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]) * h, k) / np.prod(range(1, k + 1))
        for k in range(1, 5)
    )
    change_q, change_v = series @ np.array([1.0, 0.5])
    np.testing.assert_allclose([found.q[0] - 1.0, found.v[0] - 0.5], [change_q, change_v], rtol=0, atol=1e-15)
    assert abs(found.sums["speed"] - change_q) < 1e-15, "what is integrated beside it has the same weights"
    assert found.removed == h, "a feedback's power counts as at the start of the step"
    assert found.ok


def test_what_rounding_takes_is_carried_on() -> None:
    small, count = 1e-17, 1000

    def answer(t: float, q: FloatArray, v: FloatArray) -> Answer:  # noqa: ARG001
        return Answer(np.zeros(1))

    q, v, lost = np.ones(1), np.full(1, small), np.zeros(2)
    for _ in range(count):
        found = step(RK4, answer, None, 0.0, q, v, 1.0, lost)
        q, lost = found.q, found.lost
    assert abs(q[0] + lost[0] - 1.0 - count * small) < np.finfo(float).eps
    assert q[0] > 1.0, "each step alone rounds to nothing"


@pytest.mark.parametrize("held", [True, False])
def test_a_projection_acts_at_the_end_of_a_step_and_its_failure_is_the_steps(held: bool) -> None:
    def answer(t: float, q: FloatArray, v: FloatArray) -> Answer:  # noqa: ARG001
        return Answer(-q, removed_W=5.0)

    def project(t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, float, bool]:
        assert t == 2.5
        return 0 * q, 2 * np.ones_like(v), 3.0, held

    found = step(RK4, answer, project, 2.0, np.ones(1), np.ones(1), 0.5)
    assert (found.q[0], found.v[0], found.removed, found.ok) == (0.0, 2.0, 3.0, held)

"""Runge-Kutta methods as tables: the conditions of their order, and the order of their step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_solver.methods import RK4, increments, quadrature, stages

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


@dataclass
class Answer:
    """What an oscillator answers at a state."""

    accelerations: FloatArray


def test_a_step_of_an_oscillator_is_its_taylor_series_up_to_order_four() -> None:
    h, q, v = 0.25, np.array([1.0]), np.array([0.5])
    found = stages(RK4, lambda t, q, v: Answer(-q), 0.0, q, v, h)  # noqa: ARG005
    change_q, change_v = increments(RK4, h, found)
    series = sum(
        np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]) * h, k) / np.prod(range(1, k + 1))
        for k in range(1, 5)
    )
    expected = series @ np.array([1.0, 0.5])
    np.testing.assert_allclose([change_q[0], change_v[0]], expected, rtol=0, atol=1e-15)
    square = quadrature(RK4, h, [float(stage.v[0]) for stage in found])
    assert abs(square - change_q[0]) < 1e-16, "what is integrated beside it has the same weights"


def test_stages_are_taken_at_the_nodes_times() -> None:
    times: list[float] = []

    def rates(t: float, q: FloatArray, v: FloatArray) -> Answer:  # noqa: ARG001
        times.append(t)
        return Answer(-q)

    stages(RK4, rates, 2.0, np.ones(1), np.ones(1), 0.5)
    assert times == [2.0, 2.25, 2.25, 2.5]

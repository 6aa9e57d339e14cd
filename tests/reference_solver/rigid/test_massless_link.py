"""The constraint of a pin that follows its wall: two points at a fixed distance."""

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    MasslessLink,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    SpringDamper,
)
from reference_solver.solver import solve
from tests.helpers.kernels import VARIANTS, check_faces, straight_guide
from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.studies.truth.closed_forms.linkages import GRAVITY, Rod, TriplePendulum

FloatArray = NDArray[np.float64]
#: The two faces sum in different orders (see test_reference_kernel).
ROUND_OFF = 200 * float(np.finfo(float).eps)
#: A central difference over 1e-6 of quantities of order one: truncation 1e-12, round-off 1e-10.
DIFFERENCE = 1e-9


def linked() -> tuple[Mechanism, FloatArray, FloatArray]:
    """Return three bodies with a guide, a driver, a spring and links between bodies and to the frame."""
    q = np.array([0.1, 0.2, 0.0, 0.5, 0.1, 0.9, 0.8, 0.9, -0.3])
    bodies = (Body(1.0, 0.3), Body(2.0, 0.5), Body(0.7, 0.2))
    ends = (
        (0, (0.05, -0.1), 1, (-0.3, 0.02)),
        (GROUND, (0.5, 0.7), 2, (0.1, 0.0)),
        (2, (0.0, 0.0), 1, (0.2, 0.1)),
    )
    gaps = Equations(Mechanism(bodies, tuple(RevoluteJoint(*end) for end in ends)), q).violation(0.0, q)
    lengths = np.linalg.norm(gaps.reshape(-1, 2), axis=1)
    links = tuple(MasslessLink(*end, float(length)) for end, length in zip(ends, lengths, strict=True))
    mechanism = Mechanism(
        bodies,
        (*straight_guide(0, (0.1, 0.2), 0.4), links[0], PrescribedSpeed(1, 4.0), *links[1:]),
        (SpringDamper(1, (0.2, 0.0), 2, (0.0, 0.3), 100.0, 1.0, 0.5),),
        gravity_m_s2=9.81,
    )
    equations = Equations(mechanism, q)
    B, v = equations.constraint_matrix(q), np.linspace(-1.0, 2.0, 9)
    return mechanism, q, v - np.linalg.pinv(B) @ (B @ v - equations.C)


@pytest.mark.parametrize("stabilisation", VARIANTS)
def test_a_compiled_step_with_links_agrees_with_the_readable_one_to_round_off(
    stabilisation: str,
) -> None:
    check_faces(*linked(), 1e-3, VARIANTS[stabilisation], ROUND_OFF)


def test_a_links_rows_are_the_derivatives_of_its_position() -> None:
    mechanism, q, v = linked()
    equations, step = Equations(mechanism, q), 1e-6
    B = equations.constraint_matrix(q)
    for column, direction in enumerate(np.eye(len(q))):
        difference = (
            equations.violation(0.0, q + step * direction) - equations.violation(0.0, q - step * direction)
        ) / (2 * step)
        worst = np.abs(difference - B[:, column]).max()
        assert worst < DIFFERENCE, f"column {column}: {worst:.1e}"
    ahead, behind = (equations.constraint_matrix(q + s * v) @ v for s in (step, -step))
    worst = np.abs((ahead - behind) / (2 * step) - equations.centripetal(q, v)).max()
    assert worst < DIFFERENCE * np.abs(v).max() ** 2, f"[B']q': {worst:.1e}"


def test_a_link_swings_as_a_rod_without_mass_at_order_four() -> None:
    pendulum = TriplePendulum((Rod(0.3, 0.0, 0.0, 0.0), Rod(0.2, 0.4, 2e-3, 0.1), Rod(0.25, 0.3, 2e-3, 0.15)))
    angles, rates = np.array([-0.8, -1.2, 0.4]), np.array([1.0, -2.0, 3.0])
    _, second, third = pendulum.rods
    mechanism = Mechanism(
        (Body(second.mass, second.inertia), Body(third.mass, third.inertia)),
        (
            MasslessLink(GROUND, (0.0, 0.0), 0, (-second.s, 0.0), 0.3),
            RevoluteJoint(0, (second.length - second.s, 0.0), 1, (-third.s, 0.0)),
        ),
        gravity_m_s2=GRAVITY,
    )
    end, samples, counts = 0.5, 10, [40, 80, 160]
    states = pendulum.motion(angles, rates, np.linspace(0, end, samples + 1))
    centres = np.array([pendulum.centres(s[:3])[1:] for s in states])
    forces = np.array([pendulum.hanging_force(s[:3], s[3:]) for s in states])
    q = np.column_stack([centres[0], angles[1:]]).ravel()
    v = np.column_stack([pendulum.centre_rates(angles, rates)[1:], rates[1:]]).ravel()
    place_errors, force_errors = [], []
    for count in counts:
        found = solve(mechanism, q, v, end_time_s=end, samples=samples, step=end / (samples * count))
        bodies = found.q.reshape(-1, 2, 3)
        place_errors.append(np.abs(bodies[:, :, :2] - centres).max())
        arm = np.column_stack([np.cos(bodies[:, 0, 2]), np.sin(bodies[:, 0, 2])])
        d = bodies[:, 0, :2] - second.s * arm
        force_errors.append(np.abs(found.multipliers[:, :1] * d - forces).max())
    for name, errors in (("place", place_errors), ("force", force_errors)):
        order = -slope(counts, errors)
        assert abs(order - 4) < ORDER_TOLERANCE, f"{name}: order {order:.3f} from errors {errors}"


def test_a_link_without_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"MasslessLink.length_m: expected a finite number > 0, got 0"):
        MasslessLink(GROUND, (0.0, 0.0), 0, (0.0, 0.0), 0.0)

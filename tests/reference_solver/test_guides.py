"""Slots on the frame and on moving bodies, and bodies that turn together, against own derivations."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_solver.equations import Equations
from reference_solver.mechanism.mechanism import GROUND, Body, Mechanism, RevoluteJoint, SameAngle, Slot
from reference_solver.solver import solve
from tests.helpers.kernels import VARIANTS, straight_guide
from tests.helpers.orders import ORDER_TOLERANCE, slope

FloatArray = NDArray[np.float64]
GRAVITY = 9.81
#: Central differences with a step of 1e-6 of functions of order 1.
DIFFERENCE = 1e-8


def test_rows_of_guides_are_the_derivatives_of_their_gaps() -> None:
    bodies = (Body(1.0, 0.3), Body(2.0, 0.5), Body(0.7, 0.2))
    slots = (
        Slot(0, (0.1, -0.2), 1, (0.3, 0.05), 0.7),
        Slot(GROUND, (0.4, 0.1), 2, (-0.1, 0.2), -1.1),
        Slot(2, (0.0, 0.3), GROUND, (0.5, -0.6), 2.0),
    )
    mechanism = Mechanism(bodies, (*slots, SameAngle(0, 2), SameAngle(GROUND, 1), SameAngle(2, GROUND)))
    q, v, step = np.linspace(-1.0, 1.4, 9), np.linspace(2.0, -1.5, 9), 1e-6
    start = np.linspace(0.3, -0.2, 9)
    equations = Equations(mechanism, start)
    assert not equations.violation(0.0, start)[len(slots) :].any(), "angles count from the start"
    B = equations.constraint_matrix(q)
    for column, direction in enumerate(np.eye(9)):
        ahead, behind = (equations.violation(0.0, q + s * direction) for s in (step, -step))
        worst = np.abs((ahead - behind) / (2 * step) - B[:, column]).max()
        assert worst < DIFFERENCE, f"column {column}: {worst:.1e}"
    ahead, behind = (equations.constraint_matrix(q + s * v) @ v for s in (step, -step))
    worst = np.abs((ahead - behind) / (2 * step) - equations.centripetal(q, v)).max()
    assert worst < DIFFERENCE * np.abs(v).max() ** 2, f"[B']q': {worst:.1e}"


class ScotchYoke:
    """A crank whose pin slides and turns in an upright slot of a yoke, which slides along x."""

    radius, arm, mass, inertia, yoke = 0.05, 0.02, 0.4, 4e-4, 0.6
    start, rate, end = 0.4, 30.0, 0.3
    mechanism = Mechanism(
        (Body(mass, inertia), Body(yoke, 1e-3)),
        (
            RevoluteJoint(GROUND, (0.0, 0.0), 0, (-arm, 0.0)),
            *straight_guide(1, (0.0, 0.0), 0.0),
            Slot(1, (0.0, 0.0), 0, (radius - arm, 0.0), np.pi / 2),
        ),
        gravity_m_s2=GRAVITY,
    )

    def places(self, phi: FloatArray) -> FloatArray:
        """Return (..., 2, 3): places and angles of crank and yoke."""
        c, s, zero = np.cos(phi), np.sin(phi), 0 * phi
        crank = np.stack([self.arm * c, self.arm * s, phi], -1)
        return np.stack([crank, np.stack([self.radius * c, zero, zero], -1)], -2)

    def changes(self, phi: FloatArray) -> FloatArray:
        """Return their derivatives by phi."""
        c, s, zero = np.cos(phi), np.sin(phi), 0 * phi
        crank = np.stack([-self.arm * s, self.arm * c, zero + 1], -1)
        return np.stack([crank, np.stack([-self.radius * s, zero, zero], -1)], -2)


class QuickReturn:
    """A shaper: a block, on the crank's pin, slides along a lever, whose end moves a ram by a rod."""

    pivot, radius, lever, rod, height = 0.2, 0.08, 0.4, 0.15, 0.42
    start, rate, end = 0.3, 12.0, 0.5
    mechanism = Mechanism(
        (Body(1.0, 2e-3), Body(0.2, 5e-5), Body(1.5, 2e-2), Body(0.3, 6e-4), Body(2.0, 1e-2)),
        (
            RevoluteJoint(GROUND, (0.0, 0.0), 2, (-lever / 2, 0.0)),
            RevoluteJoint(GROUND, (0.0, pivot), 0, (0.0, 0.0)),
            RevoluteJoint(0, (radius, 0.0), 1, (0.0, 0.0)),
            RevoluteJoint(2, (lever / 2, 0.0), 3, (-rod / 2, 0.0)),
            RevoluteJoint(3, (rod / 2, 0.0), 4, (0.0, 0.0)),
            Slot(2, (0.0, 0.0), 1, (0.0, 0.0), 0.0),
            SameAngle(2, 1),
            *straight_guide(4, (0.0, height), 0.0),
        ),
        gravity_m_s2=GRAVITY,
    )

    def _angles(self, phi: FloatArray) -> tuple[FloatArray, ...]:
        """Return the block's place, and the angles of lever and rod, each with its derivative by phi."""
        zero = 0 * phi
        block = np.stack([self.radius * np.cos(phi), self.pivot + self.radius * np.sin(phi)], -1)
        block_1 = np.stack([-self.radius * np.sin(phi), self.radius * np.cos(phi)], -1)
        psi = np.arctan2(block[..., 1], block[..., 0])
        psi_1 = (block[..., 0] * block_1[..., 1] - block[..., 1] * block_1[..., 0]) / (block**2).sum(-1)
        chi = np.arcsin((self.height - self.lever * np.sin(psi)) / self.rod)
        chi_1 = -self.lever * np.cos(psi) * psi_1 / (self.rod * np.cos(chi))
        return block, block_1, psi + zero, psi_1, chi, chi_1

    def places(self, phi: FloatArray) -> FloatArray:
        """Return (..., 5, 3): places and angles of crank, block, lever, rod and ram."""
        block, _, psi, _, chi, _ = self._angles(phi)
        zero, c, s, cos, sin = 0 * phi, np.cos(psi), np.sin(psi), np.cos(chi), np.sin(chi)
        x, y = self.lever * c, self.lever * s
        return np.stack(
            [
                np.stack([zero, zero + self.pivot, phi], -1),
                np.stack([block[..., 0], block[..., 1], psi], -1),
                np.stack([x / 2, y / 2, psi], -1),
                np.stack([x + self.rod / 2 * cos, y + self.rod / 2 * sin, chi], -1),
                np.stack([x + self.rod * cos, zero + self.height, zero], -1),
            ],
            -2,
        )

    def changes(self, phi: FloatArray) -> FloatArray:
        """Return their derivatives by phi."""
        _, block_1, psi, psi_1, chi, chi_1 = self._angles(phi)
        zero, x, y = 0 * phi, -self.lever * np.sin(psi) * psi_1, self.lever * np.cos(psi) * psi_1
        a, b = -self.rod * np.sin(chi) * chi_1, self.rod * np.cos(chi) * chi_1
        return np.stack(
            [
                np.stack([zero, zero, zero + 1], -1),
                np.stack([block_1[..., 0], block_1[..., 1], psi_1], -1),
                np.stack([x / 2, y / 2, psi_1], -1),
                np.stack([x + a / 2, y + b / 2, chi_1], -1),
                np.stack([x + a, zero, zero], -1),
            ],
            -2,
        )


CASES: dict[str, ScotchYoke | QuickReturn] = {"Scotch yoke": ScotchYoke(), "quick return": QuickReturn()}


def turned(case: ScotchYoke | QuickReturn) -> FloatArray:
    """Return the crank's angle at eleven times: it turns forwards, as fast as the energy lets it."""
    weights = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in case.mechanism.bodies])

    def inertia(phi: FloatArray) -> FloatArray:
        return np.asarray((weights * case.changes(phi) ** 2).sum((-1, -2)))

    def potential(phi: FloatArray) -> FloatArray:
        return np.asarray(GRAVITY * (weights[:, 0] * case.places(phi)[..., 1]).sum(-1))

    start, times = np.array([case.start]), np.linspace(0.0, case.end, 11)
    energy = inertia(start) * case.rate**2 / 2 + potential(start)

    def rate(_: float, phi: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(2 * (energy - potential(phi)) / inertia(phi)))

    found = solve_ivp(rate, (0.0, case.end), start, "DOP853", times, rtol=1e-13, atol=1e-13)
    return np.asarray(found.y[0])


def errors(case: ScotchYoke | QuickReturn, counts: list[int], stabilisation: str = "none") -> list[float]:
    """Return the largest error of all places and angles with so many steps in each of ten samples."""
    exact, start = case.places(turned(case)), np.array(case.start)
    q, v = case.places(start).ravel(), (case.changes(start) * case.rate).ravel()
    found = []
    for count in counts:
        run = solve(
            case.mechanism,
            q,
            v,
            end_time_s=case.end,
            samples=10,
            step=case.end / 10 / count,
            stabilisation=VARIANTS[stabilisation],
        )
        found.append(float(np.abs(run.q.reshape(exact.shape) - exact).max()))
    return found


@pytest.mark.parametrize("name", CASES)
def test_slots_on_moving_bodies_converge_at_order_four(name: str) -> None:
    counts = [40, 80, 160]
    found = errors(CASES[name], counts)
    order = slope([1 / count for count in counts], found)
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from errors {found}"


@pytest.mark.parametrize("stabilisation", ["projection", "baumgarte"])
def test_slots_hold_with_stabilisation(stabilisation: str) -> None:
    for name, case in CASES.items():
        (error,) = errors(case, [400], stabilisation)
        assert error < 1e-8, f"{name}: {error:.1e} m or rad"

"""Truths of mechanisms that have no closed form: they are right, or refused with the time of a fold."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.scene.library import SCENES
from studies.judges.converged_truth import REFERENCE, converged, followed, truth_by
from tests.helpers.crank_sliders import pendulum, short_rod

#: What is within this of a closed form is right: DOP853 at 1e-13, over ten turns.
RIGHT = 1e-11
SAMPLES = 40


def test_an_ideal_pendulum_swings_by_the_elliptic_integral() -> None:
    """With k = sin(a/2) and w^2 = m g s/J: sin(psi/2) = k cd(w t, k) from rest at a, hanging being 0."""
    scene = pendulum()
    truth, _ = converged(scene, SAMPLES)
    rate = np.sqrt(1.2 * 9.81 * 0.3 / (0.02 + 1.2 * 0.3**2))
    k = np.sin((0.5 + np.pi / 2) / 2)
    sn, *_ = ellipj(ellipk(k * k) - rate * truth.time_s, k * k)
    expected = 2 * np.arcsin(k * sn) - np.pi / 2
    off = np.abs(truth.position[:, 0, 2] - expected).max()
    assert off < RIGHT, f"{off:.1e} rad"
    assert followed(scene, SAMPLES) == SAMPLES + 1
    assert truth_by(scene, SAMPLES) == REFERENCE


def test_a_rod_shorter_than_the_crank_turns_over_as_in_its_own_angle() -> None:
    """Lagrange's equation in the rod's angle phi, by hand: the crank follows as asin(-L/r sin(phi))."""
    scene = short_rod()
    truth, _ = converged(scene, SAMPLES)
    assert scene.rod is not None
    r, length, s, d = 0.3, 0.2, 0.15, 0.1
    masses = np.array([[1.0, 1.0, 0.0075], [0.6, 0.6, 0.002], [0.5, 0.5, 0.0]])

    def places(phi: float) -> FloatArray:
        theta = np.arcsin(-length / r * np.sin(phi))
        pin = r * np.exp(1j * theta)
        centres = (s / r * pin, pin + d * np.exp(1j * phi), pin + length * np.exp(1j * phi))
        return np.array(
            [[z.real, z.imag, angle] for z, angle in zip(centres, (theta, phi, 0.0), strict=True)]
        )

    def slopes(phi: float, h: float = 1e-3) -> FloatArray:
        """Sixth-order differences: some 1e-14 off."""
        near, far, farthest = (places(phi + k * h) - places(phi - k * h) for k in (1, 2, 3))
        return np.asarray((45 * near - 9 * far + farthest) / (60 * h))

    def inertia(phi: float) -> float:
        return float(np.sum(masses * slopes(phi) ** 2))

    def right(_: float, y: FloatArray) -> list[float]:
        h = 1e-2
        near, far, farthest = (inertia(y[0] + k * h) - inertia(y[0] - k * h) for k in (1, 2, 3))
        return [y[1], -(45 * near - 9 * far + farthest) / (60 * h) * y[1] ** 2 / (2 * inertia(y[0]))]

    phi_rate = -r / length * 5.0  # sin(phi) = -r/L sin(theta), at theta = 0
    run = solve_ivp(right, (0, 1), [0, phi_rate], "DOP853", truth.time_s, rtol=1e-12, atol=1e-12)
    off = np.abs(truth.position[:, 1, 2] - run.y[0]).max()
    assert np.abs(run.y[0]).max() > np.pi, "the rod does not turn over"
    assert off < 1e-9, f"{off:.1e} rad"


def test_a_free_rod_as_long_as_the_crank_goes_on_through_the_fold() -> None:
    """Its angle is minus the crank's, which has no kink: x = 2 r cos(theta)."""
    scene = SCENES["ideal-free"]().replace({"rod.length_m": 0.05, "end_time_s": 0.1})
    truth, _ = converged(scene, SAMPLES)
    theta = truth.position[:, 0, 2]
    assert theta[-1] > np.pi / 2, "no fold was passed"
    np.testing.assert_allclose(truth.position[:, -1, 0], 0.1 * np.cos(theta), atol=RIGHT)


def test_where_a_driven_rod_as_long_as_the_crank_folds_there_is_no_truth() -> None:
    scene = SCENES["ideal-driven"]().replace("rod.length_m", 0.05)
    with pytest.raises(SimulationFailed, match=r"from t = 0\.00[0-9]+ s .* singular configuration"):
        converged(scene, SAMPLES)


def test_before_the_fold_there_is_one() -> None:
    scene = SCENES["ideal-driven"]().replace({"rod.length_m": 0.05, "end_time_s": 0.002})
    truth, _ = converged(scene, SAMPLES)
    theta = truth.position[:, 0, 2]
    np.testing.assert_allclose(truth.position[:, -1, 0], 0.1 * np.cos(theta), atol=RIGHT)

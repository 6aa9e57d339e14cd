"""The observed order: what it is fitted to, and when none is claimed."""

import numpy as np
import pytest

from studies.judges.convergence import ABOVE_FLOOR, observed_order

STEPS = tuple(1e-3 / 2.0**k for k in range(8))


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_clean_power_law_gives_its_order_exactly_from_the_finest_four(order: int) -> None:
    errors = [3.0 * h**order for h in STEPS]
    found = observed_order(STEPS, errors)
    assert found.slope == pytest.approx(order, abs=1e-9)
    assert found.steps == STEPS[-4:]
    assert observed_order(STEPS[::-1], errors[::-1]) == found, "whatever the order of the points"


def test_no_order_is_claimed_of_errors_as_large_as_a_tenth_of_the_signal() -> None:
    errors = [3.0 * h for h in STEPS]
    assert observed_order(STEPS, errors, 0.0, scale=10 * errors[-1] * 0.99).verdict == "astray"
    assert observed_order(STEPS, errors, 0.0, scale=10 * errors[-2] * 1.01).verdict == "too few points"
    finest = observed_order(STEPS, errors, 0.0, scale=10 * errors[-3] * 1.01)
    assert finest.slope == pytest.approx(1.0)
    assert finest.steps == STEPS[-3:]


@pytest.mark.parametrize("order", [1, 2, 4])
def test_points_near_the_truths_uncertainty_are_left_out(order: int) -> None:
    floor = STEPS[4] ** order  # met at the fifth step
    noise = np.random.default_rng(1).uniform(-1, 1, len(STEPS))
    errors = [abs(h**order + floor * part) for h, part in zip(STEPS, noise, strict=True)]
    found = observed_order(STEPS, errors, floor)
    used = dict(zip(STEPS, errors, strict=True))
    assert all(used[h] >= ABOVE_FLOOR * floor for h in found.steps)
    few = found.verdict == "too few points" and order < 4
    assert few or found.slope == pytest.approx(order, abs=0.15)


def test_an_engines_own_flat_floor_is_left_out_without_being_told_it() -> None:
    noise = 1 + 0.5 * np.random.default_rng(2).uniform(-1, 1, len(STEPS))
    floor = STEPS[4] ** 4
    found = observed_order(STEPS, [h**4 + floor * part for h, part in zip(STEPS, noise, strict=True)])
    assert found.slope == pytest.approx(4, abs=0.1)
    assert min(found.steps) > STEPS[4]
    begun = observed_order(STEPS, [h**4 + 0.5 * STEPS[-1] ** 4 * 4 for h in STEPS])
    assert begun.slope == pytest.approx(4, abs=0.1)
    assert STEPS[-1] not in begun.steps, "a finest point that only begins to feel it"


@pytest.mark.parametrize(
    ("errors", "floor", "verdict"),
    [
        ([3e-16, 1e-16, 2e-16, 1e-16], 1e-16, "round-off"),
        ([2e-12, 1.9e-12, 2.1e-12, 2e-12], 1e-16, "flat"),
        ([], 0.0, "too few points"),
        ([1e-2, 1e-4, 1e-6, 1e-6], 0.0, "too few points"),
        ([1.0, 0.6, 0.2, 0.02], 0.0, "irregular"),
        ([1.0, 0.5**4, 0.5**5], 0.0, "too few points"),  # of three the last one bends
        ([1.0, 1.0, 0.5**0.9], 0.0, "too few points"),  # two fall, but little
        ([1.0, 1.0, 0.5**0.4], 0.0, "flat"),
    ],
)
def test_no_order_is_claimed_without_a_straight_line(errors: list[float], floor: float, verdict: str) -> None:
    found = observed_order(STEPS[: len(errors)], errors, floor)
    assert (found.verdict, found.slope) == (verdict, None)
    assert str(found) == verdict


@pytest.mark.parametrize(
    ("exponents", "scale", "slope", "points"),
    [
        ((0, 0, 4, 8), np.inf, 4.0, (1, 2, 3)),  # behind a saturated step, from the first that falls
        ((0, 4, 8), 10.0, 4.0, (0, 1, 2)),  # a tenth of the signal is not yet astray
        ((0, 8, 16, 24, 29), np.inf, 8.0, (0, 1, 2, 3)),  # without the one that bends, and no other
    ],
)
def test_the_points_of_an_order(
    exponents: tuple[int, ...], scale: float, slope: float, points: tuple[int, ...]
) -> None:
    """Steps halve, and errors are these powers of a half: their differences are local orders."""
    steps = [0.5**k for k in range(len(exponents))]
    order = observed_order(steps, [0.5**k for k in exponents], scale=scale)
    assert order.slope == pytest.approx(slope, abs=1e-9)
    assert order.steps == tuple(steps[k] for k in points)
    of_two = observed_order((1.0, 0.5, 0.5, 0.25), (1.0, 0.9, 0.5**4, 0.5**8))
    assert of_two.slope == pytest.approx(4.0), "of two runs at one step the better counts"
    of_ten = observed_order([1.0, 0.5, 0.25], [160.0, 40.0, 10.0], 1.0)
    assert of_ten.slope == pytest.approx(2.0, abs=1e-9), "an error of ten uncertainties counts"

"""Slopes with their intervals, and exponents of time, on curves that are known."""

import numpy as np
import pytest

from studies.judges.energy_rates import blocks_of, drift_rate, growth_exponent

TIME = np.linspace(0.0, 2.0, 401)
SLOPE = 0.7
#: Trials of a coverage test, and the least coverage of a 95 % interval that chance leaves: 4 standard errors.
TRIALS, COVERED = 200, 0.95 - 4 * float(np.sqrt(0.95 * 0.05 / 200))


@pytest.mark.parametrize("walks", [False, True])
def test_the_interval_holds_the_true_slope_as_often_as_it_says(walks: bool) -> None:
    random, held = np.random.default_rng(4), 0
    for _ in range(TRIALS):
        noise = random.normal(size=len(TIME))
        drift = drift_rate(TIME, SLOPE * TIME + (np.cumsum(noise) if walks else noise), blocks=20)
        held += drift.low_per_s <= SLOPE <= drift.high_per_s
    assert held / TRIALS >= COVERED


def test_a_line_is_found_exactly_and_a_swing_of_whole_periods_changes_nothing() -> None:
    swing = 5 * np.sin(2 * np.pi * 10 * TIME)
    drift = drift_rate(TIME, -SLOPE * TIME + swing, blocks=20)
    assert drift.per_s == pytest.approx(-SLOPE, rel=1e-12)
    assert drift.high_per_s - drift.low_per_s < 1e-12
    assert drift.high_per_s < 0
    assert abs(drift_rate(TIME, swing, blocks=20).per_s) < 1e-12
    one_off = SLOPE * TIME + 100.0 * ((TIME > 1.8) & (TIME <= 1.9))
    assert drift_rate(TIME, one_off, blocks=20).per_s == pytest.approx(SLOPE, rel=1e-9), "one block is off"


def test_an_interval_of_a_drift_is_students_of_five_parts() -> None:
    """Slopes 1 to 5 by parts: their standard deviation is sqrt(5/2), and t is 2.776 for four of five."""
    time = np.linspace(0.0, 1.0, 1001)
    parts = np.minimum((time * 5 - 1e-9).astype(int), 4)
    value = np.cumsum(np.diff(time, prepend=0.0) * (1.0 + parts))
    half = 2.7764451 * np.sqrt(5 / 2) / np.sqrt(5)
    found = drift_rate(time, value, blocks=10)
    assert (found.high_per_s - found.low_per_s) / 2 == pytest.approx(half, rel=1e-6)


@pytest.mark.parametrize(
    ("periods", "blocks"),
    [(0.5, 10), (7, 10), (9, 10), (12, 10), (99, 95), (100, 100), (132.6, 65), (250, 80), (1000, 100)],
)
def test_there_are_as_many_blocks_of_whole_periods_as_say_something_new(periods: float, blocks: int) -> None:
    """Of 132 periods two go into a block, of 250 three; what does not fill five parts alike is left over."""
    assert blocks_of(periods) == blocks


@pytest.mark.parametrize(
    ("time_s", "value", "power"),
    [
        ([0, 1, 2], [0, 1, 2], 1),
        ([0, 1, 2, 4], [0, 0, 1, 2], 1),  # zeros have no logarithm
        ([0, 1, 2, 4], [0, 0, 0, 1], 0),  # of one point there is no power
        ([0, 1, 2, 4], [0, 0, 0, 0], 0),
        ([0, 1.97, 10, 20, 40], [0, 1, 5, 5, 5], 0),  # what was before 2 s does not count
        ([0, 10, 20, 40], [0, 1, 1, 4], 1),  # the last sample does: 0, 0 and 2 octaves, one after the other
    ],
)
def test_powers_of_a_few_samples_are_those_worked_out(
    time_s: list[float], value: list[float], power: float
) -> None:
    found = growth_exponent(np.array(time_s, dtype=float), np.array(value, dtype=float))
    assert found == pytest.approx(power, abs=1e-12)

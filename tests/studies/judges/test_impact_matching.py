"""Impacts of two runs are paired one to one, and what has no partner is counted."""

import numpy as np
import pytest

from engine_models.engine import Contact, Impacts
from studies.judges.impact_matching import force_error_in_phase_N, impact_errors, match

TRUE = np.array([1.0, 2.0, 3.0, 3.1])


def impacts(times: np.ndarray, impulse: float | np.ndarray = 1.0, loss: float = 0.5) -> Impacts:
    ones = np.ones(len(times))
    return Impacts(times, 0 * ones, ones, impulse * ones, loss * ones, *[np.nan * ones] * 4)


@pytest.mark.parametrize(
    ("run", "true", "end_s", "matched", "unmatched", "missed"),
    [
        (TRUE + 1e-3, TRUE, 4.0, [0, 1, 2, 3], 0, 0),
        ([1.0, 1.5, 2.0, 3.0, 3.1], TRUE, 4.0, [0, 1, 2, 3], 1, 0),
        ([1.0, 3.0, 3.1], TRUE, 4.0, [0, 2, 3], 0, 1),
        ([1.0, 2.0, 3.02], TRUE, 4.0, [0, 1, 2], 0, 1),  # two that merged
        ([1.3], [1.0, 2.0], 3.0, [], 1, 2),
        ([1.25], [1.0, 2.0], 3.0, [0], 0, 1),  # a quarter of a flight is none too much
        (TRUE, TRUE, 2.5, [0, 1], 0, 0),
        (TRUE, TRUE, 3.0, [0, 1, 2], 0, 0),  # at the end
        ([], TRUE, 4.0, [], 0, 4),
        # Flights of 0.1 s and of 3.9 s: 0.1 s late is another impact, 0.02 s the same.
        ([1.0, 1.2, 5.0], [1.0, 1.1, 5.0], 6.0, [0, 2], 1, 1),
        ([1.0, 1.12, 5.0], [1.0, 1.1, 5.0], 6.0, [0, 1, 2], 0, 0),
    ],
)
def test_impacts_are_matched_within_a_quarter_of_the_shorter_flight_beside_them(
    run: list[float], true: list[float], end_s: float, matched: list[int], unmatched: int, missed: int
) -> None:
    pairs = match(np.array(run), np.array(true), end_s)
    assert (pairs.true.tolist(), pairs.unmatched, pairs.missed) == (matched, unmatched, missed)
    assert len(pairs.run) == len(matched)


@pytest.mark.parametrize("column", ["speed", "impulse", "loss", "force", "penetration", "duration"])
def test_an_error_is_the_largest_part_of_the_same_impact(column: str) -> None:
    """Off by 0.4 of 2, and by 0.5 of the largest, 4; the largest time error is another impact's."""
    place = ("speed", "impulse", "loss", "force", "penetration", "duration").index(column)
    size, off_s = np.array([1.0, 2.0, 4.0, 3.0]), np.array([1e-3, 3e-3, 0.0, 2e-3])

    def having(times: np.ndarray, off: list[float]) -> Impacts:
        of = [size] * 6
        of[place] = size + off
        speed, impulse, loss, force, depth, lasts = of
        return Impacts(times, lasts, speed, impulse, loss, force, times, depth, times)

    row = impact_errors(having(TRUE + off_s, [0.0, 0.4, 0.5, 0.0]), having(TRUE, [0.0] * 4), 4.0)
    parts = {name: value for name, value in row.items() if "relative" in name and value}
    assert parts == {f"impact_{column}_relative_error": pytest.approx(0.2)}
    assert row["impact_time_error_s"] == pytest.approx(3e-3)


def test_an_impact_of_next_to_no_impulse_is_counted_and_not_rated() -> None:
    impulse = np.array([1.0, 1.01e-3, 0.99e-3, 1.0])
    row = impact_errors(impacts(TRUE, impulse * [1, 1.1, 2, 1]), impacts(TRUE, impulse), 4.0)
    assert (row["impacts_matched"], row["impacts_not_rated"]) == (4, 1)
    assert row["impact_impulse_relative_error"] == pytest.approx(0.1)


def bumps(touches: list[float], lasts: list[float], peaks: list[float], time: np.ndarray) -> Contact:
    """Half sines of force, at times (n,), whose penetration is a thousandth of it."""
    force = np.zeros(len(time))
    for touch, last, high in zip(touches, lasts, peaks, strict=True):
        part = (time - touch) / last
        force += np.where((part > 0) & (part < 1), high * np.sin(np.pi * part), 0.0)
    at, lasting, peak = np.array(touches), np.array(lasts), np.array(peaks)
    middle = at + lasting / 2
    told = Impacts(at, lasting, at**0, at**0, at**0, peak, middle, peak / 1e3, middle)
    zero = np.zeros(len(time))
    return Contact(np.zeros((len(time), 2)), force / 1e3, force, None, zero, zero, zero, None, None, told)


TIME = np.linspace(0.0, 4.0, 4001)
LASTS, PEAKS = [0.1, 0.2, 0.1], [100.0, 40.0, 60.0]


def test_forces_that_are_late_are_the_same_at_equal_parts_of_an_impact_and_stronger_ones_are_not() -> None:
    """3 % more in the second, and 10 ms late: at a flank of 100 N in 0.1 s that is 31 N."""
    true = bumps([1.0, 2.0, 3.0], LASTS, PEAKS, TIME)
    late = bumps([1.01, 2.01, 3.01], LASTS, PEAKS, TIME)
    assert np.abs(late.normal_force_N - true.normal_force_N).max() == pytest.approx(31.2, rel=0.01)
    assert force_error_in_phase_N(late, true, TIME, 4.0) == pytest.approx(0.0, abs=1e-3)
    assert "impact_force_error_N" in (row := impact_errors(late.impacts, true.impacts, 4.0))
    assert row["impact_force_error_N"] == row["impact_force_relative_error"] == 0.0
    more = bumps([0.5, 1.01, 2.01, 3.01], [0.1, *LASTS], [5.0, *PEAKS], TIME)
    assert force_error_in_phase_N(more, true, TIME, 4.0) == pytest.approx(0.0, abs=1e-3), "pairs alone"
    strong = bumps([1.01, 2.01, 3.01], LASTS, [100.0, 41.2, 60.0], TIME)
    assert force_error_in_phase_N(strong, true, TIME, 4.0) == pytest.approx(1.2, rel=1e-3)
    row = impact_errors(strong.impacts, true.impacts, 4.0)
    assert row["impact_force_error_N"] == pytest.approx(1.2)
    assert row["impact_force_relative_error"] == pytest.approx(0.03)
    assert row["impact_penetration_relative_error"] == pytest.approx(0.03)
    row = impact_errors(bumps([1.0, 2.0], LASTS[:2], PEAKS[:2], TIME).impacts, true.impacts, 4.0)
    missed = [row[f"impact{of}"] for of in ("s_missed", "_force_relative_error", "_force_error_N")]
    assert missed == [1, 1.0, 0.0], "an impact that is missed is off by all of its force"


def test_impacts_on_rigid_walls_have_no_forces_to_be_off() -> None:
    row = impact_errors(impacts(TRUE), impacts(TRUE), 4.0)
    assert not any("force" in name or "penetration" in name or "duration" in name for name in row)

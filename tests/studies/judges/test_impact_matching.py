"""Impacts of two runs are paired one to one, and what has no partner is counted."""

import numpy as np
import pytest

from engine_models.engine import Impacts
from studies.judges.impact_matching import impact_errors, match

TRUE = np.array([1.0, 2.0, 3.0, 3.1])


def impacts(times: np.ndarray, impulse: float | np.ndarray = 1.0, loss: float = 0.5) -> Impacts:
    ones = np.ones(len(times))
    return Impacts(times, 0 * ones, ones, impulse * ones, loss * ones)


def test_shifted_impacts_are_all_matched() -> None:
    pairs = match(TRUE + 1e-3, TRUE, 4.0)
    assert pairs.run.tolist() == pairs.true.tolist() == [0, 1, 2, 3]
    assert (pairs.unmatched, pairs.missed) == (0, 0)


def test_one_too_many_is_unmatched_and_one_too_few_is_missed() -> None:
    extra = match(np.sort(np.append(TRUE, 1.5)), TRUE, 4.0)
    assert (len(extra.true), extra.unmatched, extra.missed) == (4, 1, 0)
    fewer = match(TRUE[[0, 2, 3]], TRUE, 4.0)
    assert fewer.true.tolist() == [0, 2, 3]
    assert (fewer.unmatched, fewer.missed) == (0, 1)


def test_two_impacts_that_merged_are_one_match_and_one_missed() -> None:
    merged = match(np.array([1.0, 2.0, 3.02]), TRUE, 4.0)
    assert merged.true.tolist() == [0, 1, 2]
    assert merged.missed == 1


def test_impacts_a_quarter_flight_apart_are_not_the_same() -> None:
    off = match(np.array([1.3]), np.array([1.0, 2.0]), 3.0)
    assert (len(off.true), off.unmatched, off.missed) == (0, 1, 2)
    assert match(np.array([1.25]), np.array([1.0, 2.0]), 3.0).true.tolist() == [0], (
        "a quarter is none too much"
    )


def test_nothing_counts_after_the_end_and_nothing_is_matched_with_nothing() -> None:
    assert match(TRUE, TRUE, 2.5).true.tolist() == [0, 1]
    at_the_end = match(TRUE, TRUE, 3.0)
    assert (at_the_end.true.tolist(), at_the_end.unmatched, at_the_end.missed) == ([0, 1, 2], 0, 0)
    none = match(np.zeros(0), TRUE, 4.0)
    assert (none.run.tolist(), none.true.tolist(), none.unmatched, none.missed) == ([], [], 0, 4)


def test_errors_are_those_of_the_matched_pairs_relative_to_the_largest() -> None:
    row = impact_errors(impacts(TRUE + 1e-3, 1.02), impacts(TRUE), 4.0)
    assert row["impact_time_error_s"] == pytest.approx(1e-3)
    assert row["impact_impulse_relative_error"] == pytest.approx(0.02)
    assert row["impact_speed_relative_error"] == 0
    assert row["impacts_matched"] == 4


def test_of_errors_of_many_sizes_the_largest_is_told_in_parts_of_the_largest_truth() -> None:
    off_s, impulse = np.array([1e-3, 3e-3, 0.0, 2e-3]), np.array([1.0, 2.0, 4.0, 3.0])
    run = impacts(TRUE + off_s, impulse + np.array([0.0, 0.4, 0.2, 0.0]))
    row = impact_errors(run, impacts(TRUE, impulse), 4.0)
    assert row["impact_time_error_s"] == pytest.approx(3e-3)
    assert row["impact_impulse_relative_error"] == pytest.approx(0.1)


def test_where_nothing_is_lost_no_part_of_it_is_off() -> None:
    row = impact_errors(impacts(TRUE, loss=1e-9), impacts(TRUE, loss=0.0), 4.0)
    assert "impact_loss_relative_error" not in row


def test_the_shorter_flight_beside_an_impact_decides_how_far_off_it_may_be() -> None:
    """A flight of 0.1 s and one of 3.9 s: 0.1 s late is another impact, 0.02 s the same."""
    true = np.array([1.0, 1.1, 5.0])
    late = match(np.array([1.0, 1.2, 5.0]), true, 6.0)
    assert (len(late.run), late.unmatched, late.missed) == (2, 1, 1)
    same = match(np.array([1.0, 1.12, 5.0]), true, 6.0)
    assert (len(same.run), same.unmatched, same.missed) == (3, 0, 0)

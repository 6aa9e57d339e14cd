"""Impacts of two runs are paired one to one, and what has no partner is counted."""

import numpy as np
import pytest

from engine_models.engine import Impacts
from studies.judges.impact_matching import impact_errors, match

TRUE = np.array([1.0, 2.0, 3.0, 3.1])


def impacts(times: np.ndarray, impulse: float = 1.0) -> Impacts:
    ones = np.ones(len(times))
    return Impacts(times, 0 * ones, ones, impulse * ones, 0.5 * ones)


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


def test_nothing_counts_after_the_end_and_nothing_is_matched_with_nothing() -> None:
    assert match(TRUE, TRUE, 2.5).true.tolist() == [0, 1]
    none = match(np.zeros(0), TRUE, 4.0)
    assert (none.unmatched, none.missed) == (0, 4)


def test_errors_are_those_of_the_matched_pairs_relative_to_the_largest() -> None:
    row = impact_errors(impacts(TRUE + 1e-3, 1.02), impacts(TRUE), 4.0)
    assert row["impact_time_error_s"] == pytest.approx(1e-3)
    assert row["impact_impulse_relative_error"] == pytest.approx(0.02)
    assert row["impact_speed_relative_error"] == 0
    assert row["impacts_matched"] == 4


def test_the_shorter_flight_beside_an_impact_decides_how_far_off_it_may_be() -> None:
    """A flight of 0.1 s and one of 3.9 s: 0.1 s late is another impact, 0.02 s the same."""
    true = np.array([1.0, 1.1, 5.0])
    late = match(np.array([1.0, 1.2, 5.0]), true, 6.0)
    assert (len(late.run), late.unmatched, late.missed) == (2, 1, 1)
    same = match(np.array([1.0, 1.12, 5.0]), true, 6.0)
    assert (len(same.run), same.unmatched, same.missed) == (3, 0, 0)

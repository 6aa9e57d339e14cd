"""Work-precision's rounds: each times every rung, in an order of its own that comes out again."""

from itertools import count

import pytest

from studies.work_precision import study as work_precision


def test_every_round_times_the_same_rungs_in_an_order_of_its_own() -> None:
    rounds: dict[object, list[str]] = {}
    for case in work_precision.cases(full=False):
        if "round" in case.columns:
            columns = {name: value for name, value in case.head().items() if name != "round"}
            rounds.setdefault(case.columns["round"], []).append(str(columns))
    assert len(rounds) == work_precision.ROUNDS
    first, *others = rounds.values()
    assert all(set(order) == set(first) for order in others)
    assert len({tuple(order) for order in rounds.values()}) == len(rounds)


def test_the_order_of_cases_comes_out_again() -> None:
    one, again = ([case.key("") for case in work_precision.cases(full=False)] for _ in range(2))
    assert one == again


def test_what_the_first_run_of_a_process_loads_is_in_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine whose first run is slow, timed where there is time for one run only."""
    runs = count()

    class Loading:
        def bare_solve_time_s(self, *_: object) -> float:
            return 1.0 if next(runs) else 9.0

    engine = Loading()
    monkeypatch.setattr(work_precision, "make_engine", lambda *_, **__: engine)
    monkeypatch.setattr(work_precision, "REPEAT_S", 0.0)
    timed = next(case for case in work_precision.cases(full=False) if "round" in case.columns)
    for _ in range(2):
        row, _ = work_precision.measure(timed)
        assert (row["solve_time_s"], row["repeats"]) == (1.0, 1)
    assert next(runs) == 3, "loaded once"

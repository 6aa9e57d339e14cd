"""Published rows come out of this code again: of every study some that are drawn by lot, others each time."""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from reports.results import published_rows, read_study
from studies.case import LIMIT_S, Case, Row, load_study, run_case
from studies.registry import STUDIES
from studies.workers import Pool

RESULTS = Path(__file__).parents[2] / "reports/published/results"
#: Rows drawn of each study; the commit that they were made from is the seed.
DRAWN = 4
#: Processors and versions give errors of smooth motion to this part of them, and past impacts within this
#: factor (of the baselines' numbers there one in twenty moves by more than a half); in both to so many
#: uncertainties of the truth, which are round-off. What is chaotic they may give otherwise. They move SciPy's
#: implicit methods and those of variable order further: a third to a half of their baselines on smooth motion
#: by more than SMOOTH, one by fourteen times itself. An error past impacts above this part of the signal's
#: own swing tells on which side of an impact a sample fell.
SMOOTH, PAST_IMPACTS, UNCERTAINTIES, SCIPY, SWING = 1e-2, 3.0, 100, 15.0, 0.1
CHAOTIC = ("predictability", "stability", "extremes")


def draw(study: str) -> list[tuple[str, Case]]:
    """Return finished cases of a study, with the seed that drew them."""
    seed = f"{study} {read_study(RESULTS, study).facts['commit']}"
    heads = [row for row in published_rows(RESULTS, study) if row["status"] == "ok"]
    cases = [case for case in load_study(study).cases(full=False) if not case.timed]
    mixed = random.Random(seed).sample(cases, len(cases))
    finished = (case for case in mixed if any(_head(case).items() <= row.items() for row in heads))
    return [(seed, next(finished)) for _ in range(DRAWN)]


@pytest.fixture(scope="module")
def processes() -> Iterator[dict[bool, Pool]]:
    """Processes of their own, one for each of Exudyn's two builds, which cannot run beside each other."""
    with Pool(1) as checked, Pool(1) as fast:
        yield {False: checked, True: fast}


@pytest.mark.accuracy
@pytest.mark.parametrize("study", [study for study in STUDIES if study != "cost"])  # which has times alone
def test_rows_drawn_by_lot_come_out_again(study: str, processes: dict[bool, Pool]) -> None:
    for seed, case in draw(study):
        (before,) = (
            row
            for row in published_rows(RESULTS, study)
            if _head(case).items() <= row.items() and row.get("timed") == case.head().get("timed")
        )
        build = bool(case.settings.get("fast"))
        after, _ = processes[build].run(run_case, case, limit_s=LIMIT_S)
        assert after["status"] == before["status"]
        where = f"{case.arm.label} on {case.scene.name}, drawn by '{seed}'"
        for name in (name for name in after if "_error_" in name and study not in CHAOTIC):
            value, known = _number(after, name), _number(before, name)
            slack = UNCERTAINTIES * _number(after, name.replace("_error_", "_uncertainty_"))
            loose = bool(case.scene.joints_with_clearance)
            part = SCIPY - 1 if case.engine == "scipy" else PAST_IMPACTS - 1 if loose else SMOOTH
            swing = _number(before, name.replace("_error_", "_scale_"))
            if loose and swing and max(value, known) > SWING * swing:
                continue
            assert abs(value - known) <= part * min(value, known) + slack, (
                f"{name} of {where}: {value}, {known}"
            )


def _head(case: Case) -> Row:
    return {name: value for name, value in case.head().items() if value is not None}


def _number(row: Row, name: str) -> float:
    value = row.get(name)
    return float(value) if isinstance(value, int | float) else 0.0

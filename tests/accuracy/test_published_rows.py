"""Published rows come out of this code again: of every study some that are drawn by lot."""

from itertools import islice
from pathlib import Path
from random import Random

import pytest

from reports.results import published_rows, read_study
from studies.case import STUDIES, Case, Row, load_study, run_case

RESULTS = Path(__file__).parents[2] / "reports/published/results"
#: Rows drawn of each study; the commit that they were made from is the seed.
DRAWN = 4
#: Other processors and versions give errors of smooth motion to this part of them, past impacts and by SciPy
#: within a factor, and to so many uncertainties of the truth, which are round-off. Errors past impacts above
#: this part of the signal's own swing tell on which side of one a sample fell.
SMOOTH, FACTORS, UNCERTAINTIES, SWING = 1e-2, {"scipy": 15.0}, 100, 0.1
PAST_IMPACTS, CHAOTIC = 3.0, ("predictability", "stability", "extremes")


def head(case: Case) -> Row:
    return {name: value for name, value in case.head().items() if value is not None}


def drawn(study: str) -> list[tuple[Case, Row]]:
    """Return finished cases of a study, each with its published row."""
    random = Random(f"{study} {read_study(RESULTS, study).facts['commit']}")
    rows = [row for row in published_rows(RESULTS, study) if row["status"] == "ok" and not row.get("timed")]
    cases = [case for case in load_study(study).cases(full=False) if not case.timed]
    mixed = random.sample(cases, len(cases))
    pairs = ((case, row) for case in mixed for row in rows if head(case).items() <= row.items())
    return list(islice(pairs, DRAWN))


def number(row: Row, name: str) -> float:
    value = row.get(name)
    return float(value) if isinstance(value, int | float) else 0.0


@pytest.mark.accuracy
@pytest.mark.parametrize("study", [study for study in STUDIES if study != "cost"])  # which has times alone
def test_rows_drawn_by_lot_come_out_again(study: str) -> None:
    for case, before in drawn(study):
        after, _ = run_case(case)
        assert after["status"] == before["status"]
        loose = bool(case.scene.clearances)
        part = FACTORS.get(case.engine, PAST_IMPACTS if loose else 1 + SMOOTH) - 1
        for name in (name for name in after if "_error_" in name and study not in CHAOTIC):
            value, known = number(after, name), number(before, name)
            slack = UNCERTAINTIES * number(after, name.replace("_error_", "_uncertainty_"))
            swing = number(before, name.replace("_error_", "_scale_"))
            if not (loose and swing and max(value, known) > SWING * swing):
                where = f"{name} of {case.arm.label} on {case.scene.name}: {value}, {known}"
                assert abs(value - known) <= part * min(value, known) + slack, where

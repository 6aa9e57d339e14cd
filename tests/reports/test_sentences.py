"""Findings of the report: each follows from the rows, so that other rows change it, and they are few."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, partial
from itertools import chain
from pathlib import Path

import pandas as pd
import pytest

from reports.chapters import answer
from reports.page.contents import CHAPTERS
from reports.parts import Chapter, Contradiction, Finding, Studies
from reports.results import Results, read_study

PUBLISHED = Path(__file__).parents[2] / "reports/published/results"
#: What a chapter, and the page, may have at most.
MOST_FINDINGS, MOST_CLAIMS = 5, 35
#: Findings that say what is not asked, and on which processor, whatever the rows.
FIXED = {"model", "timing"}

Change = Callable[[pd.DataFrame], pd.DataFrame]


def scaled(pattern: str, factor: Callable[[pd.DataFrame], "pd.Series[float]"]) -> Change:
    """Return the change of the columns whose names match by a factor for each row."""
    return lambda rows: rows.assign(**rows.filter(regex=pattern).mul(factor(rows), axis=0))


def of_engine(name: str, factor: float) -> Callable[[pd.DataFrame], "pd.Series[float]"]:
    return lambda rows: (rows["engine"] == name).map({True: factor, False: 1.0})


def given(**columns: object) -> Change:
    """Return the change of columns that are there to one value."""
    return lambda rows: rows.assign(**{name: value for name, value in columns.items() if name in rows})


#: What rows may be instead: other orders, other winners in error and in time, other impacts, laws, failures.
CHANGES: dict[str, Change] = {
    "every error is of order three": lambda rows: rows.assign(
        **dict.fromkeys(rows.filter(regex="_error_"), rows["mean_step_s"] ** 3)
    ),
    "the reference errs more": scaled("_error(_|$)|violation|residual", of_engine("reference", 1e6)),
    "the others err more": scaled(
        "_error(_|$)|violation|residual", lambda rows: 1e7 / of_engine("reference", 1e7)(rows)
    ),
    "the cross-check is further off": scaled("cross_check", lambda rows: rows["step_s"] * 0 + 1e3),
    "the reference is slow": scaled("^(solve|build)_time_s$", of_engine("reference", 1e4)),
    "what failed finished": given(status="ok", quality_failure=None),
    "a run of each engine fails": lambda rows: rows.assign(
        status=rows["status"].where(rows["engine"].duplicated(), "failed")
    ),
    "Pymunk fails": lambda rows: rows.assign(
        status=rows["status"].mask(rows["engine"] == "pymunk", "failed")
    ),
    "clearances are smaller": scaled("^smallest_clearance_m$", lambda rows: rows["step_s"] * 0 + 1e-3),
    "more energy is unaccounted for": scaled(
        "unaccounted_energy_part$|_power_", lambda rows: 3.0 + of_engine("pymunk", 1e3)(rows)
    ),
    "constraints drift otherwise": scaled("_exponent$|^constraint_", of_engine("reference", 1.5)),
    "motions are known for longer": scaled("^horizon_", lambda rows: rows["step_s"] * 0 + 1.5),
    "impacts are harder": scaled("^impact_speed_m_s$", lambda rows: rows["step_s"] * 0 + 1.3),
    "maps are otherwise": given(verdict_severity=2.0),
}


@cache
def published() -> dict[str, Results]:
    return {path.name: read_study(path) for path in sorted(PUBLISHED.iterdir())}


def changed(change: Change, names: Iterable[str]) -> Studies:
    """Return some of the published studies with other rows."""
    return {
        name: Results(published()[name].folder, change(published()[name].rows), published()[name].sidecar)
        for name in names
    }


def of_chapter(chapter: Chapter, studies: Studies) -> Iterator[Finding]:
    """Yield the findings of a chapter, up to one that the rows contradict."""
    with suppress(Contradiction):
        yield from chapter.findings({name: studies[name] for name in chapter.studies if name in studies})


def of_answer(studies: Studies) -> Iterator[Finding]:
    yield from (each.finding for each in answer.advice(studies))
    yield from answer.limits(studies)


PLACES: dict[str, Callable[[Studies], Iterator[Finding]]] = {
    "answer": of_answer,
    **{chapter.name: partial(of_chapter, chapter) for chapter in CHAPTERS},
}
#: The studies that a place reads.
READS = {"answer": ["work-precision", "energy", "predictability"]} | {
    chapter.name: [*chapter.studies] for chapter in CHAPTERS
}


@pytest.mark.parametrize("place", [name for name in PLACES if name != "method"])
def test_every_finding_changes_with_some_rows_or_contradicts_them(place: str) -> None:
    findings = PLACES[place](published())
    same = {str(finding) for finding in findings if finding.name not in FIXED}
    assert same
    for change in CHANGES.values():
        if same:
            same &= set(map(str, PLACES[place](changed(change, READS[place]))))
    assert not same, "findings that no rows change"


def test_findings_are_few_and_have_names_of_their_own() -> None:
    by_place = {place: list(of(published())) for place, of in PLACES.items()}
    assert all(len(findings) <= MOST_FINDINGS for place, findings in by_place.items() if place != "answer")
    names = [(place, finding.name) for place, findings in by_place.items() for finding in findings]
    assert len(set(names)) == len(names) <= MOST_CLAIMS


def test_a_finding_tells_the_numbers_that_it_keeps() -> None:
    for finding in chain.from_iterable(of(published()) for of in PLACES.values()):
        if not finding.startswith("For "):  # what the table says in its cells
            assert all(str(number) in finding for number in finding.numbers), finding

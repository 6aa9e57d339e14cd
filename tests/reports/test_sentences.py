"""Sentences of the report: each follows from the rows, so that other rows change it, and has few numbers."""

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from types import ModuleType

import pandas as pd
import pytest
from matplotlib.figure import Figure

from reports.chapters import (
    agreement,
    answer,
    clearance,
    energy,
    extremes,
    predictability,
    stability,
    work_precision,
)
from reports.chapters.agreement import findings
from reports.chapters.energy.rungs import at_rungs, middle_rungs, prepared
from reports.chapters.headlines import HEADLINES
from reports.chapters.predictability import data
from reports.chapters.predictability.comparison import verdicts
from reports.chapters.predictability.findings import ensembles
from reports.parts import Contradiction
from reports.quantities import with_largest
from reports.results import Results, read_results, read_study
from reports.shared_tables import failures_section
from studies.extremes.study import gallery

PUBLISHED = Path(__file__).parents[2] / "reports/published/results"
#: In a sentence; more are a table. Those within names, as DOP853 or 0.5mm, are none.
MOST_NUMBERS, NUMBER = 2, re.compile(r"(?<![\w.-])\d+(?:\.\d+)?(?:×10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(?![\w-])")
#: The section on what times leave out says how they are taken, and finds nothing.
METHOD = "work-precision-costs"

Change = Callable[[pd.DataFrame], pd.DataFrame]


def agreement_texts(rows: pd.DataFrame) -> Iterator[str]:
    """Yield the chapter's sentences without its figures, whose curves are not published."""
    position, force = agreement.POSITION, agreement.FORCE
    rows = with_largest(rows, force, r"joint_\w_force_error_N")
    ladder, chosen = (rows[rows["varied"] == what] for what in ("step", "tolerance"))
    at_step = agreement.at_common_steps(ladder)
    yield from findings.orders_found(ladder, (position, force))
    yield from findings.best_at_step(at_step)
    yield from findings.conservation(at_step)
    yield from findings.errors_by_tolerance(chosen, position)
    yield from findings.enough(rows[rows["varied"] == "iterations"], "iterations", position)
    yield from failures_section(rows, agreement.STUDY).text
    yield from findings.pymunk_arms(ladder, position)


def clearance_texts(rows: pd.DataFrame) -> Iterator[str]:
    for section in clearance.sections(Results(PUBLISHED, rows, None)):
        yield from section.text


def work_precision_texts(rows: pd.DataFrame) -> Iterator[str]:
    for section in work_precision.sections(Results(PUBLISHED, rows, None)):
        yield from section.text if section.name != METHOD else ()


def predictability_texts(rows: pd.DataFrame) -> Iterator[str]:
    """Yield the sentences on ensembles."""
    for scene, by_label in data.ensembles(data.prepared(rows)).items():
        yield from ensembles(scene, verdicts(by_label))


def energy_texts(rows: pd.DataFrame) -> Iterator[str]:
    rows = prepared(rows)
    at_middle = at_rungs(rows, middle_rungs(rows))
    yield from energy.hidden_power(at_middle)
    yield from energy.lost_as_it_comes(rows, "ideal-free")
    yield from energy.ledger_closes(at_middle)
    yield from energy.drift(rows)
    yield from failures_section(rows, energy.STUDY).text


CHAPTERS: dict[str, Callable[[pd.DataFrame], Iterator[str]]] = {
    agreement.STUDY: agreement_texts,
    clearance.STUDY: clearance_texts,
    work_precision.STUDY: work_precision_texts,
    predictability.STUDY: predictability_texts,
    energy.STUDY: energy_texts,
}


def scaled(pattern: str, factor: Callable[[pd.DataFrame], "pd.Series[float]"]) -> Change:
    """Return the change of the columns whose names match by a factor for each row."""
    return lambda rows: rows.assign(**rows.filter(regex=pattern).mul(factor(rows), axis=0))


def of_engine(name: str, factor: float) -> Callable[[pd.DataFrame], "pd.Series[float]"]:
    return lambda rows: (rows["engine"] == name).map({True: factor, False: 1.0})


#: What rows may be instead: other orders, another winner in error and in time, other impacts, laws, failures.
CHANGES: dict[str, Change] = {
    "every error is of order three": lambda rows: rows.assign(
        **dict.fromkeys(rows.filter(regex="_error_"), rows["mean_step_s"] ** 3)
    ),
    "the reference errs more": scaled("_error(_|$)|violation|residual", of_engine("reference", 1e6)),
    "the others err more": scaled(
        "_error(_|$)|violation|residual", lambda rows: 1e7 / of_engine("reference", 1e7)(rows)
    ),
    "the cross-check is further off": scaled("cross_check", lambda rows: rows["step_s"] * 0 + 1e3),
    "the reference is slow": scaled("^solve_time_s$", of_engine("reference", 1e4)),
    "an impact is missed everywhere": lambda rows: rows.assign(impacts_missed=1.0),
    "no law makes a difference": scaled("_model_difference_", of_engine("pymunk", 0.0)),
    "every law makes a difference": lambda rows: rows.assign(slider_position_model_difference_m=1.0),
    "everything is judged": lambda rows: rows.assign(not_judged=""),
    "what failed finished": lambda rows: rows.assign(status="ok", quality_failure=None),
    "Pymunk fails": lambda rows: rows.assign(
        status=rows["status"].mask(rows["engine"] == "pymunk", "failed")
    ),
}


def of_others(members: pd.DataFrame) -> "pd.Series[bool]":
    """Return which are of ensembles that are compared with others."""
    return ~members["part"].isin((*data.OWN, data.PLANTED)) & ~members["part"].str.startswith(data.TWIN_OF)


#: What rows of one study may be instead.
CHANGES_OF: dict[str, dict[str, Change]] = {
    predictability.STUDY: {
        "other ensembles do otherwise": lambda rows: scaled(
            "|".join(data.PARTS_OF_MEAN), lambda rows: of_others(rows).map({True: 1.3, False: 1.0})
        )(rows),
        "every member is there ten times": lambda rows: pd.concat([rows] * 10),
        "few members": lambda rows: rows[~(rows["member"] >= 30)],
    },
    energy.STUDY: {
        "more energy is unaccounted for": scaled(
            "unaccounted|_power_", lambda rows: 3.0 + of_engine("pymunk", 1e3)(rows)
        ),
        "constraints drift otherwise": scaled("_exponent$|^constraint_", of_engine("reference", 1.5)),
    },
}


@cache
def published(study: str) -> pd.DataFrame:
    return read_results(PUBLISHED / study)


def texts(study: str, change: Change = lambda rows: rows) -> set[str]:
    """Return the sentences of a chapter, up to one that the rows contradict."""
    found: set[str] = set()
    with suppress(Contradiction):
        found.update(CHAPTERS[study](change(published(study))))
    return found


@pytest.fixture(autouse=True)
def _no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clearance, "against_step", lambda *_: Figure())
    monkeypatch.setattr(work_precision.figures, "drawing", lambda *_: Figure())
    monkeypatch.setattr(answer, "figure", lambda *_: None)
    monkeypatch.setattr(extremes, "verdict_matrix", lambda *_: Figure())
    monkeypatch.setattr(stability, "verdict_map", lambda *_: Figure())


@pytest.mark.parametrize("study", CHAPTERS)
def test_every_sentence_changes_with_some_rows_or_contradicts_them(study: str) -> None:
    sentences = texts(study)
    assert sentences
    same = set(sentences)
    for change in (*CHANGES_OF.get(study, {}).values(), *CHANGES.values()):
        if same:
            same &= texts(study, change)
    assert not same, "sentences that no change of the rows changes"


def whole(study: str) -> Results:
    return read_study(PUBLISHED / study)


def headline(study: str) -> Iterable[str]:
    return HEADLINES[study](whole(study))


def of_sections(chapter: ModuleType) -> list[str]:
    return [text for section in chapter.sections(whole(chapter.STUDY)) for text in section.text]


def the_answer() -> Iterable[str]:
    said = answer.answer({study: whole(study) for study in HEADLINES})
    return (*said.text, *said.doubts)


#: The sentences of every place of the page whose rows are published; those of curves are not.
PLACES: dict[str, Callable[[], Iterable[str]]] = {
    "answer": the_answer,
    **{f"headline of {study}": partial(headline, study) for study in HEADLINES},
    **{study: partial(texts, study) for study in CHAPTERS},
    **{chapter.STUDY: partial(of_sections, chapter) for chapter in (extremes, stability)},
}


@pytest.mark.parametrize("place", PLACES)
def test_no_sentence_has_more_numbers_than_one_can_read(place: str) -> None:
    found = [text for text in PLACES[place]() if not text.startswith("To run it: ")]  # which is to be typed
    assert found
    for text in found:
        for name in sorted(gallery(), key=len, reverse=True):
            text = text.replace(name, "a case")
        for sentence in re.split(r"[.:;] ", text):
            assert len(NUMBER.findall(sentence)) <= MOST_NUMBERS, sentence

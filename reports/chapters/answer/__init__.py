"""The answer, which the page opens with: whom to take, at what setting, what it costs, where it breaks."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from reports.chapters.answer import sentences, trust
from reports.chapters.answer.figure import figure
from reports.chapters.answer.picks import POSITION, Race, asked, races
from reports.equal_error import ALONE, UNRESOLVED
from reports.parts import Figure, Table
from reports.results import Results
from reports.style import words
from reports.tables import ABSENT, plain

QUESTION = (
    "Which engine, at which setting, gets a crank-slider with clearance in its joints right, what does it "
    "cost, and what of it is not to be trusted?"
)


@dataclass(frozen=True)
class Answer:
    """The first screen: ``text`` to act on, ``doubts`` about what not to trust, ``limits`` of the study."""

    text: tuple[str, ...]
    doubts: tuple[str, ...]
    limits: tuple[str, ...]
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]


def answer(studies: Mapping[str, Results]) -> Answer:
    """Return the answer that the studies there are give, by the names of their folders."""
    found = races(studies["work-precision"]) if "work-precision" in studies else []
    arms = trust.hidden(studies["energy"]) if "energy" in studies else []
    horizons = trust.horizons(studies["predictability"]) if "predictability" in studies else {}
    drawn = figure(studies["work-precision"], asked(found, POSITION, loose=True)) if found else None
    return Answer(
        text=(
            *sentences.whom_to_take(found),
            *sentences.who_keeps_energy(arms),
        ),
        doubts=tuple(sentences.what_not_to_trust(studies, horizons)),
        limits=tuple(sentences.what_it_cannot_say(found, studies)),
        tables=tuple(_tables(found, arms, studies)),
        figures=(drawn,) if drawn else (),
    )


def _tables(
    found: Sequence[Race], arms: Sequence[trust.Hidden], studies: Mapping[str, Results]
) -> Iterator[Table]:
    for name, title, loose in (
        ("answer", "Whom to take, with clearance", True),
        ("answer-ideal", "Whom to take, on ideal joints", False),
    ):
        rows = [_row(race, studies) for race in found if race.loose == loose]
        if loose:
            rows += _energy_rows(arms, studies)
        if rows:
            yield Table(name, title, READING, HEAD, tuple(rows))


HEAD = (
    "error in",
    "at most",
    "scene",
    "take",
    "setting",
    "run time [ms]",
    "next engine: times as long",
    "where it breaks",
    "command",
)
READING = (
    "The cheapest measured run within each error that all finer settings of its arm keep, by the median of "
    f"its rounds, and how many times as long the next engine takes. {UNRESOLVED} {ALONE} Hard cases are "
    "those of the gallery that the engine's model here expresses, without our guards. For energy each "
    "engine's best arm is named that hides no more; its runs are not timed, and are of several scenes. The "
    "command makes the run of the others; its 200 output intervals may shorten a fixed step."
)


def _row(race: Race, studies: Mapping[str, Results]) -> tuple[str, ...]:
    asked_for = (race.what, f"{race.target:g} {words(race.column)[1]}", race.scene)
    if not race.picks:
        return (*asked_for, "no engine", *[ABSENT] * 5)
    first, *others = race.picks
    way = first.way
    next_one = ABSENT
    if others:
        times = race.ratios.get(others[0].way.label)
        next_one = f"{others[0].way.label}: {times or ABSENT}{others[0].way.without(race.column)}"
    return (
        *asked_for,
        way.label,
        way.setting,
        plain(1e3 * way.time_s) + way.without(race.column),
        next_one,
        trust.breaks(studies, way.engine, way.label),
        first.command,
    )


def _energy_rows(arms: Sequence[trust.Hidden], studies: Mapping[str, Results]) -> list[tuple[str, ...]]:
    """Return the arms that hide next to nothing, one line for each engine's best."""
    keep = [arm for arm in arms if arm.part <= trust.HIDDEN_PART]
    return [
        (
            "energy",
            f"{100 * trust.HIDDEN_PART:g} %",
            f"{arm.scenes} with contact",
            arm.label,
            arm.setting,
            ABSENT,
            ABSENT,
            trust.breaks(studies, arm.engine, arm.label),
            ABSENT,
        )
        for arm in {arm.engine: arm for arm in reversed(keep)}.values()
    ]

"""The energy study on the page: hidden power, the ledger of every run, drift of the constraints."""

from collections.abc import Iterable, Iterator

import pandas as pd

from reports.chapters.energy import figures, tables
from reports.chapters.energy.rungs import SMALL, UNACCOUNTED, at_rungs, middle_rungs, prepared
from reports.parts import Section, stated
from reports.quantities import finished, own_scenes
from reports.results import Results
from reports.shared_tables import failures_section
from reports.tables import in_text, listed, on_scenes

STUDY = "energy"
TITLE = "Energy over long runs"
INTRODUCTION = (
    "A method that makes or takes energy has a driver or a brake that no scene has. Of every engine's "
    "runs, which are longer than those of other studies, what its bodies and contacts store, what its "
    "driver gives and what its contacts dissipate are added up from its own trajectory. What does not add up "
    "is the method's own: energy gained if positive, lost if negative. Its rate is called hidden power: the "
    "slope over time, the median over all pairs of block means (Theil and Sen), with Student's interval over "
    "five parts of "
    "the run. It holds what stabilisation of the constraints removes, which is no physics either and which "
    "only some engines tell."
)
PLAIN, BAUMGARTE, PROJECTED = "reference (none)", "reference (Baumgarte)", "reference (projection)"
AS_IT_COMES = "pymunk (out of the box)"
#: How far an exponent of time may be from the whole number that theory gives, and still be that.
EXPONENT = 0.1


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = prepared(results.rows)
    at_middle = at_rungs(rows, middle_rungs(rows))
    by_scene = [of_scene for _, of_scene in at_middle.groupby("scene")]
    return [
        Section.of(
            "hidden-power",
            "Hidden power",
            (*lasting(rows), *hidden_power(at_middle), *lost_as_it_comes(rows, "ideal-free")),
            (figures.gain_over_time(results, at_middle), *figures.by_step(rows)),
            [tables.power_table(at_middle, rows)],
        ),
        Section.of(
            "ledger",
            "Where energy goes",
            ledger_closes(at_middle),
            [figures.driver_work(results, of_scene) for of_scene in by_scene],
            map(tables.ledger_table, by_scene),
        ),
        Section.of(
            "drift",
            "Drift of the constraints",
            drift(rows),
            figures.growth(results, at_middle),
            [tables.drift_table(at_middle, rows)],
        ),
        failures_section(rows, STUDY),
    ]


def lasting(rows: pd.DataFrame) -> Iterator[str]:
    """Yield how many revolutions runs take, on ideal joints and with contact."""
    turns = [
        (joints, of_kind["turns"].round())
        for with_contact, joints in ((False, "on ideal joints"), (True, "with contact"))
        if len(of_kind := finished(rows[rows["has_clearance"] == with_contact]))
    ]
    spans = [f"{_from_to(of.min(), of.max())} revolutions {joints}" for joints, of in turns]
    if spans:
        yield f"Runs take {listed(spans)}."


def _from_to(least: float, most: float) -> str:
    return f"{least:g} to {most:g}" if least < most else f"{most:g}"


def hidden_power(at_rung: pd.DataFrame) -> Iterator[str]:
    """Yield the least and the largest hidden power on each scene, and with which arms it may be zero.

    ``at_rung`` are the rows at one rung for each scene.
    """
    for scene, rows in finished(at_rung).groupby("scene"):
        rows = rows.sort_values("hidden_power_W", key=abs)
        told, rest = rows[rows["significant"]], rows[~rows["significant"]]
        small = rest["uncertain_part"] <= SMALL
        if len(told):
            yield f"On {scene} the hidden power is {_ends(told)}."
        if small.any():
            part, arms = in_text(rest["uncertain_part"][small].max()), listed(rest["label"][small])
            yield (
                f"On {scene} the hidden power is not told from zero, to within {part} of the energy in play, "
                f"with {arms}."
            )
        if not small.all():
            part, arms = in_text(rest["uncertain_part"].max()), listed(rest["label"][~small])
            yield (
                f"On {scene} nothing can be told of the hidden power with {arms}: the interval reaches "
                f"up to {part} of the energy in play to either side."
            )


def _ends(told: pd.DataFrame) -> str:
    """Return the least and the largest hidden power of the rows, sorted by it."""
    ends = told.iloc[[0, -1]].drop_duplicates("label")
    return listed(
        f"{_signed(power)} W with {label}"
        for power, label in zip(ends["hidden_power_W"], ends["label"], strict=True)
    ) + (f", and between these with {listed(told['label'].iloc[1:-1])}" if len(told) > 2 else "")


def lost_as_it_comes(rows: pd.DataFrame, scene: str) -> Iterator[str]:
    """Yield by how much of a scene's energy Pymunk with its own settings is off, by step."""
    rows = finished(rows[(rows["label"] == AS_IT_COMES) & (rows["scene"] == scene)]).sort_values("step_s")
    if len(rows):
        shortest, longest = (f"{100 * rows[UNACCOUNTED].iloc[at]:.0f} %" for at in (0, -1))
        yield (
            f"On {scene} {AS_IT_COMES} is off by {shortest} of the energy in play at the shortest of its "
            f"steps, and by {longest} at the longest."
        )


def drift(rows: pd.DataFrame) -> Iterator[str]:
    """Yield, checked, how the reference's constraints drift with each stabilisation."""
    rows = finished(rows[~rows["has_clearance"] & own_scenes(rows)])
    free, bounded, projected = (rows[rows["label"] == label] for label in (PLAIN, BAUMGARTE, PROJECTED))
    grows, stays = (
        of[["constraint_violation_exponent", "constraint_speed_exponent"]].dropna() for of in (free, bounded)
    )
    if len(grows):
        gaps, speeds = (_span(map("{:.2f}".format, (of.min(), of.max()))) for _, of in grows.items())
        off = (grows - [2, 1]).abs() < EXPONENT
        scenes = free["scene"][grows.index].nunique()
        sentence = (
            f"Without stabilisation the reference's constraints drift {on_scenes(scenes)} as theory has "
            f"it for RK4: the speeds at which gaps open grow in proportion to time (exponents {speeds})."
        )
        yield stated(sentence, bool(off["constraint_speed_exponent"].all()))
        sentence = f"The gaps then grow with the square of time (exponents {gaps})."
        yield stated(sentence, bool(off["constraint_violation_exponent"].all()))
    if len(stays):
        largest = stays.max(axis=None)
        scenes = bounded["scene"][stays.index].nunique()
        bound = f"exponents are at most {max(0.0, largest):.2f}"
        sentence = f"Baumgarte's stabilisation bounds them {on_scenes(scenes)}: {bound}."
        yield stated(sentence, largest < EXPONENT)
    if len(projected):
        worst = in_text(projected["constraint_violation_m"].max())
        scenes = projected["scene"].nunique()
        sentence = f"Projection leaves round-off alone {on_scenes(scenes)}: gaps of at most {worst} m."
        yield stated(sentence, bool(projected["constraint_violation_exponent"].isna().all()))


def ledger_closes(at_rung: pd.DataFrame) -> Iterator[str]:
    """Yield the largest part of the energy in play that is missing or too much, of the extreme arms."""
    rows = finished(at_rung[at_rung["has_clearance"]])
    worst = rows.groupby("label", observed=True)[UNACCOUNTED].max().sort_values()
    if len(worst):
        ends = dict.fromkeys((worst.index[0], worst.index[-1]))
        arms = listed(f"{in_text(worst[label])} with {label}" for label in ends)
        scenes = rows["scene"].nunique()
        yield (
            f"{on_scenes(scenes).capitalize()} with contact, in parts of the energy in play: the ledger "
            f"lacks or has too much at most {arms}."
        )


def _signed(value: float) -> str:
    return f"{'−' if value < 0 else '+'}{in_text(abs(value))}"


def _span(ends: Iterable[str]) -> str:
    """Return two ends as a range, or as one number if they read the same."""
    return " to ".join(dict.fromkeys(ends))

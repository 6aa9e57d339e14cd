"""The energy study on the page: hidden power, the ledger of every run, drift of the constraints."""

from reports.chapters.energy import figures, findings, tables
from reports.chapters.energy.rungs import at_rungs, middle_rungs, prepared
from reports.parts import Section
from reports.results import Results
from reports.shared_tables import failures_section, failures_table

STUDY = "energy"
TITLE = "Energy over long runs"
INTRODUCTION = (
    "A method that makes or takes energy has a driver or a brake that no scene has. Every engine runs "
    "scenes for many turns, and what its bodies and contacts store, what its driver gives and what its "
    "contacts dissipate are added up from its own trajectory. What does not add up is the method's own: "
    "energy gained if positive, lost if negative. Its rate is called hidden power: the slope over time, "
    "the median over all pairs of block means (Theil and Sen), with Student's interval over five parts of "
    "the run. It holds what stabilisation of the constraints removes, which is no physics either and which "
    "only some engines tell."
)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = prepared(results.rows)
    at_middle = at_rungs(rows, middle_rungs(rows))
    by_scene = [of_scene for _, of_scene in at_middle.groupby("scene")]
    return [
        Section.of(
            "hidden-power",
            "Hidden power",
            (*findings.hidden_power(at_middle), *findings.lost_as_it_comes(rows, "ideal-free")),
            (figures.gain_over_time(results, at_middle), figures.by_step(rows)),
            [tables.power_table(at_middle, rows)],
        ),
        Section.of(
            "ledger",
            "Where energy goes",
            findings.ledger_closes(at_middle),
            [figures.driver_work(results, of_scene) for of_scene in by_scene],
            map(tables.ledger_table, by_scene),
        ),
        Section.of(
            "drift",
            "Drift of the constraints",
            findings.drift(rows),
            [figures.growth(results, at_middle)],
            [tables.drift_table(at_middle, rows)],
        ),
        failures_section(rows, failures_table(rows, STUDY)),
    ]

"""The stability study on the page: maps of verdicts, and the scalar problem held against theory."""

from collections.abc import Sequence

from reports.chapters.agreement.tables import settings_table
from reports.chapters.stability import findings, tables
from reports.chapters.stability.cells import VARIED, arms, cells, dampings_of, limits_of
from reports.chapters.stability.maps import verdict_map
from reports.parts import Figure, Section
from reports.results import Results, Run
from reports.style import title

TITLE = "Stability"
INTRODUCTION = (
    "Where does each solver stop being trustworthy? The literature's crank-slider with clearance at the "
    "rod-slider pin and a lossless Hertz contact is run through its first impacts at steps from harmless to "
    "absurd, while contact stiffness, clearance or crank speed varies, and every run gets a verdict from its "
    "trajectory alone. Theory knows a limit for a fixed explicit step h on a contact of frequency ω: "
    "ωh = 2.828 for RK4, h = 0.702 durations of the contact, and ωh = 2 for semi-implicit Euler, 0.496 "
    "durations. Implicit methods, and those that choose their steps, have none. A mass on a contact's "
    "spring shows whether the engines' methods are what theory takes them for."
)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    runs = results.runs
    out = []
    scalar = limits_of(runs), dampings_of(runs)
    if any(scalar):
        shown = [
            make(runs) for make, some in zip((tables.limits, tables.dampings), scalar, strict=True) if some
        ]
        out.append(
            Section("scalar", "A mass on a contact", tuple(findings.recovered(runs)), (), tuple(shown))
        )
    maps = [varied for varied in VARIED if cells(runs, varied)]
    for varied in maps:
        what = VARIED[varied][0]
        text = tuple(findings.begun(runs, varied))
        out.append(Section(_name(what), f"Step and {what}", text, (_figure(runs, varied),)))
    if maps:
        shown = [tables.boundaries(runs), settings_table(runs, "stability")]
        out.append(Section("boundaries", "The boundaries", findings.verdicts(runs), (), tuple(shown)))
    return out


def _figure(runs: Sequence[Run], varied: str) -> Figure:
    what = VARIED[varied][0]
    names = ", ".join(title(name) for name in arms(cells(runs, varied)))
    return Figure(
        f"stability-{_name(what)}",
        f"Verdicts over the step and the {what}",
        "A cell is a run, dark is bad. Right of the black line the step is beyond the limit of theory at the "
        "deepest point of the first impact. G: the energy balance gains more than its bound; I: any bound is "
        "exceeded otherwise; D: the engine gave up, a number is not finite or the mechanism came apart.",
        f"Maps of verdicts over the step and the {what}, logarithmic, one panel each for {names}.",
        verdict_map(runs, varied),
    )


def _name(what: str) -> str:
    return what.replace(" ", "-")

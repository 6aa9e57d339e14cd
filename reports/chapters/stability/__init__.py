"""The stability study on the page: maps of verdicts, and the scalar problem held against theory."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import pandas as pd

from reports.chapters.stability import map_cells, tables
from reports.chapters.stability.map_cells import VARIED, cells, dampings_of, limits_of, map_rows
from reports.chapters.stability.maps import verdict_map
from reports.chapters.stability.tables import span
from reports.parts import Figure, Section, Table, stated
from reports.results import Results
from reports.shared_tables import settings_table
from reports.style import ENGINES, labels
from reports.tables import in_text, listed

#: A part of a page that has a name and a title.
Titled = TypeVar("Titled", Section, Figure, Table)

STUDY = "stability"
TITLE = "Stability"
INTRODUCTION = (
    "Where does each solver stop being trustworthy? A crank-slider with clearance at the rod-slider pin, the "
    "literature's with a lossless Hertz contact unless a scene is named, is run through its first impacts at "
    "steps from harmless to absurd, while contact stiffness, clearance or crank speed varies, and every run "
    "gets a verdict from its "
    "trajectory alone. Theory knows a linear limit for a fixed explicit step h on a contact of frequency ω. "
    "For RK4 it is ωh = 2.828, which is h = 0.702 durations of the contact. For semi-implicit Euler it is "
    "ωh = 2, or 0.496 durations. Implicit methods, and those that choose their steps, have none. A mass on "
    "a contact's spring shows whether the engines' methods are what theory takes them for."
)
#: What the scalar problem must recover of theory.
WITHIN = 0.01


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = map_cells.prepared(results.rows)
    found = list(_of_one_mechanism(rows[rows["map_of"].isna()]))
    for scene, of_scene in rows.groupby("map_of"):
        found += [_named(section, scene) for section in _of_one_mechanism(of_scene)]
    return found


def _of_one_mechanism(rows: pd.DataFrame) -> Iterator[Section]:
    maps = [varied for varied in VARIED if len(cells(rows, varied))]
    yield from _scalar(rows)
    yield from (_map(rows, varied) for varied in maps)
    yield from _boundaries(rows, maps)


def _named(section: Section, scene: str) -> Section:
    """Return a section, with its figures and tables, by names and titles that tell the scene of a user's."""
    return replace(
        _titled(section, scene),
        figures=tuple(_titled(figure, scene) for figure in section.figures),
        tables=tuple(_titled(table, scene) for table in section.tables),
    )


def _titled(part: Titled, scene: str) -> Titled:
    return replace(part, name=f"{part.name}-{scene}", title=f"{part.title} on {scene}")


def _scalar(rows: pd.DataFrame) -> Iterator[Section]:
    shown = (tables.limits(limits_of(rows)), tables.dampings(dampings_of(rows)))
    if any(shown):
        yield Section.of("scalar", "A mass on a contact", recovered(rows), tables=shown)


def _map(rows: pd.DataFrame, varied: str) -> Section:
    rows = cells(rows, varied)
    what = VARIED[varied][0]
    name = what.replace(" ", "-")
    figure = Figure(
        f"stability-{name}",
        f"Verdicts over the step and the {what}",
        "A cell is a run, dark is bad. Right of the black line the step is beyond the linear limit of "
        "theory: that of a spring as stiff as the contact at the deepest point of the first impact, while "
        "later impacts are harder or softer. G: the energy balance gains more than its bound; I: any bound "
        "is exceeded otherwise; D: the engine gave up, a number is not finite, the mechanism came apart or "
        f"its energy is off by a tenth.{_caps(rows)}",
        f"Maps of verdicts over the step and the {what}, logarithmic, one panel each for "
        f"{', '.join(labels(rows))}.",
        verdict_map(rows, varied),
        dense=True,
    )
    return Section.of(name, f"Step and {what}", begun(rows, varied), [figure])


def _caps(rows: pd.DataFrame) -> str:
    """Return a caption's sentences on the arms for which the axis is but a cap."""
    arms = rows.groupby("label", observed=True)
    caps = [label for label, arm in arms if map_cells.capped(arm)]
    if not caps:
        return ""
    text = f" For {listed(caps)} the axis is a cap: they take shorter steps where they need them."
    if rows["contact_step_s"].notna().any():
        text += " A title tells the mean step within the first contact, from the shortest to the longest."
    return text


def _boundaries(rows: pd.DataFrame, maps: Sequence[str]) -> Iterator[Section]:
    if maps:
        shown = (tables.boundaries(rows), settings_table(rows, STUDY))
        yield Section.of("boundaries", "The boundaries", verdicts(rows), tables=shown)
        in_maps = map_cells.in_all_maps(rows)
        if len(other := map_cells.other_bounds(in_maps)):
            table = tables.other_bounds(in_maps)
            yield Section.of("bounds", "The bounds", bounds(in_maps, other), tables=[table])


def recovered(rows: pd.DataFrame) -> Iterator[str]:
    """Yield the sentences on the scalar problem."""
    limits, dampings = limits_of(rows), dampings_of(rows)
    known = limits["limit_frequency_step"].notna()
    leading = dampings["leading_energy_loss_per_step"].notna()
    for what, of in (
        ("limits of stability", limits[known]),
        ("losses of energy per step", dampings[leading]),
    ):
        if len(of):
            worst = of["relative_difference"].fillna(1.0).abs().max()
            off = f"the worst off by {in_text(worst)} of its value"
            yield stated(f"All {len(of)} {what} that theory knows are recovered, {off}.", worst <= WITHIN)
    unlimited = limits[~known & limits["engine"].isin(ENGINES)]  # theory was not asked about others
    if len(unlimited):
        text = f"Where theory knows no limit none was found up to ωh = 64: {', '.join(labels(unlimited))}."
        yield stated(text, bool(unlimited["measured_limit_frequency_step"].isna().all()))


def begun(rows: pd.DataFrame, varied: str) -> Iterator[str]:
    """Yield the sentences on a map: who never grows, and where others begin to grow and to diverge."""
    grows = rows.groupby("label", observed=True)["grows"].any()
    if not grows.all():
        calm, runs = ", ".join(grows.index[~grows]), rows["label"].isin(grows.index[~grows]).sum()
        yield f"None of {runs} runs of {calm} gains energy beyond its bound or diverges, at any step."
    for label, arm in rows.groupby("label", observed=True):
        multiples = map_rows(arm, varied) / map_cells.limit_of(arm)
        growth, divergence = multiples["growth"].dropna(), multiples["divergence"].dropna()
        at, of = (
            f"{label} at {{}} of {len(multiples)} values of the {VARIED[varied][0]}",
            "theory's linear limit",
        )
        if len(growth):
            yield f"{at.format(len(growth))}: energy grows from {span(growth)} times {of} on."
        if len(divergence):
            yield f"{at.format(len(divergence))}: runs diverge from {span(divergence)} times {of} on."


def verdicts(rows: pd.DataFrame) -> Iterator[str]:
    """Yield the sentences on all maps: what accurate means, and that no limit is no promise."""
    in_maps = map_cells.in_all_maps(rows)
    yield _honest(in_maps)
    # Methods of fixed step that have no limit on a spring, and gain energy here.
    fixed = in_maps[in_maps["label"].isin(dampings_of(rows)["label"])]
    free = fixed[fixed["limit_frequency_step"].isna()]
    if free["grows"].any():
        yield (
            f"Theory knows no limit for {', '.join(labels(free))}, yet {free['grows'].sum()} of their "
            f"{len(free)} runs gain energy beyond its bound or diverge: stable on a spring is not stable "
            "on a contact that begins and ends."
        )


def bounds(in_maps: pd.DataFrame, others: Sequence[str]) -> Iterator[str]:
    """Yield why the bounds are what they are, and what hangs on them."""
    first = in_maps.iloc[0]
    yield (
        f"The bounds are a choice. {first['energy_bound_per_impact']:.0%} of an impact's energy is what laws "
        "of one nominal restitution differ by. "
        f"{first['position_bound_per_clearance']:.0%} of the clearance is a line's width in a picture of the "
        f"pin's path. Positions are compared through {first['compared_impacts']:.0f} impacts, since without "
        "losses every impact makes an error some twice as large."
    )
    changes = map_cells.changed_verdicts(in_maps)
    most = changes[list(others)].sum()
    worst = most.idxmax()
    yield (
        f"Of {len(in_maps)} verdicts {most.max()} change where {map_cells.in_words(worst)}, the change that "
        "tells most."
    )
    steady = changes.index[changes.sum(axis=1) == 0]
    if len(steady):
        runs = in_maps["label"].isin(steady).sum()
        yield f"No bound halved or doubled changes one of {runs} verdicts on {listed(steady)}."


def _honest(rows: pd.DataFrame) -> str:
    """Return what accurate means, checked on every cell that is called so."""
    called, bounds = rows[rows["severity"] == 0], rows.iloc[0]
    energy, gap, place = (
        bounds[f"{what}_bound_per_{of}"]
        for what, of in (("energy", "impact"), ("constraint", "clearance"), ("position", "clearance"))
    )
    within = {
        "energy_gain_per_impact": energy,
        "energy_loss_per_impact": energy,
        "constraint_violation_per_clearance": gap,
        "position_error_per_clearance": place,
    }
    # A number that is missing, for it was not finite, is within no bound.
    held = (
        called.reindex(columns=list(within)).le(pd.Series(within)).all(axis=None)
        and (called["status"] == "ok").all()
    )
    return stated(
        f"{len(called)} of {len(rows)} runs are called accurate. In each of them all numbers are finite, the "
        f"energy balance holds within {energy:.0%} of the first impact's energy, and the ideal joints within "
        f"{gap:.0%} of the clearance. Through {bounds['compared_impacts']:.0f} impacts the slider's position "
        f"is within {place:.0%} of it.",
        bool(held),
    )

"""The predictability study on the page: horizons, exponents, ensembles past the horizon, diagrams."""

from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from reports.chapters.predictability import (
    basins,
    chains,
    comparison,
    data,
    diagrams,
    figures,
    findings,
    maps,
    tables,
)
from reports.parts import Figure, Section, Table
from reports.quantities import own_scenes
from reports.results import Results
from reports.shared_tables import not_finished, quality_table

STUDY = "predictability"
TITLE = "Predictability"
INTRODUCTION = (
    "A mechanism with clearance can be chaotic: what is too small to be measured at the start decides where "
    "the slider is a few revolutions later. Up to a scene's horizon engines are compared moment by moment, "
    "in the other chapters; past it only distributions can agree. They are compared here, over ensembles "
    "whose starts are independent draws of the crank angle from a whole turn."
)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = data.prepared(results.rows)
    return [
        *_horizons(results, data.horizons(rows)),
        *_exponents(results, data.exponents(rows)),
        *(_ensembles(results, scene, by_label) for scene, by_label in data.ensembles(rows).items()),
        *_diagrams(results, rows),
        _failures(rows),
    ]


def _horizons(results: Results, rows: pd.DataFrame) -> Iterator[Section]:
    if rows.empty:
        return
    figure = results.has_curves and Figure(
        "predictability-growth",
        "How twins of the reference part from it",
        "Distance of the slider from the reference's, the largest up to each time. Black: started at crank "
        "angles moved by half to twice 1e-10 rad to either side (median, and all in grey); blue, dashed: the "
        "same start at half of a fine step. Diamonds mark the median horizon of a tolerance (dotted lines), "
        "bars reach from the first to the last twin; a bar without a diamond ends with the run.",
        f"{len(rows)} logarithmic panels over time, one per scene: {', '.join(rows['scene'])}. "
        "Distances of perturbed and step-halved twins, with horizons at 1 nm, 1 µm and 100 µm.",
        figures.growth(results, rows),
    )
    yield Section.of(
        "horizons", "Horizons", findings.horizons(rows), [figure or None], [tables.horizons(rows)]
    )


def _exponents(results: Results, by_scene: Mapping[str, pd.DataFrame]) -> Iterator[Section]:
    if not by_scene:
        return
    method = (
        "Benettin's method: a companion 1e-12 m beside the run is put back along the same direction before "
        "it is a hundredth of the clearance away. Both go through their own impacts, and the companion is "
        "put back at moments when all pins of both fly free, so that no impact lies between them and no "
        "saltation matrix is needed. Starts are independent draws of the crank angle. Chaos is claimed where "
        "no start settles, the interval of their exponents leaves zero out, and half of the "
        "run gives the same."
    )
    figure = None
    if results.has_curves and (drawing := figures.exponents(results, by_scene)):
        figure = Figure(
            "predictability-exponents",
            "Lyapunov exponents against the length of the run",
            "Shown are scenes on which every start has an exponent. The interval is Student's over "
            "starts, since growth within a run is correlated.",
            f"Panels of exponents per revolution over revolutions used, of: {', '.join(by_scene)}.",
            drawing,
        )
    text = (method, *findings.exponents(by_scene))
    yield Section.of("exponents", "Lyapunov exponents", text, [figure], [tables.exponents(by_scene)])


def _ensembles(results: Results, scene: str, by_label: data.Ensembles) -> Section:
    own = all(own_scenes(members).all() for members in by_label.values())
    verdicts = comparison.verdicts(by_label)
    drawn = [*_pairs(results, scene, by_label, verdicts)] if verdicts else []
    return Section.of(
        f"ensembles-{scene}",
        f"Ensembles on {scene}",
        findings.ensembles(scene, verdicts, own),
        drawn,
        [tables.means(by_label, scene), *(_compared(scene, by_label, verdicts) if verdicts else ())],
    )


def _compared(
    scene: str, by_label: data.Ensembles, verdicts: list[comparison.Verdict]
) -> Iterator[Table | None]:
    yield comparison.verdict_table(verdicts, scene)
    yield comparison.compared(verdicts, scene)
    yield comparison.calibration_table(comparison.calibrations(verdicts), data.shown(by_label), scene)


def _pairs(
    results: Results, scene: str, by_label: data.Ensembles, verdicts: Sequence[comparison.Verdict]
) -> Iterator[Figure]:
    names = ", ".join(verdict.pair.label for verdict in verdicts)
    yield Figure(
        f"predictability-ensembles-{scene}",
        f"Past the horizon on {scene}",
        f"Differences of means from the twin's, in units of the margin, with {comparison.PERCENT} intervals. "
        "A quantity is equivalent where its interval lies within the grey band. The ensembles of the "
        "reference are another draw, the paper's method, and a clearance that is a tenth smaller, which has "
        "to differ. Of too few members to decide nothing is drawn.",
        f"A panel of intervals, a line for each quantity, for each of {names}.",
        figures.differences(verdicts),
    )
    if not results.has_curves:
        return
    yield Figure(
        f"predictability-phases-{scene}",
        f"Impacts by crank angle on {scene}",
        "Impacts per revolution by the crank angle at touch, each ensemble beside its twin's: means over "
        "members with Student's 95 % intervals.",
        f"A panel over the crank angle for each of {names}, with its twin.",
        figures.phases(results, by_label),
    )


def _diagrams(results: Results, rows: pd.DataFrame) -> Iterator[Section]:
    if not results.has_curves:
        return
    drawn: list[Figure] = []
    text: list[str] = []
    for part in (diagrams.CLEARANCES, diagrams.SPEEDS):
        if found := diagrams.diagram(results, rows, part):
            drawn.append(diagrams.figure(part, found))
            text += diagrams.findings(part, found)
    if (members := chains.chains(results, rows)) is not None:
        drawn.append(chains.figure(members))
        text += chains.findings(members)
    if (starts := basins.starts(results, rows)) is not None:
        drawn.append(basins.figure(starts))
        text += basins.findings(starts)
    if (of_map := maps.members(results, rows)) is not None:
        drawn += maps.figures(of_map)
        text += maps.findings(of_map)
    if drawn:
        yield Section.of("diagrams", "From motions that repeat to chaos", text, drawn)


def _failures(rows: pd.DataFrame) -> Section:
    table = tables.failures(rows)
    shown = [table, quality_table(rows, STUDY)]
    return Section.of("failures", "Runs that did not finish", not_finished(rows), tables=shown)

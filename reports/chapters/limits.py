"""The limits of each method: where runs become unstable, and what becomes of extreme cases.

A stability map varies the step and a parameter of a crank-slider with clearance; each cell is a run with a
verdict from its trajectory alone. Theory knows the limit ωh of a step h at a contact's frequency ω.
"""

import math
from collections.abc import Iterator

import pandas as pd

from reports.analysis.map_cells import VARIED, limit_of, map_rows
from reports.analysis.map_cells import prepared as prepared_maps
from reports.analysis.verdicts import JUDGED, WELL, Verdict, answers
from reports.parts import Chapter, Figure, Finding, Number, Studies, Table
from reports.plots.verdict_map import verdict_map
from reports.results import with_columns
from reports.shared_tables import head, runs_tables
from reports.tables import ABSENT, listed, number, span

STABILITY, EXTREMES = "stability", "extremes"
INTRODUCTION = (
    "Stability maps show where a step is too long for a contact, beside the limit of linear theory. Extreme "
    "cases show whether an engine says so where it cannot give the right motion."
)
#: The numbers of an accurate run, with the columns of their bounds.
BOUNDED = {
    "energy_gain_per_impact": "energy_bound_per_impact",
    "energy_loss_per_impact": "energy_bound_per_impact",
    "constraint_violation_per_clearance": "constraint_bound_per_clearance",
    "position_error_per_clearance": "position_bound_per_clearance",
}
#: What theory asks for in an extreme case, in words.
WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or an error that names step or numbers",
    "refusal": "a refusal",
    "stop": "an error at the right time, or the smooth branch",
}


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield whose runs gain energy, what accurate means, checked, and who returns wrong results."""
    if STABILITY in studies and len(cells := prepared_maps(studies[STABILITY].rows)):
        yield growing(cells)
        yield accurate(cells)
    if EXTREMES in studies and len(answered := answers(studies[EXTREMES].rows)):
        yield wrong_without_error(answered)


def growing(cells: pd.DataFrame) -> Finding:
    """Return whose runs never gain energy in the maps, and whose do most often."""
    of_label = cells.groupby("label", observed=True)["grows"]
    part, runs = of_label.mean(), of_label.size()
    calm, worst = list(part.index[part == 0]), part.idxmax()
    text, values = "", {}
    if calm:
        text = f"No run of {listed(calm)} gains energy beyond its bound or diverges ({{calm}} runs). "
        values["calm"] = Number(int(runs[calm].sum()))
    if len(calm) < len(part):
        text += f"{worst} does so most often: in {{part}} of {{runs}} runs."
        values |= {"part": Number(100 * float(part.max()), "%"), "runs": Number(int(runs[worst]))}
    return Finding("energy-growth", text.strip(), **values)


def accurate(cells: pd.DataFrame) -> Finding:
    """Return what the verdict accurate means, checked on every cell that has it."""
    called, bounds = cells[cells["severity"] == 0], cells.iloc[0]
    # A number that is missing, for it was not finite, is within no bound.
    called = with_columns(called, *BOUNDED)
    held = all((called[name] <= bounds[bound]).all() for name, bound in BOUNDED.items())
    text = (
        "{called} of {runs} runs in the maps are called accurate: energy is balanced within {energy} of the "
        "first impact's, gaps of ideal joints are within {constraint} of the clearance. The slider is within "
        "{position} of the clearance through {impacts} impacts."
    )
    values = {"called": Number(len(called)), "runs": Number(len(cells))}
    values |= {bound.split("_")[0]: Number(100 * bounds[bound], "%") for bound in BOUNDED.values()}
    values |= {"impacts": Number(bounds["compared_impacts"])}
    return Finding("accurate", text, **values).require(held and bool((called["status"] == "ok").all()))


def wrong_without_error(answered: pd.DataFrame) -> Finding:
    """Return how often each configuration returned a wrong result without an error, the most often first."""
    wrong = answered["verdict"].eq(Verdict.WRONG).groupby(answered["label"], observed=True)
    counts = pd.DataFrame({"wrong": wrong.sum(), "cases": wrong.size()})
    counts = counts.sort_values("wrong", ascending=False, kind="stable")
    parts = [f"{row.Index} in {{n{k}}} of {row.cases}" for k, row in enumerate(counts.itertuples())]
    text = "Results wrong by over {factor} times a bound, or given where no motion exists, without an error: "
    values = {f"n{k}": Number(int(count)) for k, count in enumerate(counts["wrong"])}
    factor = Number(answered["nonsense_factor"].iloc[0])
    return Finding("wrong-results", f"{text}{listed(parts)} extreme cases.", factor=factor, **values)


def figures(studies: Studies) -> Iterator[Figure]:
    """Yield the stability maps, one for each parameter that varies."""
    for varied, of_map in _each_map(studies):
        what = VARIED[varied][0]
        name = f"stability-map-{what.replace(' ', '-')}"
        title = f"From which step on are runs unstable, over {what}?"
        reading = "A cell is a run; dark is bad. Right of the black line a step is beyond theory's limit."
        yield Figure(name, title, reading, STABILITY, verdict_map(of_map, varied))


def _each_map(studies: Studies) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the column that varies and the cells of each map."""
    if STABILITY in studies:
        rows = prepared_maps(studies[STABILITY].rows)
        for varied in VARIED:
            if rows[varied].notna().any():
                yield varied, rows[rows[varied].notna()]


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield where growth begins, counts of verdicts and the runs that went wrong; all else as files."""
    if STABILITY in studies:
        yield boundaries(studies)
        yield from runs_tables(studies[STABILITY].rows, STABILITY)
    if EXTREMES in studies and len(answered := answers(studies[EXTREMES].rows)):
        yield counts(answered)
        if len(wrong := answered[~answered["verdict"].isin(WELL)]):
            yield verdicts(wrong, "wrong", "Which runs of extreme cases went wrong?").on_page()
        yield verdicts(answered, "verdicts", "Every run of an extreme case")
        yield from runs_tables(studies[EXTREMES].rows, EXTREMES)


def boundaries(studies: Studies) -> Table:
    """Return where growth and divergence begin in each map, as omega h and as multiples of theory's limit."""
    lines = []
    for varied, of_map in _each_map(studies):
        for _, of in of_map.groupby("label", observed=True):
            limit, begins = limit_of(of), map_rows(of, varied)
            columns = begins["growth"], begins["growth"] / limit, begins["divergence"], begins["accurate"]
            theory = "none" if math.isnan(limit) else f"{limit:.4f}"
            case = VARIED[varied][0], of["engine"].iloc[0], of["arm"].iloc[0], theory
            lines.append((*case, *map(_part_of_rows, columns)))
    heading = (
        *("map", "engine", "configuration", "theory ωh", "growth from ωh", "growth per theory"),
        *("divergence from ωh", "accurate up to ωh"),
    )
    title = "Where growth and divergence begin"
    reading = "Ranges over the rows of a map; in brackets how many rows have it. ω is the first impact's."
    return Table("stability-boundaries", title, reading, STABILITY, heading, tuple(lines)).on_page()


def counts(answered: pd.DataFrame) -> Table:
    """Return how often each verdict fell on each configuration."""
    by_label = answered.groupby("label", observed=True)
    names = [verdict.value for verdict in Verdict if (answered["verdict"] == verdict).any()]
    tally = pd.crosstab(answered["label"], answered["verdict"].map(lambda verdict: verdict.value))[names]
    tally.insert(0, "cases", by_label.size())
    tally["as theory asks"] = by_label["as_wanted"].sum()
    columns = {"configuration": list(tally.index), **{name: of.map(str) for name, of in tally.items()}}
    return Table.of("extremes-counts", "What came of the extreme cases?", "", EXTREMES, columns).on_page()


def verdicts(answered: pd.DataFrame, name: str, title: str) -> Table:
    """Return runs: what theory asks for, the verdict, the numbers that it rests on, the engine's reason."""
    bounds = {bound: f"{answered[f'{bound}_bound'].max():g}" for bound in JUDGED}
    reading = "Right: error up to {} of the motion, energy {} of that in play, gaps {} of the crank's length."
    numbers = dict(zip(("error", "energy", "constraints"), JUDGED, strict=True))
    columns = {
        **head(answered, "scene", "engine", "arm"),
        "longest step [s]": answered["step_s"].map(number),
        "asked for": answered["wanted"].map(WANTED),
        "verdict": [verdict.value for verdict in answered["verdict"]],
        **{heading: answered[column].map(number) for heading, column in numbers.items()},
        "error of": answered["judged"].astype(object).fillna(ABSENT),
        "reason": answered["reason"].replace("", ABSENT),
        "theory": answered["theory"],
    }
    return Table.of(f"extremes-{name}", title, reading.format(*bounds.values()), EXTREMES, columns)


def _part_of_rows(values: pd.Series) -> str:
    """Return the least and the largest of some numbers, and of how many if not of all."""
    there = values.notna().sum()
    return span(values) if there in (0, len(values)) else f"{span(values)} ({there} of {len(values)})"


CHAPTER = Chapter("limits", "Limits", (STABILITY, EXTREMES), INTRODUCTION, findings, figures, tables)

"""The limits of each method: where runs become unstable, and what becomes of extreme cases.

A stability map varies the step and a parameter of a crank-slider with clearance; each cell is a run with a
verdict from its trajectory alone. The scalar test problem is a mass on a contact's spring, of which theory
knows the limit ωh of a step h at a frequency ω.
"""

import math
from collections.abc import Iterator

import pandas as pd

from reports.analysis import map_cells
from reports.analysis.verdicts import CONSTRAINT, ENERGY, JUDGED, MODEL, Verdict, answers, wrong_results
from reports.parts import Chapter, Figure, Finding, Number, Studies, Table, View
from reports.plots.panels import MOST_LINES
from reports.plots.verdict_map import verdict_map
from reports.plots.verdict_matrix import verdict_matrix
from reports.results import with_columns
from reports.shared_tables import head, runs_tables
from reports.style import ENGINES, labels
from reports.tables import ABSENT, listed, number, span

STABILITY, EXTREMES = "stability", "extremes"
INTRODUCTION = (
    "Stability maps show where a step is too long for a contact, beside the limit of linear theory. Extreme "
    "cases show whether an engine says so where it cannot give the right motion."
)
#: What the scalar problem must recover of theory, and up to where ωh is tried.
WITHIN, TRIED = 0.01, 64
#: The numbers of an accurate run, with the columns of their bounds.
BOUNDED = {
    "energy_gain_per_impact": "energy_bound_per_impact",
    "energy_loss_per_impact": "energy_bound_per_impact",
    "constraint_violation_per_clearance": "constraint_bound_per_clearance",
    "position_error_per_clearance": "position_bound_per_clearance",
}
#: A loss of energy per step below this is round-off.
ROUND_OFF = 1e-10
#: What theory asks for in an extreme case, in words.
WANTED = {
    "answer": "the motion",
    "answer or word": "the motion, or an error that names step or numbers",
    "refusal": "a refusal",
    "stop": "an error at the right time, or the smooth branch",
}


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield what theory knows of stability and whether it is so, and who returns wrong results."""
    if STABILITY in studies:
        rows = map_cells.prepared(studies[STABILITY].rows)
        yield from recovered(rows)
        in_maps = map_cells.in_all_maps(rows)
        if len(in_maps):
            yield growing(in_maps)
            yield accurate(in_maps)
    if EXTREMES in studies:
        answered = answers(studies[EXTREMES].rows)
        yield from wrong_without_error(answered)
        yield from changed_by_checks(answered)


def recovered(rows: pd.DataFrame) -> Iterator[Finding]:
    """Yield, checked, that the scalar problem recovers theory's limits, and its losses of energy per step."""
    limits, losses = map_cells.limits_of(rows), map_cells.dampings_of(rows)
    limited = limits["limit_frequency_step"].notna()
    known = pd.concat([limits[limited], losses[losses["leading_energy_loss_per_step"].notna()]])
    free = limits[~limited & limits["engine"].isin(ENGINES)]  # theory was not asked about others
    if known.empty:
        return
    worst = float(known["relative_difference"].fillna(1.0).abs().max())
    text = (
        "All {known} stability limits and energy losses per step that theory gives for the scalar test "
        "problem are recovered within {worst}."
    )
    if len(free):
        text += f" Methods without a limit in theory have none up to ωh = {TRIED}: {listed(labels(free))}."
    values = {"known": Number(len(known)), "worst": Number(100 * worst, "%")}
    none = free["measured_limit_frequency_step"].isna().all()
    yield Finding("scalar-limits", text, **values).require(worst <= WITHIN and bool(none))


def growing(in_maps: pd.DataFrame) -> Finding:
    """Return whose runs never gain energy in the maps, and whose do most often."""
    of_label = in_maps.groupby("label", observed=True)["grows"]
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


def accurate(in_maps: pd.DataFrame) -> Finding:
    """Return what the verdict accurate means, checked on every cell that has it, and what hangs on bounds."""
    called, bounds = in_maps[in_maps["severity"] == 0], in_maps.iloc[0]
    # A number that is missing, for it was not finite, is within no bound.
    called = with_columns(called, *BOUNDED)
    held = all((called[name] <= bounds[bound]).all() for name, bound in BOUNDED.items())
    text = (
        "{called} of {runs} runs in the maps are called accurate: energy is balanced within {energy} of the "
        "first impact's, gaps of ideal joints are within {constraint} of the clearance. The slider is within "
        "{position} of the clearance through {impacts} impacts."
    )
    values = {"called": Number(len(called)), "runs": Number(len(in_maps))}
    values |= {bound.split("_")[0]: Number(100 * bounds[bound], "%") for bound in BOUNDED.values()}
    values |= {"impacts": Number(bounds["compared_impacts"])}
    changes = map_cells.changed_verdicts(in_maps).sum()
    if len(changes):
        text += f" The most verdicts change with the {map_cells.in_words(changes.idxmax())}: {{changed}}."
        values["changed"] = Number(int(changes.max()))
    return Finding("accurate", text, **values).require(held and bool((called["status"] == "ok").all()))


def wrong_without_error(answered: pd.DataFrame) -> Iterator[Finding]:
    """Yield how often each configuration returned a wrong result without an error, with our checks off."""
    counts = wrong_results(answered)
    if len(counts):
        told = [f"{row.Index} in {{n{k}}} of {row.cases}" for k, row in enumerate(counts.itertuples())]
        text = (
            "Results wrong by over {factor} times a bound, or given where no motion exists, without an error "
        )
        text += f"(our checks off): {listed(told)} extreme cases."
        values = {f"n{k}": Number(int(count)) for k, count in enumerate(counts["wrong"])}
        factor = Number(answered["nonsense_factor"].iloc[0])
        yield Finding("wrong-results", text, factor=factor, **values)


def changed_by_checks(answered: pd.DataFrame) -> Iterator[Finding]:
    """Yield how many runs our checks ended or failed, and what is left wrong without an error."""
    changed = answered[answered["unguarded"].notna()]
    left = answered["label"][answered["verdict"] == Verdict.WRONG].value_counts(sort=False)
    told = [f"{label} {count}" for label, count in left[left > 0].items()]
    after = changed["verdict"] == Verdict.NOTICED
    if len(changed):
        yield Finding(
            "checks",
            "Our checks end {ended} runs with which the engine would go on, and reject {after} that it "
            "finished. With checks off {success} of these report success. With checks on {left} wrong "
            f"results have no error{': ' if told else ''}{', '.join(told)}.",
            ended=Number(int((~after).sum())),
            after=Number(int(after.sum())),
            success=Number(int(changed["came"].str.startswith("success").sum())),
            left=Number(int(left.sum())),
        )


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield the stability maps, a view for each parameter that varies, and the matrix of extreme cases."""
    if STABILITY in studies:
        yield _maps(map_cells.prepared(studies[STABILITY].rows))
    if EXTREMES in studies:
        yield Figure(
            "extremes-matrix",
            "Does an engine say so where it cannot give the right motion?",
            "A frame marks what theory asks for. In a divided cell a check of ours speaks on the left; the "
            "right is what comes without it. Blank: not run. The CSV has the theory of each case.",
            EXTREMES,
            (View((), verdict_matrix(answers(studies[EXTREMES].rows))),),
            dense=True,
            data="extremes-verdicts",
        )


def _maps(rows: pd.DataFrame) -> Figure | None:
    """Return the stability maps, of each engine's first configuration and of those with a limit in theory."""
    views = []
    for varied, what, of_map in _each_map(rows):
        each = of_map.drop_duplicates("label").sort_values("label")
        each = each.assign(later=each["engine"].duplicated() & each["limit_frequency_step"].isna())
        shown = each.sort_values("later", kind="stable")["label"].head(MOST_LINES)
        views.append(View((what,), verdict_map(of_map[of_map["label"].isin(shown)], varied)))
    reading = "A cell is a run; dark is bad. Right of the black line a step is beyond theory's linear limit."
    parts = "stability-maps", "From which step on are runs unstable?", reading, STABILITY, tuple(views)
    return Figure(*parts, ("varied parameter",), dense=True) if views else None


def _each_map(rows: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield the column that varies, the name and the cells of each map."""
    for varied, (what, _, _) in map_cells.VARIED.items():
        if len(found := map_cells.cells(rows, varied)):
            yield varied, what, found


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield limits of the scalar problem and outcomes of extreme cases on the page, all else as files."""
    if STABILITY in studies:
        rows = map_cells.prepared(studies[STABILITY].rows)
        yield from scalar_limits(map_cells.limits_of(rows))
        yield scalar_losses(map_cells.dampings_of(rows))
        yield boundaries(rows)
        yield other_bounds(map_cells.in_all_maps(rows))
        yield from runs_tables(rows, STABILITY)
    if EXTREMES in studies:
        answered = answers(studies[EXTREMES].rows)
        yield counts(answered)
        yield verdicts(answered)
        yield expectations(answered)
        yield checked(answered[answered["unguarded"].notna()])
        yield from runs_tables(studies[EXTREMES].rows, EXTREMES)


def scalar_limits(rows: pd.DataFrame) -> Iterator[Table]:
    """Yield the scalar problem's limits, measured and by theory: on the page where nothing damps, and all."""
    rows = rows.sort_values(["damping_ratio", "label"])
    columns = {
        "damping ratio ζ": rows["damping_ratio"].map("{:g}".format),
        **head(rows, "engine", "arm"),
        "theory ωh": rows["limit_frequency_step"].map(_limit),
        "measured ωh": rows["measured_limit_frequency_step"].map(_limit),
        "relative difference": rows["relative_difference"].map(number),
    }
    table = pd.DataFrame(columns)
    reading = f"The ωh from which on the oscillation of a mass on a spring grows; none: not up to {TRIED}."
    undamped = table[rows["damping_ratio"] == 0].drop(columns="damping ratio ζ")
    title = "Up to which step is an undamped contact stable?"
    if len(undamped):
        yield Table.of("stability-undamped-limits", title, reading, STABILITY, undamped).on_page()
    if len(table):
        title = "Limits of stability on the scalar problem"
        yield Table.of("stability-scalar-limits", title, reading, STABILITY, table)


def scalar_losses(rows: pd.DataFrame) -> Table | None:
    """Return the energy lost per step where nothing damps, measured and by theory; None of no rows."""
    rows = rows.sort_values(["frequency_step", "engine", "arm"])
    names = {"measured": "energy", "exact": "expected_energy", "leading term": "leading_energy"}
    columns = {
        "ωh": rows["frequency_step"].map("{:g}".format),
        **head(rows, "engine", "arm"),
        **{heading: rows[f"{name}_loss_per_step"].map(_loss) for heading, name in names.items()},
        "relative difference": rows["relative_difference"].map(number),
    }
    title = "Numerical damping on the scalar problem"
    reading = "Part of the energy lost per step. Exact: by the spectral radius of the method's step matrix."
    return Table.of("stability-scalar-damping", title, reading, STABILITY, columns) if len(rows) else None


def boundaries(rows: pd.DataFrame) -> Table | None:
    """Return where growth and divergence begin in each map, as omega h and as multiples of theory's limit."""
    lines = []
    for varied, what, of_map in _each_map(rows):
        for _, of in of_map.groupby("label", observed=True):
            limit, begins = map_cells.limit_of(of), map_cells.map_rows(of, varied)
            both = (part[name] for name in ("growth", "divergence") for part in (begins, begins / limit))
            in_contact = span(of["contact_step_s"] * 1e6)
            places = (*map(_part_of_rows, both), _part_of_rows(begins["accurate"]), in_contact)
            lines.append((what, of["engine"].iloc[0], of["arm"].iloc[0], _limit(limit), *places))
    heading = (
        *("map", "engine", "configuration", "theory ωh", "growth from ωh", "growth per theory"),
        *("divergence from ωh", "divergence per theory", "accurate up to ωh", "steps in contact [µs]"),
    )
    title = "Where growth and divergence begin"
    reading = "Ranges over the rows of a map; in brackets how many rows have it. ω is the first impact's."
    return Table("stability-boundaries", title, reading, STABILITY, heading, tuple(lines)) if lines else None


def other_bounds(in_maps: pd.DataFrame) -> Table | None:
    """Return how many verdicts of each configuration each bound would change, were it half or twice of it."""
    changes = map_cells.changed_verdicts(in_maps)
    if changes.empty:
        return None
    by_label = in_maps.groupby("label", observed=True)
    columns = {
        **head(by_label.first().reset_index(), "engine", "arm"),
        "verdicts": by_label.size().map(str),
        "accurate": by_label["severity"].agg(lambda of: (of == 0).sum()).map(str),
        **{map_cells.in_words(name): of.map(str) for name, of in changes.items()},
    }
    title, reading = "How many verdicts change with a bound", "Half of five impacts are two."
    return Table.of("stability-bounds", title, reading, STABILITY, columns)


def counts(answered: pd.DataFrame) -> Table:
    """Return how often each verdict fell on each configuration."""
    by_label = answered.groupby("label", observed=True)
    names = [verdict.value for verdict in Verdict if (answered["verdict"] == verdict).any()]
    tally = pd.crosstab(answered["label"], answered["verdict"].map(lambda verdict: verdict.value))[names]
    tally.insert(0, "cases", by_label.size())
    tally["not modelled"] = (answered["told_by"] == MODEL).groupby(answered["label"], observed=True).sum()
    tally["as theory asks"] = by_label["as_wanted"].sum()
    tally["by our checks"] = by_label["unguarded"].count()
    tally["as theory asks without our checks"] = by_label["wanted_unguarded"].sum()
    columns = {"configuration": list(tally.index), **{name: of.map(str) for name, of in tally.items()}}
    title, reading = "What came of the extreme cases?", "By our checks: cases that these ended or failed."
    return Table.of("extremes-counts", title, reading, EXTREMES, columns).on_page()


def checked(changed: pd.DataFrame) -> Table | None:
    """Return what our checks said, and what comes of the same runs without them; None of no rows."""
    columns = {
        "case": changed["scene"],
        **head(changed, "engine", "arm"),
        "the check": changed["reason"],
        "verdict without it": [verdict.value for verdict in changed["unguarded"]],
        "what came": changed["came"],
    }
    title = "Runs that a check of ours ended or failed"
    return Table.of("extremes-guards", title, "", EXTREMES, columns) if len(changed) else None


def expectations(answered: pd.DataFrame) -> Table:
    """Return what theory expects of every case."""
    cases = answered.drop_duplicates("scene")
    columns = {"group": cases["group"], "case": cases["scene"], "asked for": cases["wanted"].map(WANTED)}
    columns["theory"] = cases["theory"]
    return Table.of("extremes-expectations", "What theory expects", "", EXTREMES, columns)


def verdicts(answered: pd.DataFrame) -> Table:
    """Return every run: its verdict, the numbers that it rests on, and the engine's reason."""
    first = answered.iloc[0]
    motion, energy, constraint = (f"{first[f'{name}_bound']:g}" for name in JUDGED)
    reading = (
        f"Right: error up to {motion} of the motion, energy {energy} of that in play, gaps {constraint} of "
        f"the crank's length. Wrong: beyond {first['nonsense_factor']:g} times one of these."
    )
    columns = {
        "case": answered["scene"],
        **head(answered, "engine", "arm"),
        "longest step [s]": answered["step_s"].map(number),
        "verdict": [verdict.value for verdict in answered["verdict"]],
        "error": answered[JUDGED[0]].map(number),
        "of what": answered["judged"].astype(object).fillna(ABSENT),
        "energy": answered[ENERGY].map(number),
        "constraints": answered[CONSTRAINT].map(number),
        "told by": answered["told_by"].replace("", ABSENT),
        "reason": answered["reason"].replace("", ABSENT),
    }
    return Table.of("extremes-verdicts", "Every run of an extreme case", reading, EXTREMES, columns)


def _part_of_rows(values: pd.Series) -> str:
    """Return the least and the largest of some numbers, and of how many if not of all."""
    there = values.notna().sum()
    return span(values) if there in (0, len(values)) else f"{span(values)} ({there} of {len(values)})"


def _limit(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.4f}"


def _loss(value: float) -> str:
    return f"{value:.4e}" if abs(value) > ROUND_OFF else "0"


CHAPTER = Chapter("limits", "Limits", (STABILITY, EXTREMES), INTRODUCTION, findings, figures, tables)

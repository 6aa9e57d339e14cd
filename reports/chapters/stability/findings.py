"""Sentences of the stability study."""

from collections.abc import Sequence

from reports.chapters.stability.cells import (
    GROWING,
    REFUSED,
    VARIED,
    arms,
    cells,
    dampings_of,
    limit_of,
    limits_of,
    map_rows,
    severity,
)
from reports.chapters.stability.tables import span
from reports.parts import stated
from reports.results import Run
from reports.style import ENGINES, title
from reports.tables import in_text

#: What the scalar problem must recover of theory.
WITHIN = 0.01


def recovered(runs: Sequence[Run]) -> list[str]:
    """Return the sentences on the scalar problem."""
    compared = [run for run in limits_of(runs) if "limit_frequency_step" in run.values]
    unlimited = [run for run in limits_of(runs) if "limit_frequency_step" not in run.values]
    damped = [run for run in dampings_of(runs) if "leading_energy_loss_per_step" in run.values]
    out = []
    for what, some in (("limits of stability", compared), ("losses of energy per step", damped)):
        if some:
            worst = max(abs(run.values.get("relative_difference", 1.0)) for run in some)
            off = f"the worst off by {in_text(worst)} of its value"
            text = f"All {len(some)} {what} that theory knows are recovered, {off}."
            out.append(stated(text, worst <= WITHIN))
    unlimited = [run for run in unlimited if run.engine in ENGINES]  # theory was not asked about others
    if unlimited:
        none = not any("measured_limit_frequency_step" in run.values for run in unlimited)
        text = f"Where theory knows no limit none was found up to ωh = 64: {_titles(unlimited)}."
        out.append(stated(text, none))
    return out


def begun(runs: Sequence[Run], varied: str) -> list[str]:
    """Return the sentences on a map: who never grows, and where others begin to grow and to diverge."""
    here = cells(runs, varied)
    out = []
    calm = [name for name in arms(here) if not any(_grows(run) for run in here if run.name == name)]
    if calm:
        names = ", ".join(title(name) for name in calm)
        out.append(f"No run of {names} gains energy beyond its bound or diverges, at any step.")
    for name in arms(here):
        limit = limit_of([run for run in here if run.name == name])
        rows = map_rows(runs, varied, name)
        growth = [row.growth / limit for row in rows if row.growth and limit]
        divergence = [row.divergence / limit for row in rows if row.divergence and limit]
        if growth:
            text = f"{title(name)}: energy grows from {span(growth)} times theory's limit on"
            out.append(
                f"{text}, runs diverge from {span(divergence)} times it on." if divergence else f"{text}."
            )
    return out


def verdicts(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return the sentences on all maps: what accurate means, and that no limit is no promise."""
    here = [run for varied in VARIED for run in cells(runs, varied)]
    return (_honest(here), *_implicit(runs, here))


def _honest(here: Sequence[Run]) -> str:
    """Return what accurate means, checked on every cell that is called so."""
    called, bounds = [run for run in here if severity(run) == 0], here[0].values
    impacts = bounds["compared_impacts"]
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
    # A number that is not finite is not among the values.
    holds = all(run.ok and run.values.get(name, 2 * b) <= b for run in called for name, b in within.items())
    return stated(
        f"{len(called)} of {len(here)} runs are called accurate: in each of them all numbers are finite, the "
        f"energy balance holds within {energy:.0%} of the first impact's energy, the ideal joints within "
        f"{gap:.0%} of the clearance and, through {impacts:.0f} impacts, the slider's position within "
        f"{place:.0%} of it.",
        holds,
    )


def _implicit(runs: Sequence[Run], here: Sequence[Run]) -> list[str]:
    """Return the sentence on methods of fixed step that have no limit on a spring, and gain energy here."""
    fixed = {run.name for run in dampings_of(runs)}
    free = [run for run in here if run.name in fixed and "limit_frequency_step" not in run.values]
    grown = [run for run in free if _grows(run)]
    if not grown:
        return []
    return [
        f"Theory knows no limit for {_titles(free)}, yet {len(grown)} of their {len(free)} runs gain energy "
        "beyond its bound or diverge: stable on a spring is not stable on a contact that begins and ends."
    ]


def _grows(run: Run) -> bool:
    return GROWING <= severity(run) < REFUSED


def _titles(runs: Sequence[Run]) -> str:
    return ", ".join(title(name) for name in arms(runs))

"""Sentences of the stability study."""

import pandas as pd

from reports.chapters.stability.map_cells import (
    DIFFERENCE,
    LIMIT,
    MEASURED_LIMIT,
    VARIED,
    cells,
    dampings_of,
    limit_of,
    limits_of,
    map_rows,
)
from reports.chapters.stability.tables import span
from reports.parts import stated
from reports.style import ENGINES, labels
from reports.tables import in_text

#: What the scalar problem must recover of theory.
WITHIN = 0.01


def recovered(rows: pd.DataFrame) -> tuple[str, ...]:
    """Return the sentences on the scalar problem."""
    limits, dampings = limits_of(rows), dampings_of(rows)
    known = limits[LIMIT].notna()
    unlimited = limits[~known & limits["engine"].isin(ENGINES)]  # theory was not asked about others
    leading = dampings["leading_energy_loss_per_step"].notna()
    return (
        *_within("limits of stability", limits[known]),
        *_within("losses of energy per step", dampings[leading]),
        *_without_limit(unlimited),
    )


def _within(what: str, rows: pd.DataFrame) -> list[str]:
    if rows.empty:
        return []
    worst = rows[DIFFERENCE].fillna(1.0).abs().max()
    text = f"All {len(rows)} {what} that theory knows are recovered"
    return [stated(f"{text}, the worst off by {in_text(worst)} of its value.", worst <= WITHIN)]


def _without_limit(rows: pd.DataFrame) -> list[str]:
    if rows.empty:
        return []
    text = f"Where theory knows no limit none was found up to ωh = 64: {', '.join(labels(rows))}."
    return [stated(text, bool(rows[MEASURED_LIMIT].isna().all()))]


def begun(rows: pd.DataFrame, varied: str) -> tuple[str, ...]:
    """Return the sentences on a map: who never grows, and where others begin to grow and to diverge."""
    grows = rows.groupby("label", observed=True)["grows"].any()
    sentences = []
    if not grows.all():
        calm = ", ".join(grows.index[~grows])
        sentences.append(f"No run of {calm} gains energy beyond its bound or diverges, at any step.")
    for label, arm in rows.groupby("label", observed=True):
        multiples = map_rows(arm, varied) / limit_of(arm)
        growth, divergence = multiples["growth"].dropna(), multiples["divergence"].dropna()
        if len(growth):
            text = f"{label}: energy grows from {span(growth)} times theory's limit on"
            more = f", runs diverge from {span(divergence)} times it on" if len(divergence) else ""
            sentences.append(f"{text}{more}.")
    return tuple(sentences)


def verdicts(rows: pd.DataFrame) -> tuple[str, ...]:
    """Return the sentences on all maps: what accurate means, and that no limit is no promise."""
    in_maps = pd.concat([cells(rows, varied) for varied in VARIED])
    return (_honest(in_maps), *_implicit(in_maps, dampings_of(rows)))


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
    held = called[list(within)].le(pd.Series(within)).all(axis=None) and (called["status"] == "ok").all()
    return stated(
        f"{len(called)} of {len(rows)} runs are called accurate: in each of them all numbers are finite, the "
        f"energy balance holds within {energy:.0%} of the first impact's energy, the ideal joints within "
        f"{gap:.0%} of the clearance and, through {bounds['compared_impacts']:.0f} impacts, the slider's "
        f"position within {place:.0%} of it.",
        bool(held),
    )


def _implicit(in_maps: pd.DataFrame, dampings: pd.DataFrame) -> list[str]:
    """Return the sentence on methods of fixed step that have no limit on a spring, and gain energy here."""
    free = in_maps[in_maps["label"].isin(dampings["label"]) & in_maps[LIMIT].isna()]
    grown = free["grows"].sum()
    if not grown:
        return []
    return [
        f"Theory knows no limit for {', '.join(labels(free))}, yet {grown} of their {len(free)} runs gain "
        "energy beyond its bound or diverge: stable on a spring is not stable on a contact that begins and "
        "ends."
    ]

"""Sentences of the stability study."""

from collections.abc import Iterator

import pandas as pd

from reports.chapters.stability.map_cells import VARIED, cells, dampings_of, limit_of, limits_of, map_rows
from reports.chapters.stability.tables import span
from reports.parts import stated
from reports.style import ENGINES, labels
from reports.tables import in_text

#: What the scalar problem must recover of theory.
WITHIN = 0.01


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
        calm = ", ".join(grows.index[~grows])
        yield f"No run of {calm} gains energy beyond its bound or diverges, at any step."
    for label, arm in rows.groupby("label", observed=True):
        multiples = map_rows(arm, varied) / limit_of(arm)
        growth, divergence = multiples["growth"].dropna(), multiples["divergence"].dropna()
        if len(growth):
            text = f"{label}: energy grows from {span(growth)} times theory's limit on"
            yield text + (f", runs diverge from {span(divergence)} times it on." if len(divergence) else ".")


def verdicts(rows: pd.DataFrame) -> Iterator[str]:
    """Yield the sentences on all maps: what accurate means, and that no limit is no promise."""
    in_maps = pd.concat([cells(rows, varied) for varied in VARIED])
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

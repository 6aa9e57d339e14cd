"""What the clearance study's rows say, in sentences."""

import pandas as pd

from reports.chapters.clearance.tables import MODEL_FORM, SLIDER, finest
from reports.shared_tables import orders
from reports.tables import in_text


def orders_found(rows: pd.DataFrame, column: str) -> tuple[str, ...]:
    """Return the observed orders of the local error in a sentence per arm."""
    claimed = {
        label: [f"{order} on {scene}" for scene, order in by_scene.items() if order.slope]
        for label, by_scene in orders(rows, column).items()
    }
    return tuple(
        f"{label}: local position error of order {', '.join(found)}."
        for label, found in claimed.items()
        if found
    )


def impacts_found(rows: pd.DataFrame) -> tuple[str, ...]:
    """Return which arms find every impact at their most accurate settings."""
    rows = finest(rows).dropna(subset="impacts_matched")
    complete = (rows["impacts_unmatched"] + rows["impacts_missed"]) == 0
    return tuple(
        f"{label}: every impact of the model twin is found, and no other, on {found.sum()} of "
        f"{len(found)} scenes."
        for label, found in complete.groupby(rows["label"], observed=True)
    )


def laws_found(rows: pd.DataFrame) -> tuple[str, ...]:
    """Return, for each arm with a law of its own, which of the two differences is the larger."""
    sentences = []
    for label, arm in finest(rows).dropna(subset=MODEL_FORM).groupby("label", observed=True):
        larger, most = (arm[MODEL_FORM] > arm[SLIDER]).sum(), arm[MODEL_FORM].max()
        sentences.append(
            f"{label} solves a law of its own, "
            + (
                f"up to {in_text(most)} m from the scene's; that is more than its smallest numerical error "
                f"on {larger} of {len(arm)} scenes."
                if most
                else "with the same motion on all scenes here."
            )
        )
    return tuple(sentences)

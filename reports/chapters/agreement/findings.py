"""What the agreement study's rows say, in sentences: each is made from the rows or checked against them."""

from collections.abc import Iterator, Sequence

import pandas as pd

from reports.parts import stated
from reports.quantities import finished, floor, own_scenes, signal_errors, tolerances, uncertainty, value
from reports.shared_tables import orders, orders_in_text
from reports.style import labels, words
from reports.tables import in_text, listed, on_scenes, plain

#: Pymunk's two arms: as the library comes, and as an expert runs it.
AS_IT_COMES, TUNED = "pymunk (out of the box)", "pymunk (tuned)"
REFERENCE = "reference"
VIOLATION, ENERGY = "constraint_violation_m", "unaccounted_energy_part"


def orders_found(rows: pd.DataFrame, columns: Sequence[str]) -> Iterator[str]:
    """Yield the observed orders of each arm on all scenes, a sentence for each column."""
    by_column = {column: orders(rows, column) for column in columns}
    for label in labels(finished(rows)):
        for column, by_label in by_column.items():
            yield f"{label}, {_signal(column)}: {orders_in_text(by_label[label])}."


def pymunk_arms(rows: pd.DataFrame, column: str) -> Iterator[str]:
    """Yield why Pymunk is shown twice, with its orders, checked; nothing unless both arms have one."""
    by_label = orders(rows[own_scenes(rows)], column)
    slopes = [
        [order.slope for order in by_label.get(label, {}).values() if order.slope is not None]
        for label in (AS_IT_COMES, TUNED)
    ]
    if not all(slopes):
        return
    first, second = (
        f"observed on {len(each)} scenes: "
        + " to ".join(dict.fromkeys(f"{end:.2f}" for end in (min(each), max(each))))
        for each in slopes
    )
    sentence = (
        f"Pymunk is shown twice: {AS_IT_COMES} is the library as it comes, a first-order method "
        f"({first}). {TUNED} is how an expert would run it, with each step's joint error corrected "
        "in full and half a kick before the first step, which makes it the second-order leap-frog scheme "
        f"({second})."
    )
    yield stated(sentence, [set(map(round, each)) for each in slopes] == [{1}, {2}])


def best_at_step(at_step: pd.DataFrame) -> Iterator[str]:
    """Yield who has the smallest error of which signal at a step: of all, and without the reference."""
    for scene, of_scene in finished(at_step).groupby("scene"):
        rivals = of_scene[of_scene["engine"] != REFERENCE]
        groups = [group for group in (of_scene, rivals) if len(set(group["engine"])) > 1]
        if groups:
            step = in_text(of_scene["step_s"].iloc[0])
            winners = "; without the reference, ".join(map(_winners, groups))
            yield f"On {scene} at a step of {step} s the smallest error is {winners}."


def conservation(at_step: pd.DataFrame) -> Iterator[str]:
    """Yield with which arms the largest energy residual and violation of all scenes are least and most."""
    yield from _least_and_most(at_step, ENERGY)
    yield from _least_and_most(at_step, VIOLATION)


def _least_and_most(rows: pd.DataFrame, column: str) -> Iterator[str]:
    """Yield where the largest of a column is least and most."""
    worst = value(rows, column).groupby(rows["label"], observed=True).max().dropna()
    if worst.empty:
        return
    what, unit = words(column)
    ends = {"least": worst.idxmin(), "most": worst.idxmax()}
    arms = (
        f"{end} with {label}, {in_text(worst[label])}{unit and ' ' + unit}" for end, label in ends.items()
    )
    scenes = on_scenes(rows["scene"].nunique())
    sentence = f"At the steps of the table, {scenes}: the largest {what} is {listed(arms)}."
    failed = rows[rows["status"] != "ok"]
    if len(failed):
        sentence += (
            f" Left out is what failed: {listed(failed['label'].astype(str) + ' on ' + failed['scene'])}."
        )
    yield sentence


def errors_by_tolerance(rows: pd.DataFrame, column: str) -> Iterator[str]:
    """Yield of each arm how many times its tolerance its errors are at most, where truth can tell them."""
    sizes, doubt = value(rows, column), uncertainty(rows, column).fillna(0.0)
    times = (sizes / tolerances(rows))[sizes > doubt]
    for label, most in times.groupby(rows["label"], observed=True).max().items():
        what, unit = _signal(column), words(column)[1]
        scenes = rows["scene"][times.index][rows["label"] == label].nunique()
        asked = f"{plain(most)} times the tolerance asked for, {on_scenes(scenes)}"
        yield f"{label} has {what} errors, in {unit}, of at most {asked}."


def enough(rows: pd.DataFrame, setting: str, column: str) -> Iterator[str]:
    """Yield from which value of a setting on the error is as small as it gets, and which values fail."""
    for scene, of_scene in rows.sort_values(f"setting_{setting}").groupby("scene"):
        errors = value(of_scene, column).set_axis(of_scene[f"setting_{setting}"])
        seen, failed = errors.dropna(), errors.index[of_scene["status"] != "ok"]
        if seen.empty:
            continue
        good = seen.index[seen[::-1].cummax()[::-1] <= 2 * seen.min()]
        yield (
            f"On {scene} the {_signal(column)} error is within a factor of 2 of its smallest "
            + (
                f"from {good[0]} {setting} on."
                if len(good)
                else f"at no number of {setting} and all above it."
            )
            + (f" Runs fail with up to {failed.max()}." if len(failed) else " No run fails.")
        )


def _winners(rows: pd.DataFrame) -> str:
    """Return who has the smallest error in what; at the truth's uncertainty all are equal."""
    signals: dict[str, list[str]] = {}
    for column in signal_errors(rows):
        limit = max(rows[column].min(), floor(rows, column))
        winners = listed(rows["label"][rows[column] <= limit])
        signals.setdefault(winners, []).append(_signal(column))
    # The one with the most signals comes last, with all those not named before.
    *most, last = sorted(signals, key=lambda winners: len(signals[winners]))
    others = [f"that of {winners} in {listed(signals[winners])}" for winners in most]
    return listed([*others, f"that of {last} in every {'other ' if most else ''}signal"])


def _signal(column: str) -> str:
    return words(column)[0].replace(" error", "")

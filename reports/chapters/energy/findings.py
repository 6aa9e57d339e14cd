"""What the energy study's rows say, in sentences: each is made from the rows or checked against them."""

from collections.abc import Iterable

import pandas as pd

from reports.chapters.energy.rungs import (
    DISSIPATED,
    GAIN,
    GAP,
    GAP_EXPONENT,
    LARGEST_ENERGY,
    MEAN_POWER,
    OPENING_EXPONENT,
    POWER,
    resolution,
)
from reports.parts import stated
from reports.quantities import finished
from reports.tables import in_text, listed

PLAIN, BAUMGARTE, PROJECTED = "reference (none)", "reference (Baumgarte)", "reference (projection)"
AS_IT_COMES = "pymunk (out of the box)"
#: How far an exponent of time may be from the whole number that theory gives, and still be that.
EXPONENT = 0.1


def hidden_power(at_rung: pd.DataFrame) -> tuple[str, ...]:
    """Return the hidden power of every arm on each scene, smallest first, and what is not told from zero.

    ``at_rung`` are the rows at one rung for each scene.
    """
    scenes = finished(at_rung).groupby("scene")
    return tuple(
        _hidden_power(of_scene, resolution(at_rung[at_rung["scene"] == scene])) for scene, of_scene in scenes
    )


def _hidden_power(rows: pd.DataFrame, resolution: str) -> str:
    rows = rows.sort_values(POWER, key=abs)
    told, rest = rows[rows["told"]], rows[~rows["told"]]
    sizes = [
        f"{_signed(power)} W with {label}" for power, label in zip(told[POWER], told["label"], strict=True)
    ]
    doubtful = [
        f"{label} (± {in_text(half)} W)"
        for label, half in zip(rest["label"], rest["half_width"], strict=True)
    ]
    sentence = f"On {rows['scene'].iloc[0]} at {resolution} the hidden power is "
    sentence += listed(sizes) if sizes else "not told from zero with any arm"
    if sizes and doubtful:
        sentence += f"; it is not told from zero with {listed(doubtful)}"
    if rows["has_clearance"].any():
        dissipated = rows[DISSIPATED]
        sentence += f". The contacts dissipate {_span(map(in_text, (dissipated.min(), dissipated.max())))} W"
    return f"{sentence}."


def lost_as_it_comes(rows: pd.DataFrame, scene: str) -> tuple[str, ...]:
    """Return how much of a scene's energy Pymunk with its own settings loses, by step."""
    rows = finished(rows)
    rows = rows[(rows["label"] == AS_IT_COMES) & (rows["scene"] == scene)]
    if rows.empty:
        return ()
    parts = 100 * rows[GAIN] / rows[LARGEST_ENERGY]
    shown = listed(
        f"{part:.0f} % at a step of {in_text(step)} s"
        for part, step in zip(parts, rows["step_s"], strict=True)
    )
    return (f"On {scene} {AS_IT_COMES} loses {shown} of the largest kinetic energy by the end.",)


def drift(rows: pd.DataFrame) -> tuple[str, ...]:
    """Return, checked, how the reference's constraints drift with each stabilisation."""
    rows = finished(rows)
    ideal = rows[~rows["has_clearance"]].set_index("label")
    plain, bounded = (
        ideal.loc[ideal.index == label, [GAP_EXPONENT, OPENING_EXPONENT]].dropna()
        for label in (PLAIN, BAUMGARTE)
    )
    projected = ideal[ideal.index == PROJECTED]
    sentences = []
    if len(plain):
        gaps, speeds = (
            _span(f"{exponent:.2f}" for exponent in (of.min(), of.max())) for _, of in plain.items()
        )
        sentence = (
            "Without stabilisation the reference's constraints drift as theory has it for RK4: the speeds at "
            f"which gaps open grow in proportion to time (exponents {speeds} in "
            f"{len(plain)} runs), the gaps with its square ({gaps})."
        )
        sentences.append(stated(sentence, bool(((plain - [2, 1]).abs() < EXPONENT).all(axis=None))))
    if len(bounded):
        largest = bounded.max(axis=None)
        sentence = f"Baumgarte's stabilisation bounds them: exponents are at most {max(0.0, largest):.2f}."
        sentences.append(stated(sentence, largest < EXPONENT))
    if len(projected):
        sentence = f"Projection leaves round-off alone: gaps of at most {in_text(projected[GAP].max())} m."
        sentences.append(stated(sentence, bool(projected[GAP_EXPONENT].isna().all())))
    return tuple(sentences)


def ledger_closes(at_rung: pd.DataFrame) -> tuple[str, ...]:
    """Return the largest part of what contacts dissipate that is missing or too much, by arm."""
    rows = finished(at_rung)
    rows = rows[rows[DISSIPATED] > 0]
    parts = rows[MEAN_POWER].abs() / rows[DISSIPATED]
    worst = parts.groupby(rows["label"], observed=True).max().sort_values()
    if worst.empty:
        return ()
    told = listed(f"{in_text(part)} with {label}" for label, part in worst.items())
    return (f"Of what contacts dissipate, the part that the ledger lacks or has too much is at most {told}.",)


def _signed(value: float) -> str:
    return f"{'−' if value < 0 else '+'}{in_text(abs(value))}"


def _span(ends: Iterable[str]) -> str:
    """Return two ends as a range, or as one number if they read the same."""
    return " to ".join(dict.fromkeys(ends))

"""What each chapter finds, in the few sentences that it opens with."""

from collections.abc import Callable, Iterator, Mapping

import pandas as pd

from reports.chapters import agreement, clearance, predictability, stability
from reports.chapters.answer import sentences
from reports.chapters.answer.picks import races
from reports.chapters.answer.trust import hidden, horizons
from reports.chapters.extremes.verdict import MODEL, answers
from reports.chapters.predictability import data
from reports.chapters.predictability.statistics import student_interval
from reports.chapters.stability import map_cells
from reports.parts import Finding, Number
from reports.quantities import finished, floor, value
from reports.results import Results, with_columns
from reports.tables import in_text, listed, plain


def right_on_ideal_joints(results: Results) -> Iterator[Finding]:
    """Yield how near each engine's best run comes to the truth on the scene where it does worst."""
    rows = finished(with_columns(results.rows, agreement.POSITION))
    yield from _nearest(rows, agreement.POSITION, "On ideal joints")


def right_with_clearance(results: Results) -> Iterator[Finding]:
    """Yield the same with clearance, by each engine's own law, and how far that is from the scene's."""
    rows = finished(with_columns(results.rows, clearance.SLIDER, clearance.MODEL_FORM))
    yield from _nearest(rows, clearance.SLIDER, "With clearance, of its own contact law,")
    for engine, of_engine in rows.dropna(subset=clearance.MODEL_FORM).groupby("engine", sort=False):
        worst = of_engine.loc[of_engine[clearance.MODEL_FORM].idxmax()]
        if (most := float(worst[clearance.MODEL_FORM])) > 0:
            yield Finding(
                f"The law that {engine} solves is itself up to {in_text(most)} m from the scene's, on "
                f"{worst['scene']}, the worst of {of_engine['scene'].nunique()} scenes.",
                f"model-form-{engine}",
                [Number(most, "m")],
            )


def _nearest(rows: pd.DataFrame, column: str, where: str) -> Iterator[Finding]:
    """Yield for each engine the smallest slider error of its best arm, on the scene where that is largest."""
    best = rows.assign(error=value(rows, column)).dropna(subset="error")
    best = best.sort_values("error").drop_duplicates(["engine", "scene"])
    worst = best.sort_values("error").drop_duplicates("engine", keep="last")
    scenes = best["engine"].value_counts()
    for row in worst.itertuples():
        doubt = floor(rows[rows["scene"] == row.scene], column)
        least = float(str(row.error))
        size = f"{in_text(max(least, doubt))} m{', the uncertainty of truth' if least <= doubt else ''}"
        yield Finding(
            f"{where} the best runs of {row.engine} have the slider right to {size}, "
            f"on {row.scene}, the worst of {scenes[row.engine]} scenes.",
            f"nearest-{column}-{row.engine}",
            [Number(least, "m", max(0.0, least - doubt), least + doubt)],
        )


def cost(results: Results) -> Iterator[Finding]:
    """Yield who is the cheapest for each target on each scene with clearance."""
    yield from sentences.on_each_scene(races(results))


def energy_kept(results: Results) -> Iterator[Finding]:
    """Yield who keeps the energy of scenes with contact, and who does not."""
    yield from sentences.who_keeps_energy(hidden(results))


def predictable(results: Results) -> Iterator[Finding]:
    """Yield for how long motions are known, and how fast they part where that is chaos."""
    for scene, turns in horizons(results).items():
        yield Finding(
            f"On {scene} the slider is known to 100 µm for {plain(turns)} revolutions, however it is "
            "computed.",
            f"known-{scene}",
            [Number(turns, "revolutions")],
        )
    for scene, starts in data.exponents(data.prepared(results.rows)).items():
        values = data.measured(starts)
        if len(values) == len(starts) > 1:
            interval = student_interval(values)
            yield Finding(
                f"Neighbouring motions on {scene} part by a factor of e some {plain(interval.mean)} times in "
                "a revolution: what holds beyond are averages, not moments.",
                f"exponent-{scene}",
                [Number(interval.mean, "per revolution", interval.low, interval.high)],
            )


def stable(results: Results) -> Iterator[Finding]:
    """Yield whose runs never gain energy on the maps, and whose do most often."""
    in_maps = map_cells.in_all_maps(map_cells.prepared(results.rows))
    if in_maps.empty:
        return
    of_label = in_maps.groupby("label", observed=True)["grows"]
    grows, runs = of_label.mean(), of_label.size()
    calm = list(grows.index[grows == 0])
    if calm:
        yield Finding(
            f"None of {runs[calm].sum()} runs of {listed(calm)} gains energy beyond its bound, at any step.",
            "calm",
        )
    if len(calm) < len(grows):
        worst = grows.idxmax()
        yield Finding(
            f"{worst} gains energy or diverges in {plain(100 * grows.max())} % of its {runs[worst]} runs; no "
            f"other of {len(grows)} arms does so more often.",
            "grows",
            [Number(100 * float(grows.max()), "%")],
        )


def hard(results: Results) -> Iterator[Finding]:
    """Yield who does what theory asks most often and least often on the hard cases."""
    judged = answers(results.rows)
    judged = judged[judged["told_by"] != MODEL]
    shares = judged.groupby("label", observed=True)["as_wanted"].agg(["sum", "size"])
    part = shares["sum"] / shares["size"]
    for name, label, how in (("most", part.idxmax(), "most"), ("least", part.idxmin(), "least")):
        done, cases = shares.loc[label]
        yield Finding(
            f"{label} does what theory asks in {done} of {cases} hard cases, the {how} of all.",
            f"hard-{name}",
            [Number(float(done), "cases")],
        )


#: By the name of the study's folder.
HEADLINES: Mapping[str, Callable[[Results], Iterator[Finding]]] = {
    agreement.STUDY: right_on_ideal_joints,
    clearance.STUDY: right_with_clearance,
    "work-precision": cost,
    "energy": energy_kept,
    predictability.STUDY: predictable,
    stability.STUDY: stable,
    "extremes": hard,
}

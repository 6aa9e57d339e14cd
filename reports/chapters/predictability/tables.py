"""Tables of the predictability study."""

import math
from collections.abc import Mapping

import pandas as pd

from reports.chapters.predictability import data
from reports.chapters.predictability.statistics import CONFIDENCE, student_interval
from reports.parts import Table
from reports.results import FloatArray
from reports.shared_tables import speakers, unfinished
from reports.tables import ABSENT

_PERCENT = f"{100 * CONFIDENCE:.0f} %"


def horizons(rows: pd.DataFrame) -> Table:
    """Return the horizon of each scene and tolerance."""
    turns = rows["revolutions"].map("{:.0f} revolutions".format)
    cells = {
        "scene": rows["scene"],
        "followed for": turns.where(rows["revolutions"] > 0, rows["end_time_s"].map("{:g} s".format)),
    }
    for words, (tolerance, _) in data.TOLERANCES.items():
        cells[f"{tolerance}: perturbed [ms]"] = _horizon(rows, f"horizon_{words}")
        cells[f"{tolerance}: step halved [ms]"] = rows[f"horizon_halved_{words}_s"].map(_milliseconds)
    return Table.of(
        "predictability-horizons",
        "Predictability horizons",
        "The time at which the slider of the reference's perturbed twins, and of its step-halved one, is off "
        "by more than a tolerance. In brackets are the least and the largest of six perturbations, of both "
        "signs and half to twice the nominal size: they bound the median with a confidence of 97 %. A dash "
        "is a horizon beyond the end of the run.",
        cells,
    )


def _horizon(rows: pd.DataFrame, name: str) -> pd.Series:
    median, least, largest = (rows[f"{name}{part}_s"] for part in ("", "_least", "_largest"))
    most = largest.map(_milliseconds).where(largest.notna(), "later")
    text = median.map(_milliseconds) + " (" + least.map(_milliseconds) + " to " + most + ")"
    return text.where(least.notna(), ABSENT)


def _milliseconds(time_s: float) -> str:
    return ABSENT if math.isnan(time_s) else f"{1e3 * time_s:.3g}"


def exponents(by_scene: Mapping[str, pd.DataFrame]) -> Table:
    """Return the exponent of each scene with its interval, by the part of the run that it is from."""
    cells = []
    for scene, starts in by_scene.items():
        by_part = [data.measured(starts, part) for part in data.PARTS]
        shown = [_interval(values) if len(values) > 1 else ABSENT for values in by_part]
        settled = str(starts["settled"].eq(True).sum())
        length = f"{starts['revolutions'].max():.0f}"
        cells.append((scene, str(len(starts)), settled, str(len(by_part[-1])), length, *shown))
    return Table(
        "predictability-exponents",
        "Finite-time Lyapunov exponents",
        f"Per revolution, means over starts with half of Student's {_PERCENT} interval, from the first "
        "quarter, the first half and all of the run: where they agree the exponent has converged. A start "
        "that settles to continuous contact has no exponent, nor has one whose companion could not be put "
        "back until half of the run.",
        (
            *("scene", "starts", "settled", "with an exponent", "revolutions"),
            *(f"from {part}" for part in data.PARTS.values()),
        ),
        tuple(cells),
    )


def means(by_label: data.Ensembles, scene: str) -> Table:
    """Return the mean of every quantity of every ensemble, with its interval."""
    quantities = data.shown(by_label)
    cells = []
    for label, members in by_label.items():
        columns = data.matrix(members, quantities).T
        shown = [_interval(values) if len(values) > 1 else f"{values[0]:.3g}" for values in columns]
        cells.append((label, str(len(members)), *shown))
    return Table(
        f"predictability-means-{scene}",
        f"Ensembles on {scene}",
        f"Means over members and half of Student's {_PERCENT} interval.",
        ("ensemble", "members", *(data.QUANTITIES[q] for q in quantities)),
        tuple(cells),
    )


def _interval(values: FloatArray) -> str:
    mean = student_interval(values)
    return f"{mean.mean:.3g} ± {(mean.high - mean.low) / 2:.1g}"


def failures(rows: pd.DataFrame) -> Table | None:
    """Return the runs that did not finish, a line for each reason."""
    failed = unfinished(rows).astype({"label": str})
    reasons = ["scene", "label", "status", "said", "reason"]
    counts = failed.assign(said=speakers(failed)).groupby(reasons).size().reset_index(name="runs")
    if counts.empty:
        return None
    return Table.of(
        "predictability-failures",
        "Runs that did not finish",
        "Runs with the same reason are counted.",
        {
            "scene": counts["scene"],
            "engine": counts["label"],
            "outcome": counts["status"],
            "said by": counts["said"],
            "reason": counts["reason"],
            "runs": counts["runs"].map(str),
        },
    )

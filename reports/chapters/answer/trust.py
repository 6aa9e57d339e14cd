"""What not to trust: who hides energy, who fails on hard cases, and from when on nobody knows the motion."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from reports.chapters.energy.rungs import SMALL, UNACCOUNTED, at_rungs, middle_rungs, prepared
from reports.chapters.extremes.verdict import MODEL, answers
from reports.chapters.predictability import data
from reports.quantities import finished
from reports.results import Results
from reports.tables import ABSENT, setting

#: What an engine may hide, as a part of the energy in play: a hundredth of what contacts dissipate, or less.
HIDDEN_PART = SMALL
#: A slider that is off by this much is lost, as a column's name and the text have it.
LOST, LOST_IN_WORDS = "100um", "100 µm"


@dataclass(frozen=True)
class Hidden:
    """The most that an arm hides on scenes with contact, as a ``part`` of the energy in play.

    That is on the ``worst_scene``. The arm finished so many ``scenes``, ``of_scenes`` that any arm did.
    """

    engine: str
    label: str
    setting: str
    part: float
    worst_scene: str
    scenes: int
    of_scenes: int


def hidden(energy: Results) -> list[Hidden]:
    """Return what every arm hides at most on the scenes with contact that it finished, the least first."""
    rows = prepared(energy.rows)
    rows = finished(at_rungs(rows, middle_rungs(rows)))
    rows = rows[rows["has_clearance"]].dropna(subset=UNACCOUNTED)
    arms = [
        Hidden(
            of["engine"].iloc[0],
            label,
            _setting(of),
            float(of[UNACCOUNTED].max()),
            of["scene"][of[UNACCOUNTED].idxmax()],
            len(of),
            rows["scene"].nunique(),
        )
        for label, of in rows.groupby("label", observed=True)
    ]
    return sorted(arms, key=lambda arm: arm.part)


def _setting(rows: pd.DataFrame) -> str:
    values = rows["tolerance"].fillna(rows["step_s"])
    return setting(rows["knob"].iloc[0], values.min(), values.max())


def breaks(studies: Mapping[str, Results], engine: str, label: str) -> str:
    """Return in a few words where an arm breaks: on how many hard cases, and which scenes it refuses.

    Of hard cases those count that its model here expresses, and what it does in them without guards. Of an
    arm that was not run on them they are those of the engine's first arm there.
    """
    said = []
    if "extremes" in studies:
        rows = studies["extremes"].rows
        of_engine = answers(rows[rows["engine"] == engine]).sort_values("label")
        labels = list(of_engine["label"].unique())
        if labels:
            of = of_engine[of_engine["label"] == (label if label in labels else labels[0])]
            asked = of[of["told_by"] != MODEL]
            said.append(f"against theory in {(~asked['wanted_unguarded']).sum()} of {len(asked)} hard cases")
        else:
            said.append("hard cases not run")
    if "clearance" in studies:
        rows = studies["clearance"].rows
        never = (
            rows[rows["label"] == label].groupby("scene")["status"].agg(lambda of: set(of) == {"unsupported"})
        )
        if never.any():
            said.append(f"no model here of {never.sum()} of {len(never)} scenes with clearance")
    return "; ".join(said) or ABSENT


def horizons(predictability: Results) -> dict[str, float]:
    """Return after how many revolutions a slider is lost whose start is moved by a hair, by scene."""
    rows = data.horizons(data.prepared(predictability.rows))
    lost = rows[[f"horizon_{LOST}_s", f"horizon_halved_{LOST}_s"]].min(axis=1)
    turns = (lost * rows["revolutions"] / rows["end_time_s"]).set_axis(rows["scene"])
    return {str(scene): float(count) for scene, count in turns[turns > 0].sort_values().items()}

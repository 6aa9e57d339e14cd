"""What the search of settings found: how much cheaper than a ladder a turned knob is, error by error."""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from reports.equal_error import Judged, arrival, levels, ratio
from reports.quantities import finished, with_largest
from reports.results import read_study, with_columns

#: A ladder is beaten by what surely takes less than this part of its time.
BEATEN = 0.75
#: A rung has its error by chance, where errors of either sign meet, unless the next finer one's is below this
#: part of it.
FALLS = 0.8
POSITION, TORQUE, FORCE = (
    "slider_position_error_m",
    "driver_torque_error_N_m",
    "largest_joint_force_error_N",
)


def found(folder: Path) -> pd.DataFrame:
    """Return a row per scene, signal, error and engine: the ladder's cheapest way there, and the search's.

    ``part`` is the time of the search's in parts of the ladder's, over the rounds that have both, ``low`` and
    ``high`` are the ends of its 95 % interval; it is 1 where no turned knob is cheaper, and NaN where the
    ladder does not get there. The least time of a round's repeats counts: a search takes so long that the
    machine is not quiet throughout.

    Raises:
        NoResults, BrokenResults: see ``reports.results.read_study``.
    """
    rows = with_columns(finished(read_study(folder).rows), "round", "compiled_anew", TORQUE)
    rows = rows.assign(solve_time_s=rows["least_solve_time_s"])
    rows = with_largest(rows, FORCE, r"joint_\w_force_error_N")
    labels = rows["label"].astype(str) + rows["turned"].map(lambda knob: f", {knob}" if knob else "")
    rows = rows.assign(label=labels)
    kinematic = rows["scene"].isin(_driven_ideal(rows))
    judged = ((rows[~kinematic], POSITION), (rows[kinematic], TORQUE), (rows, FORCE))
    lines = [line for some, column in judged for line in _lines(Judged("search", some, column))]
    return pd.DataFrame(lines)


def beaten(record: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a record where a turned knob surely beats the ladder."""
    return record[record["high"] < BEATEN]


def _driven_ideal(rows: pd.DataFrame) -> set[str]:
    """Return the scenes whose slider's position is the drive's doing, whatever the engine."""
    loose = rows.filter(regex="^clearance_").notna().any(axis=1)
    return set(rows["scene"][rows[TORQUE].notna()]) - set(rows["scene"][loose])


def _lines(judged: Judged) -> Iterator[dict[str, object]]:
    for scene, (rungs, floor) in judged.ladders.items():
        finer = rungs.groupby("label", observed=True)["error"].shift(-1)
        meant = rungs[finer.isna() | (finer < FALLS * rungs["error"])]
        for engine, own in meant.groupby("engine"):
            of_ladder = own[~own["label"].str.contains(" = ", regex=False)]
            for error in levels(own, floor):
                usual, best = arrival(of_ladder, error), arrival(own, error)
                assert best is not None  # levels lie within the errors of its rungs
                share = ratio(best, usual) if usual else None
                yield {
                    "scene": scene,
                    "signal": judged.column,
                    "error": error,
                    "engine": engine,
                    "ladder": f"{usual.label}, {usual.setting}" if usual else "",
                    "search": f"{best.label}, {best.setting}",
                    "part": share.median if share else None,
                    "low": share.low if share else None,
                    "high": share.high if share else None,
                }

"""The search of settings: what it calls beaten, and that its record is of today's ladders and beats none."""

from pathlib import Path

import pandas as pd
import pytest

from engine_models.arms import Arm
from studies.command.search import beaten, found
from studies.work_precision import settings_search
from studies.work_precision.study import ladder
from tests.helpers.row_files import write_rows

RECORD = Path(__file__).parents[3] / "docs/reference/settings-search.csv"
ROUNDS = 3


def searched(folder: Path, ladders: dict[str, dict[float, tuple[float, float]]]) -> pd.DataFrame:
    """Return the record of runs by what was turned, step in s, and then error in m and time in s."""
    rows = list[dict[str, object]]()
    for turned, rungs in ladders.items():
        for step, (error, time) in rungs.items():
            common = {
                "fingerprint": "x",
                "scene": "s",
                "engine": "pymunk",
                "arm": "tuned",
                "label": "pymunk (tuned)",
                "step_s": step,
                "status": "ok",
                "reason": "",
                "turned": turned,
                "setting_turned": turned,
            }
            rows.append(
                {"case": f"{len(rows)}", **common, "slider_position_error_m": error, "steps": 1 / step}
            )
            for k in range(ROUNDS):
                timed = {
                    "round": k,
                    "timed": True,
                    "solve_time_s": time * (1 + 0.01 * k),
                }
                rows.append({"case": f"{len(rows)}", **common, **timed})
    write_rows(folder / "rows.jsonl", rows)
    return found(folder)


#: Errors in m and run times in s by the step: of order two.
PLAIN = {0.1: (1e-2, 1.0), 0.01: (1e-4, 10.0), 0.001: (1e-6, 100.0)}


@pytest.mark.parametrize(("share", "counts"), [(0.5, True), (0.7, True), (0.8, False), (1.5, False)])
def test_a_turned_knob_beats_a_ladder_by_more_than_a_quarter(
    tmp_path: Path, share: float, counts: bool
) -> None:
    turned = {step: (error, share * time) for step, (error, time) in PLAIN.items()}
    record = searched(tmp_path, {"": PLAIN, "iterations = 6": turned})
    assert sorted(record["error"]) == pytest.approx([1e-5, 1e-4, 1e-3, 1e-2])
    assert record["part"].to_numpy() == pytest.approx(min(share, 1.0), rel=0.02)
    assert len(beaten(record)) == (len(record) if counts else 0)


def test_a_rung_whose_error_falls_no_further_is_one_by_chance(tmp_path: Path) -> None:
    lucky = {0.1: (0.9e-4, 0.5), 0.01: (0.8e-4, 50.0), 0.001: (1e-6, 500.0)}
    record = searched(tmp_path, {"": PLAIN, "half_kick_start = False": lucky})
    assert len(record)
    assert beaten(record).empty, "0.9e-4 m at a twentieth of the time is where errors change their sign"


def test_the_record_is_of_these_ladders_and_none_of_them_is_beaten() -> None:
    record = pd.read_csv(RECORD)
    assert beaten(record).empty
    scenes = {scene.name: scene for scene in settings_search.scenes(full=False)}
    assert set(record["scene"]) == set(scenes)
    assert {"reference", "exudyn", "pymunk", "scipy"} <= set(record["engine"])
    labels = {name: {rung.arm.label for rung in ladder(scene, full=False)} for name, scene in scenes.items()}
    for row in record[record["ladder"].notna()].itertuples():
        assert row.ladder.rpartition(", ")[0] in labels[row.scene], (
            f"{row.ladder} is in no ladder of {row.scene}"
        )


def test_every_arm_with_knobs_is_in_a_ladder() -> None:
    arms = {rung.arm for scene in settings_search.scenes(full=True) for rung in ladder(scene, full=False)}
    idle = [arm.label for arm in settings_search.KNOBS if arm not in arms]
    assert not idle, f"turned on no scene: {idle}"
    assert all(isinstance(arm, Arm) for arm in arms)

"""Runs, engines and scenes that are asked for wrongly in Python are refused in the command line's words."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine_models.engine import MOST_SAMPLES, RunSettings
from engine_models.engines import engine_class, engine_module, make_engine
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.scene.data import SceneError
from engine_models.scene.drives import TableDrive
from engine_models.scene.file import from_toml, load
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene, Start
from tests.helpers.command import crankslider

LOOSE = SCENES["clearance-compressor"]()
ENGINES = "reference, exudyn, pymunk, scipy or my_module:MyEngine"
COUNT = f"an integer >= 1 and <= {MOST_SAMPLES}"


def copied(**update: Any) -> Scene:
    return LOOSE.model_copy(update=update)


BAD: list[tuple[Callable[[], object], str]] = [
    (lambda: RunSettings(-1e-5, 10), "step_s: expected a finite number > 0, got -1e-05"),
    (lambda: RunSettings(0.0, 10), "step_s: expected a finite number > 0, got 0.0"),
    (lambda: RunSettings(inf, 10), "step_s: expected a finite number > 0, got inf"),
    (lambda: RunSettings(nan, 10), "step_s: expected a finite number > 0, got nan"),
    (lambda: RunSettings("1", 10), 'step_s: expected a finite number > 0, got "1"'),  # type: ignore[arg-type]
    (lambda: RunSettings(1e-5, 0), f"samples: expected {COUNT}, got 0"),
    (lambda: RunSettings(1e-5, 100_001), f"samples: expected {COUNT}, got 100001"),
    (lambda: RunSettings(1e-5, 2.0), f"samples: expected {COUNT}, got 2.0"),  # type: ignore[arg-type]
    (lambda: RunSettings(1e-5, True), f"samples: expected {COUNT}, got true"),
    (lambda: replace(RunSettings(1e-5, 10), samples=-1), f"samples: expected {COUNT}, got -1"),
    (lambda: engine_class("adams"), f'engine: expected {ENGINES}, got "adams"'),
    (lambda: engine_module(""), f'engine: expected {ENGINES}, got ""'),
    (lambda: make_engine("Pymunk"), f'engine: expected {ENGINES}, got "Pymunk"'),
    (
        lambda: make_engine("pymunk", iterations=-1),
        "iterations: expected an integer > 0 and < 2147483648, got -1",
    ),
    (
        lambda: make_engine("reference", stabilisation="some"),
        'stabilisation: expected "none", "baumgarte" or "projection", got "some"',
    ),
    (lambda: load(Path("/no such scene")), "No such file or directory"),
    (
        lambda: from_toml("name = 'x'\nend_time_s = -1"),
        "end_time_s: expected a finite number > 0 and >= 1e-100, got -1",
    ),
    (lambda: copied(end_time_s=-1.0), "end_time_s: expected a finite number > 0 and >= 1e-100, got -1.0"),
    (
        lambda: copied(end_time_s="1"),
        "end_time_s: expected a finite number > 0 and >= 1e-100, or text with a unit such as '1 s', got \"1",
    ),
    (
        lambda: copied(gravity_m_s2=nan),
        "gravity_m_s2: expected a finite number >= 0 or a list of two, got nan",
    ),
    (lambda: copied(speed=1.0), "speed: expected the key name, end_time_s"),
    (lambda: copied(rod=None), "rod: expected a section beside slider, got nothing"),
    (lambda: copied(crank=5), "crank: expected a section, got 5"),
    (lambda: copied(drive=LOOSE.start), 'drive.kind: expected "constant-speed", "fluctuating", "free"'),
    (
        lambda: copied(start={"crank_angle_rad": 0.0, "crank_speed_rad_s": inf}),
        "start.crank_speed_rad_s: expected a finite number, got inf",
    ),
    (
        lambda: copied(start=Start(crank_angle_rad=1.0, crank_speed_rad_s=0.0), rod=short_rod()),
        "rod.length_m: expected at least crank.length_m = 0.05 with drive.kind = 'motor'",
    ),
    (
        lambda: LOOSE.crank.model_copy(update={"mass_kg": 0.0}),
        "mass_kg: expected a finite number > 0, got 0.0",
    ),
    (
        lambda: LOOSE.clearance.model_copy(update={"B": {"law": "hertz"}}),
        "B.radial_clearance_m: expected a finite number > 0, got nothing",
    ),
    (
        lambda: loose_joint().model_copy(update={"law": "hertz"}),
        "restitution: expected nothing with law = 'hertz', got 0.9",
    ),
]


def short_rod() -> object:
    assert LOOSE.rod is not None
    return LOOSE.rod.model_copy(update={"length_m": 0.04})


def loose_joint() -> Any:
    return LOOSE.clearance.B


@pytest.mark.parametrize(("call", "words"), BAD, ids=[words.split(",")[0] for _, words in BAD])
def test_what_is_asked_for_wrongly_is_refused_in_one_line(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError) as refusal:  # noqa: PT011  the words are compared
        call()
    line = str(refusal.value)
    assert words in line
    assert "\n" not in line
    assert "pydantic" not in line


def test_a_copy_is_refused_in_the_words_of_the_file_and_of_the_command(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as copy:
        copied(end_time_s=-1.0)
    file = tmp_path / "mine.toml"
    file.write_text(LOOSE.to_toml().replace("end_time_s = 0.08", "end_time_s = -1.0"))
    with pytest.raises(SceneError) as read:
        load(file)
    assert str(read.value) == f"{file}: line 2: {copy.value}"
    assert crankslider("simulate", file).stderr == f"error: {read.value}\n"
    said = crankslider("simulate", "ideal-free", "--samples", 100_001).stderr
    with pytest.raises(ValueError, match="samples") as asked:
        RunSettings(1e-5, 100_001)
    assert said.replace('"', "") == f"error: --{asked.value}\n", "what came was typed"


def test_what_is_valid_is_taken() -> None:
    assert RunSettings(1, 1).step_used_s(0.5) == 0.5
    assert RunSettings(np.float64(1e-5), MOST_SAMPLES).samples == MOST_SAMPLES
    assert make_engine("pymunk", iterations=5) == engine_class("pymunk")(iterations=5)
    copy = copied(end_time_s=0.1, start={"crank_angle_rad": 1.0, "crank_speed_rad_s": 2.0})
    assert (copy.end_time_s, copy.start) == (0.1, Start(crank_angle_rad=1.0, crank_speed_rad_s=2.0))
    assert copy.model_copy(update={"end_time_s": 0.08, "start": LOOSE.start}) == LOOSE
    assert LOOSE.model_copy() == LOOSE == LOOSE.model_copy(deep=True)


def test_a_scene_by_a_table_can_be_begun_within_it() -> None:
    """Clock, speed and end are changed together: each alone would leave the table."""
    table = TableDrive(
        kind="table", time_s=(0.0, 0.1, 0.2, 0.3, 0.4), angle_rad=(0.0, 0.1, 0.4, 0.9, 1.6)
    )  # angle 10 t^2
    start = Start(crank_angle_rad=0.0, crank_speed_rad_s=0.0)
    driven = SCENES["ideal-driven"]().model_copy(update={"drive": table, "start": start, "end_time_s": 0.4})
    position, velocity = start_state(driven)
    velocity = velocity + 0.0
    velocity[0, 2] = 4.0  # at 0.2 s
    with pytest.raises(SceneError, match=r"drive.time_s.4: expected at least 0.6, when the scene ends"):
        started_from(driven, position, velocity, 0.2)
    later = started_from(driven, position, velocity, 0.2, 0.2)
    assert (later.start.time_s, later.start.crank_speed_rad_s, later.end_time_s) == (0.2, 4.0, 0.2)

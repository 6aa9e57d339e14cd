"""Whole turns of the crank at the start change its angle and nothing else."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.helpers.command import crankslider
from tests.helpers.engines import supporting

TURNS = 100_000
#: The turns as a double are off by 2.4e-16 rad each, their sum by half its spacing; the crank is 0.15 m long.
TOLERANCE_RAD = 2e-10


def begun_at(scene: Scene, angle_rad: float) -> Scene:
    start = scene.start.model_copy(update={"crank_angle_rad": angle_rad})
    return scene.model_copy(update={"start": start, "end_time_s": 2e-3})


@pytest.mark.parametrize(
    ("engine", "name"),
    [(e, name) for name in ("ideal-driven", "ideal-free") for e in supporting(SCENES[name]())],
)
def test_whole_turns_of_the_crank_change_only_its_angle(engine: str, name: str) -> None:
    angle = SCENES[name]().start.crank_angle_rad
    turned = angle + TURNS * 2 * math.pi
    plain, wound = (
        make_engine(engine).simulate(begun_at(SCENES[name](), at), RunSettings(1e-5, 10))
        for at in (angle, turned)
    )
    assert wound.position[0, 0, 2] == pytest.approx(turned, rel=0, abs=TOLERANCE_RAD)
    rise = wound.position[:, 0, 2] - plain.position[:, 0, 2]
    assert np.abs(rise - TURNS * 2 * math.pi).max() <= TOLERANCE_RAD
    off = np.abs(wound.position[:, -1, 0] - plain.position[:, -1, 0]).max()
    assert off <= TOLERANCE_RAD, f"slider off by {off:.3g} m"


@pytest.mark.parametrize("angle", ["1e12", "-1e7"])
def test_an_angle_without_digits_is_refused_by_its_field(angle: str, tmp_path: Path) -> None:
    text = crankslider("show", "ideal-driven").stdout
    path = tmp_path / "scene.toml"
    path.write_text(re.sub("crank_angle_rad = .*", f"crank_angle_rad = {angle}", text))
    done = crankslider("simulate", path)
    assert done.code == 2
    assert "start.crank_angle_rad: expected" in done.stderr

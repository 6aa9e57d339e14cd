"""Where the truth has no answer it says so: singular loops, limit positions, open starts, laws unknown."""

import re

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.minimal import model
from engine_models.minimal.model import LimitPosition
from engine_models.scene.format import SceneError
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import REFERENCE, TRUE, converged, truth_by
from tests.engines.mechanism_texts import FOUR_BAR, four_bars, scene
from tests.helpers.starts import started_from


@pytest.mark.parametrize("count", [1, 2])
def test_no_step_passes_a_singular_position(count: int) -> None:
    """All loops of a row are singular at once, where the sign of their determinant need not change."""
    with pytest.raises(SimulationFailed, match=r"at t = 0\.7[01].* s: its loops are singular"):
        TRUE.simulate(scene(four_bars(count, 0.8)), RunSettings(1.0, 1))


#: A four-bar whose driven crank cannot turn round: PMKS (2016) has this one, with the limit at 2.07444 s.
LIMIT = """
name = "limit"
end_time_s = 2.49
observe = "E.x"
ground.pins_m = { A = [0.041, 0.0375], D = [0.00165, 0.01322] }
start.angle_rad = { crank = -2.247729496786994, coupler = -2.5319597291135514, rocker = -2.1730249702589566 }
start.hold = ["crank"]
start.speed_rad_s = { crank = 1.0471975511965976 }
drive = { kind = "constant-speed", body = "crank" }
[body.crank]
pins_m = { A = 0.0, B = 0.045593477603709937 }
mass_kg = 0.1
inertia_kg_m2 = 1.7323e-05
centre_of_mass_m = 0.0228
[body.coupler]
pins_m = { B = 0.0, C = 0.04347092936664686, E = [0.023, -0.034] }
mass_kg = 0.2
inertia_kg_m2 = 3.1495e-05
centre_of_mass_m = 0.0217
[body.rocker]
pins_m = { D = 0.0, C = 0.04386735688413424 }
mass_kg = 0.1
inertia_kg_m2 = 1.60362e-05
centre_of_mass_m = 0.0219
"""


def test_a_drive_that_comes_to_a_limit_position_is_told_with_the_time() -> None:
    """There coupler and rocker are in line: the crank's pin is as far from D as they are long together."""
    of = scene(LIMIT)
    (x, y), crank, together = (0.041 - 0.00165, 0.0375 - 0.01322), 0.045593477603709937, 0.08733829930350108
    start, speed = -2.247729496786994, 1.0471975511965976
    angle = np.linspace(start, start + 2.7, 2_000_001)
    apart = np.hypot(x + crank * np.cos(angle), y + crank * np.sin(angle))
    limit_s = float(angle[np.argmax(apart > together)] - start) / speed
    with pytest.raises(LimitPosition) as refused:
        converged(of, 10)
    stated = re.match(r"the mechanism cannot go on at t = (\S+) s: the drive has come to", str(refused.value))
    assert stated
    assert float(stated[1]) == pytest.approx(limit_s, abs=2e-6), "of so many angles"


def told(off_m: float) -> Scene:
    """Return a four-bar that begins with told states, its rocker a little aside."""
    of = scene(FOUR_BAR)
    run = TRUE.simulate(of, RunSettings(of.end_time_s, 1))
    position = run.position[0].copy()
    position[2, 0] += off_m
    return started_from(of, position, run.velocity[0])


def test_a_told_start_of_nine_digits_is_closed_and_one_of_fewer_is_refused() -> None:
    exact, near = (TRUE.simulate(told(off), RunSettings(1.0, 1)) for off in (0.0, 2e-10))
    assert np.abs(near.position - exact.position).max() < 1e-8
    with pytest.raises(SceneError, match="open by 2e-09 m"):
        told(2e-9)


def test_a_law_that_somebody_adds_is_left_to_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    known = model.damping_of

    def damping_of(law: str, e: float) -> float:
        return known("mine" if law == "lankarani-nikravesh" else law, e)

    monkeypatch.setattr(model, "damping_of", damping_of)
    of = SCENES["clearance-driven-0.5mm"]().replace("end_time_s", 1e-3)
    with pytest.raises(UnsupportedScene, match="the independent solver has no contact law 'mine'"):
        TRUE.simulate(of, RunSettings(1.0, 1))
    assert truth_by(of, 3) == REFERENCE


def test_a_table_of_thousands_of_points_is_solved() -> None:
    time = np.linspace(0.0, 0.024, 6001)
    table = {"kind": "table", "time_s": time.tolist(), "angle_rad": (523.6 * time).tolist()}
    of = SCENES["ideal-driven"]().replace({"drive": table, "end_time_s": 0.024})
    run = TRUE.simulate(of, RunSettings(1.0, 4))
    assert run.steps >= 5999
    assert run.position[-1, 0, 2] == pytest.approx(523.6 * 0.024, abs=1e-12)

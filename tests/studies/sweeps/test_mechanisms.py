"""Sweeps over other mechanisms than crank-sliders: rows as their own runs give them, units, refusals."""

import math
from pathlib import Path

import numpy as np
import pytest

import crankslider as cs
from engine_models.reference.members import LISTS, NUMBERS
from engine_models.reference.watch import Watch
from engine_models.scene.file import from_toml
from engine_models.scene.general import GeneralScene
from engine_models.scene.parts import AnyScene
from studies.judges import lyapunov
from studies.predictability.sweeps.gathered import row_of
from studies.predictability.sweeps.task import TURN_SAMPLES, Task
from tests.engine_models.reference.mechanism_texts import ANDREWS, FOUR_BAR_CLEARANCE, SCOTCH_YOKE, WALL
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

CLEARANCE, ANGLE, SPEED = "clearance.B.radial_clearance_m", "start.angle_rad.crank", "start.speed_rad_s.crank"
SETTINGS: dict[str, object] = {"method": "dop853", "step_tolerance": 1e-9}
#: Both come from one run of the same samples: nothing but rounding lies between them.
ROUND_OFF = 1e-12
#: A mechanism put together is one last place off a closed form, which impacts make grow.
GROWN = 1e-6
SHORT = cs.scenes["clearance-driven-0.5mm"]
GENERAL = GeneralScene.checked(SHORT.general.model_dump(exclude_none=True))
#: Where round-off is a ten-millionth of the distance of two runs, exponents of a turn differ by a thousandth.
SIZE_M, EXPONENT = 1e-10, 1e-3
STILL = (
    ANDREWS.replace('"K3.angle"', '"K3.angle"\nturning = ""') + f"[clearance.H]{WALL.replace('5e-4', '5e-5')}"
)
#: Pymunk's groove is of order 1 where a pin turns in it, and its engine refuses it.
LOOSE_YOKE = f"{SCOTCH_YOKE}[clearance.O]{WALL}"


def ran(scene: AnyScene, end_s: float, turns: float) -> cs.Run:
    samples = round(turns * TURN_SAMPLES)
    return cs.simulate(scene, end=end_s, samples=samples, settings=SETTINGS, step=end_s / samples)


@pytest.mark.filterwarnings("ignore:.*in doubt")
def test_a_four_bars_rows_are_those_of_its_runs() -> None:
    scene = from_toml(FOUR_BAR_CLEARANCE)
    end_s = Watch(0.5, 1.0).member(scene, {}).end_time_s
    assert end_s == pytest.approx(1.5 * 2 * math.pi / 60)
    vary = {CLEARANCE: [1e-4, 5e-4]}
    rows = cs.sweep(scene, vary, settings=SETTINGS, transient=0.5, revolutions=1, jobs=1).frame
    for _, row in rows.iterrows():
        run = ran(scene.replace(CLEARANCE, row[CLEARANCE]), end_s, 1.5)
        late = run.frame.iloc[500:]
        deviation = late["observed_B_x_m"] - ideal_B_x_m(late["crank_angle_rad"].to_numpy())
        assert row["observed_deviation_m"] == pytest.approx(deviation.abs().max(), abs=ROUND_OFF)
        assert row["strobe_m"] == pytest.approx([deviation.iloc[-1]], abs=ROUND_OFF)
        assert row["largest_contact_force_N"] == late["contact_B_normal_force_N"].max()
        touches = run.impacts["time_s"][run.impacts["time_s"] >= end_s / 3]
        touching = bool(late["contact_B_penetration_m"].iloc[-1] >= 0)
        assert row["impacts_per_revolution"] == len(touches) + touching
        phases = (0.7 + 60 * touches) % (2 * math.pi)
        np.testing.assert_allclose(row["impact_phase_rad"][: len(touches)], phases, atol=ROUND_OFF)


def ideal_B_x_m(theta: np.ndarray) -> np.ndarray:
    """Return where two circles meet: about pin A on the crank, and about C on the ground."""
    A = 0.1 * np.exp(1j * theta)
    to_C = 0.28 - A
    along = (np.abs(to_C) ** 2 + 0.25**2 - 0.2**2) / (2 * np.abs(to_C))
    B = A + to_C / np.abs(to_C) * (along + 1j * np.sqrt(0.25**2 - along**2))
    return np.asarray(B.real)


def test_a_crank_slider_has_the_same_row_in_either_form(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lyapunov, "SIZE_M", SIZE_M)
    watch = Watch(0.0, 1.0, exponent=True)
    one, other = (row_of(Task(of, "reference", SETTINGS, 1e-5, watch), {}) for of in (SHORT, GENERAL))
    assert other["status"] == "ok"
    for name in (*NUMBERS, *LISTS):
        ours, part = other[name.replace("slider", "observed")], EXPONENT if name == "exponent_1_s" else GROWN
        assert ours == pytest.approx(one[name], rel=part), name


@pytest.mark.filterwarnings("ignore:.*in doubt")
def test_without_a_turning_body_a_revolution_is_as_long_as_the_scene() -> None:
    scene = from_toml(STILL)
    found = cs.sweep(scene, {"drive.torque_N_m": [0.033]}, settings=SETTINGS, revolutions=0.5, jobs=1)
    (row,) = (row for _, row in found.frame.iterrows())
    touches = ran(scene, scene.end_time_s / 2, 0.5).impacts["time_s"].to_numpy()
    assert row["impacts_per_revolution"] >= 2 * len(touches) > 0
    phases = 2 * math.pi * touches / scene.end_time_s
    np.testing.assert_allclose(row["impact_phase_rad"][: len(touches)], phases, rtol=ROUND_OFF)
    assert found.plot().axes[0].get_ylabel() == "largest contact force [N]"


def test_a_jitter_moves_the_turning_bodys_angle() -> None:
    scene = from_toml(FOUR_BAR_CLEARANCE)
    found = cs.sweep(scene, members=3, jitter=1e-3, revolutions=0.05, jobs=1)
    moves = found.frame[ANGLE] - 0.7
    assert (moves.abs() < 1e-3).all()
    assert moves.nunique() == 3
    assert (found.frame["status"] == "ok").all()


def test_the_state_of_one_body_is_varied_while_the_others_start_closed() -> None:
    vary = {"start.slider.x_m": [0.1699, 0.1701]}
    one, other = (
        cs.sweep(of, vary, settings=SETTINGS, revolutions=0.25, jobs=1).frame for of in (SHORT, GENERAL)
    )
    assert (other["status"] == "ok").all(), other["reason"].tolist()
    column = "impulse_per_revolution_N_s"
    np.testing.assert_allclose(other[column], one[column], rtol=GROWN)


@pytest.mark.parametrize(
    ("text", "options", "pieces"),
    [
        (LOOSE_YOKE, ["--engine", "pymunk"], "--engine: expected one that can run this scene"),
        (FOUR_BAR_CLEARANCE, ["--chain", "up"], "--chain: expected a crank-slider on a guide along +x"),
        (FOUR_BAR_CLEARANCE, ["--vary", f"{SPEED}=0,1"], f"--vary {SPEED}: expected a number other than 0"),
        (FOUR_BAR_CLEARANCE, ["--vary", f"{CLEARANCE}.x=0,1"], f"--vary {CLEARANCE}"),
        (
            FOUR_BAR_CLEARANCE,
            ["--vary", "start.rocker.angular_velocity_rad_s=1,2"],
            "--vary start: expected speeds that joints and drive allow, got C off by",
        ),
        (FOUR_BAR_CLEARANCE, ["--plot", "a.svg", "--show", "slider_deviation_m"], "--show: expected"),
        (STILL, ["--jitter", "1e-3"], "--jitter: expected a turning body, got none"),
        (STILL, ["--exponent"], "--exponent: expected a turning body, got none"),
        (
            FOUR_BAR_CLEARANCE.replace('hold = ["crank"]', 'hold = ["rocker"]'),
            ["--jitter", "1e-3"],
            f"--jitter: expected a start that tells {ANGLE} and holds it, got another",
        ),
    ],
)
def test_what_cannot_be_swept_is_refused_in_one_line(
    text: str, options: list[str], pieces: str, tmp_path: Path
) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(text)
    vary = [] if "--vary" in options else ["--vary", "gravity_m_s2=1,2"]
    done = crankslider("sweep", file, *vary, *options, "--jobs", 1, "--out", tmp_path / "a.parquet")
    require_refusal(done.stdout, done.stderr, done.code, pieces)

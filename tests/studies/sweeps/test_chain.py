"""Chains: each member goes on from where the one before it ended, whoever runs them and however often."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from engine_models.mechanics.assembly import assembled, assembled_apart
from engine_models.mechanics.joints import joint_gap
from engine_models.reference.watch import SPEED, Watch
from engine_models.scene.library import SCENES
from studies.command.sweep import asked, options_of
from studies.predictability.sweeps import run as running
from studies.predictability.sweeps.chunk import Chunk, Direction, run_chunk
from studies.predictability.sweeps.run import Sweep, run_sweep
from studies.predictability.sweeps.task import Task
from studies.running.failures import BadInput
from tests.helpers.running import Here

SPEEDS = np.linspace(300.0, 400.0, 5)
CLEARANCE, TURNS = "clearance.B.radial_clearance_m", Watch(1.0, 1.0)
#: A member whose pin is in its wall begins just before it: what that moves, a motion of two turns enlarges.
ALIKE_M = 1e-5
#: Sines and cosines of angles that are arc sines part by round-off, with speeds of 100 rad/s.
ROUND_OFF_M, ROUND_OFF_M_S = 1e-15, 1e-13


def task(engine: str = "reference", settings: dict[str, object] | None = None) -> Task:
    return Task(SCENES["clearance-driven-0.5mm"](), engine, settings or {"method": "dop853"}, None, TURNS)


def chained(folder: Path, pool: Here, *directions: Direction) -> pd.DataFrame:
    folder.mkdir(exist_ok=True)
    sweep = Sweep(task(), {SPEED: SPEEDS}, (SPEED,), directions)
    run_sweep(sweep, folder / "rows.parquet", {}, 2, lambda: pool, 1.0)
    return pd.read_parquet(folder / "rows.parquet")


def ask(name: str, vary: Mapping[str, str | Sequence[float]], options: Mapping[str, object]) -> Sweep:
    return asked(SCENES[name](), vary, "reference", {}, False, options_of({"chain": "both", **options}))


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "MOST_IN_CHUNK", 2)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return chained(tmp_path_factory.mktemp("whole"), Here(), "up", "down")


@pytest.mark.parametrize("name", ["clearance-driven-0.5mm", "clearance-driven-AB", "clearance-free-OAB"])
def test_a_mechanism_is_assembled_with_its_pins_where_they_are_asked_for(name: str) -> None:
    scene = SCENES[name]()
    gaps = {
        joint: 1e-4 * np.array([[1.0 + k, -2.0], [300.0, 500.0 * k]])
        for k, joint in enumerate(scene.joints_with_clearance)
    }
    position, velocity = (part[None] for part in assembled_apart(scene, 2.0, 100.0, gaps))
    for joint in scene.joints:
        found = joint_gap(scene, joint, position, velocity)
        wanted = gaps.get(joint, np.zeros((2, 2)))
        np.testing.assert_allclose(found.gap_m[0], wanted[0], atol=ROUND_OFF_M)
        np.testing.assert_allclose(found.rate_m_s[0], wanted[1], atol=ROUND_OFF_M_S)


def test_without_gaps_it_is_the_assembly_of_ideal_joints() -> None:
    scene = SCENES["clearance-driven-0.5mm"]()
    for one, other in zip(assembled_apart(scene, 2.0, 1.0, {}), assembled(scene, 2.0, 1.0), strict=True):
        np.testing.assert_allclose(one, other, atol=ROUND_OFF_M)


def test_chains_go_up_and_down_over_the_same_values(rows: pd.DataFrame) -> None:
    assert rows["direction"].tolist() == ["up"] * 5 + ["down"] * 5
    assert rows[SPEED].tolist() == [*SPEEDS, *SPEEDS[::-1]]
    assert rows["status"].eq("ok").all()


def test_a_chain_that_never_changes_its_field_is_one_long_run() -> None:
    """A chaotic motion followed for two turns, and in two members of a turn, is at the same place."""
    one, two = Watch(0.0, 1.0), Watch(0.0, 2.0)
    settings: dict[str, object] = {"method": "dop853", "step_tolerance": 1e-10}
    scene = SCENES["clearance-driven-0.1mm"]()
    parts = Task(scene, "reference", settings, None, one), Task(scene, "reference", settings, None, two)
    chunks = Chunk(0, {SPEED: np.full(2, 300.0)}, "up"), Chunk(0, {SPEED: np.array([300.0])})
    chain, whole = (run_chunk(of, chunk).to_pandas() for of, chunk in zip(parts, chunks, strict=True))
    strobes = np.concatenate(chain["strobe_m"].to_list())
    np.testing.assert_allclose(strobes, whole["strobe_m"][0], atol=ALIKE_M)


def test_an_interrupted_chain_goes_on_where_its_pins_were(rows: pd.DataFrame, tmp_path: Path) -> None:
    def interrupt(call: int) -> None:
        if call == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        chained(tmp_path, Here(interrupt), "up", "down")
    again = Here()
    found = chained(tmp_path, again, "up", "down")
    assert again.calls < 6
    pd.testing.assert_frame_equal(found, rows, check_exact=True)


def test_another_engine_goes_on_from_its_own_end() -> None:
    of = Task(SCENES["clearance-driven-0.5mm"](), "exudyn", {"solver": "DOPRI5"}, None, Watch(0.0, 1.0))
    chunk = Chunk(0, {CLEARANCE: np.array([5e-4, 4e-4])}, "down")
    found, alone = (run_chunk(of, each).to_pandas() for each in (chunk, Chunk(0, chunk.changes)))
    assert found["status"].tolist() == ["ok", "ok"]
    np.testing.assert_array_equal(found["strobe_m"][0], alone["strobe_m"][0])
    assert found["strobe_m"][1][0] != alone["strobe_m"][1][0]


@pytest.mark.parametrize(
    ("name", "field", "options", "words"),
    [
        ("clearance-free-0.5mm", CLEARANCE, {}, "a crank at constant speed"),
        ("clearance-driven-0.5mm", "start.crank_angle_rad", {}, "one field with --vary"),
        ("clearance-driven-0.5mm", CLEARANCE, {"jitter": 0.1, "members": 2}, "one field with --vary"),
        ("clearance-driven-0.5mm", CLEARANCE, {"transient": 0.5}, "whole revolutions"),
        ("clearance-driven-0.5mm", CLEARANCE, {"chain": "sideways"}, "up"),
    ],
)
def test_what_is_no_chain_is_refused(name: str, field: str, options: dict[str, object], words: str) -> None:
    with pytest.raises(BadInput, match=rf"--chain: .*{words}"):
        ask(name, {field: "1e-4:1e-3:3"}, options)


def test_a_chain_of_values_that_fall_is_refused() -> None:
    with pytest.raises(BadInput, match=r"--chain: expected rising values of "):
        ask("clearance-driven-0.5mm", {CLEARANCE: [2e-4, 1e-4]}, {})

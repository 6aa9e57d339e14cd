"""The reference's members run together have the rows that their own runs give, as far as samples tell."""

import numpy as np
import pandas as pd
import pytest

from engine_models.reference.watch import Watch
from engine_models.scene.library import SCENES
from studies.predictability.sweeps.chunk import Chunk, run_chunk
from studies.predictability.sweeps.gathered import row_of
from studies.predictability.sweeps.task import TURN_SAMPLES, Task

FIELD, TURNS = "clearance.B.radial_clearance_m", 2
CLEARANCES_M = [1e-5, 3e-5, 1e-4, 3e-4, 1e-3]
#: Steps are the same, and so are sums that are taken at them: only their order differs.
ROUND_OFF = 1e-9
#: Where only samples are looked at, a touch or a release is known to one of them; touches in a turn here.
MOST_TOUCHES = 20
#: A touch's angle, at the acceleration of an impact, is off by a part of the interval between two samples.
SAMPLE_RAD = 2 * np.pi / TURN_SAMPLES
#: What lies between two samples is missed: of the deviation, and of a force that rises and falls in thirty.
MISSED_DEVIATION, MISSED_FORCE = 0.01, 0.12


@pytest.fixture(scope="module")
def paths() -> tuple[pd.DataFrame, pd.DataFrame]:
    settings = {"method": "dop853", "step_tolerance": 1e-10}
    task = Task(SCENES["clearance-driven-0.5mm"](), "reference", settings, None, Watch(1.0, TURNS))
    together = run_chunk(task, Chunk(0, {FIELD: np.array(CLEARANCES_M)})).to_pandas()
    return together, pd.DataFrame([row_of(task, {FIELD: clearance}) for clearance in CLEARANCES_M])


@pytest.mark.parametrize(
    "column",
    [
        *("impacts_per_revolution", "impulse_N_s", "impulse_per_revolution_N_s"),
        "dissipated_energy_per_revolution_J",
    ],
)
def test_impacts_and_losses_are_the_same(paths: tuple[pd.DataFrame, pd.DataFrame], column: str) -> None:
    together, alone = paths
    np.testing.assert_allclose(together[column], alone[column], rtol=ROUND_OFF)


def test_the_strobe_is_the_same(paths: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    together, alone = (np.stack(path["strobe_m"].map(np.array)) for path in paths)
    np.testing.assert_allclose(together, alone, rtol=ROUND_OFF, atol=1e-14)


def test_touches_are_at_the_same_angles(paths: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    for together, alone in zip(paths[0]["impact_phase_rad"], paths[1]["impact_phase_rad"], strict=True):
        np.testing.assert_allclose(together, alone, atol=SAMPLE_RAD)


def test_what_samples_miss_is_little(paths: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    together, alone = paths
    flight = np.abs(together["flight_part"] - alone["flight_part"])
    assert flight.max() < MOST_TOUCHES / TURN_SAMPLES
    for column, missed in [
        ("slider_deviation_m", MISSED_DEVIATION),
        ("largest_contact_force_N", MISSED_FORCE),
    ]:
        part = 1 - alone[column] / together[column]
        assert part.between(-1e-3, missed).all(), part.tolist()

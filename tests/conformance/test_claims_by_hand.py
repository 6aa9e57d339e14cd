"""Claims that fail, and none beside them, for an engine whose run is off in one respect by little."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
import pytest

from engine_models.engine import Engine, Impacts, RunSettings, Trajectory
from engine_models.scene.scene import Scene
from studies.conform import CLAIMS, trial_of, tried
from tests.helpers.altered import Altered

Change = Callable[[Trajectory], Trajectory]
RUNS = count()


def unaltered(run: Trajectory) -> Trajectory:
    return run


def growing(run: Trajectory) -> np.ndarray:
    """Return 0 at the start to 1 at the end, for bodies and axes."""
    return np.linspace(0.0, 1.0, len(run.time_s))[:, None, None]


def faster(run: Trajectory) -> Trajectory:
    """Ever faster, by 3 in a thousand at the end: twice as much energy from nowhere, and hardly a force."""
    return replace(run, velocity=run.velocity * (1.0 + 0.003 * growing(run)))


def stronger(run: Trajectory) -> Trajectory:
    """All joint forces a tenth larger."""
    return replace(run, joint_force_N={joint: 1.1 * force for joint, force in run.joint_force_N.items()})


def restless(run: Trajectory) -> Trajectory:
    """Never the same twice, by less than a femtometre."""
    return replace(run, position=run.position + 1e-16 * next(RUNS) * growing(run))


def moved(sample: int, body: int, axis: int, by: float) -> Change:
    """Return what moves one body at one sample alone."""

    def change(run: Trajectory) -> Trajectory:
        position = run.position.copy()
        position[sample, body, axis] += by
        return replace(run, position=position)

    return change


CLOSED = "Ideal joints and the guide stay closed"
PLACE = "What the scene observes is where the true solution of the engine's own law has it"


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (unaltered, set()),
        (faster, {"No energy comes or goes that work and losses do not explain"}),
        (stronger, {"Forces are those that the accelerations need"}),
        (
            moved(-1, -1, 0, 1e-4),
            {CLOSED, PLACE},
        ),
        (restless, {"A second run is the same to the last bit"}),
        (moved(0, 0, 2, 1e-3), {"The run begins in the scene's own state", CLOSED}),
    ],
    ids=["nothing", "faster", "stronger", "elsewhere", "restless", "late"],
)
def test_a_claim_fails_of_what_it_is_about(change: Change, broken: set[str]) -> None:
    trial = trial_of(Altered(change), "ideal-free")
    assert {sentence for sentence, claim in CLAIMS.items() if not claim(trial).holds} == broken


@dataclass(frozen=True)
class OfItsOwnLaw(Altered):
    """It solves another clearance than the scene's, five times as tight, and may say so."""

    change: Change = unaltered
    told: bool = True

    def twin(self, scene: Scene) -> Scene:
        return scene.replace("clearance.B.radial_clearance_m", 1e-4) if self.told else scene

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        return super().simulate(replace(self, told=True).twin(scene), settings)


def with_impacts(stronger: float = 1.0, missed: int = 0) -> Change:
    """Return what gives a run other peaks, and leaves out some of its impacts."""

    def change(run: Trajectory) -> Trajectory:
        contact = run.contacts["B"]
        kept = {name: values[missed:] for name, values in vars(contact.impacts).items()}
        kept["largest_normal_force_N"] = stronger * kept["largest_normal_force_N"]
        return replace(run, contacts={"B": replace(contact, impacts=Impacts(**kept))})

    return change


STRENGTH = "Every impact is there, as strong as the converged solution of the engine's own law has it"


@pytest.mark.parametrize(
    ("engine", "claim", "measured"),
    [
        (OfItsOwnLaw(), PLACE, ""),
        (OfItsOwnLaw(told=False), PLACE, "m off"),
        (Altered(unaltered), STRENGTH, ""),
        (Altered(with_impacts(stronger=1.2)), STRENGTH, "2.0e-01 of"),
        (Altered(with_impacts(missed=1)), STRENGTH, "1 impacts too few"),
    ],
    ids=["its own law", "another law", "unaltered", "stronger", "missed"],
)
def test_contacts_are_held_to_the_law_that_an_engine_says_it_solves(
    engine: Engine, claim: str, measured: str
) -> None:
    found = tried(CLAIMS[claim], trial_of(engine, "clearance-driven-0.5mm"))
    assert found.holds == (not measured), found.measured
    assert measured in found.measured

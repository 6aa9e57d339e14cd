"""The stated uncertainty of the truth encloses solutions whose every number is a place off."""

from collections.abc import Iterator

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.mechanics.samples import selected
from engine_models.scene.format import SceneData
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import PLACES, TRUE, converged, followed
from studies.judges.horizon import a_place_off
from studies.judges.metrics import errors, uncertainties
from studies.settings import END_S

SAMPLES = 120

#: Solutions of each scene, and how many of their numbers at how many ends have to be enclosed. A solution is
#: a twentieth, and which are enclosed is a matter of rounding.
DRAWS, ENDS, ENCLOSED = 20, 12, 0.9


def rounded(data: SceneData, rng: np.random.Generator) -> SceneData:
    """Return a scene with every number but its end a unit in the last place off, up or down by chance."""
    changes: dict[str, object] = {}
    for name, value in data:
        if isinstance(value, SceneData):
            changes[name] = rounded(value, rng)
        elif value and isinstance(value, float) and name != "end_time_s":
            changes[name] = float(value + rng.choice((-1, 1)) * np.spacing(value))
    return data.model_copy(update=changes)


def enclosed(
    scene: Scene, truth: Trajectory, repeats: list[Trajectory], others: Iterator[Trajectory], count: int
) -> dict[str, float]:
    """Return of every signal the part of other solutions that is enclosed, by runs of various ends."""
    inside: dict[str, list[bool]] = {}
    ends = np.linspace(count / ENDS, count, ENDS).astype(int).tolist()
    for other in others:
        for end in ends:
            own, one, *repeated = (selected(run, slice(end)) for run in (truth, other, *repeats))
            stated = uncertainties(scene, own, repeated)
            for name, error in errors(scene, one, own).items():
                known = stated[name.replace("_error_", "_uncertainty_")]
                inside.setdefault(name, []).append(bool(error.max() <= known))
    return {name: float(np.mean(each)) for name, each in inside.items()}


LOOSE = ("clearance-free-0.5mm", "clearance-driven-0.5mm", "clearance-driven-AB")


@pytest.mark.parametrize("name", ["ideal-driven", *LOOSE])
def test_solutions_of_rounded_numbers_lie_within_the_uncertainty(name: str) -> None:
    scene = SCENES[name]()
    scene = scene.model_copy(update={"end_time_s": END_S.get(name, scene.end_time_s)})
    truth, repeats = converged(scene, SAMPLES)
    begun = [one.position[0, 0, 2] for one in (truth, *repeats)]
    off = PLACES * np.spacing(1.0)
    assert begun == pytest.approx([0.0, off, -off], abs=1e-25), "some places off"
    run = RunSettings(scene.end_time_s, SAMPLES)
    draws = (rounded(scene, np.random.default_rng(seed)) for seed in range(DRAWS))
    others = (TRUE.simulate(draw, run) for draw in draws if isinstance(draw, Scene))
    parts = enclosed(scene, truth, list(repeats), others, followed(scene, SAMPLES))
    assert min(parts.values()) >= ENCLOSED, parts


def test_a_start_is_a_place_off_in_every_number_that_has_one() -> None:
    scene = SCENES["ideal-free"]()
    start, off = scene.start, a_place_off(scene).start
    assert off.crank_angle_rad == start.crank_angle_rad + np.spacing(1.0)
    assert off.crank_speed_rad_s == np.nextafter(start.crank_speed_rad_s, np.inf)
    assert a_place_off(scene, -1.0).short.start.crank_speed_rad_s == np.nextafter(
        start.crank_speed_rad_s, 0.0
    )
    given = started_from(scene, *start_state(scene))
    for state, other in zip(given.start.states, a_place_off(given).start.states, strict=True):
        moved = {name for name, value in state if value != getattr(other, name)}
        assert moved == {"angle_rad", *(name for name, value in state if value)}
    assert a_place_off(given).model_copy(update={"start": given.start}) == given

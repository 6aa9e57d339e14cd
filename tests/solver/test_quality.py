"""The check of a run's quality, on true motions with errors of known size put into them."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.quality import quality_of, require_quality
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.helpers.ideal_crank_slider import exact

SAMPLES, WRONG_FROM = 20, 8
Planted = tuple[Scene, Trajectory]


def energy(part: float) -> Planted:
    """Return a weightless free motion, all of whose energy is kinetic, made faster from a sample on."""
    scene = SCENES["ideal-free"]().model_copy(update={"gravity_m_s2": 0.0})
    truth = exact(scene, SAMPLES)
    velocity = truth.velocity.copy()
    # With a part p gained, (1 + p) E is in play: the part of that is wanted.
    velocity[WRONG_FROM:] *= np.sqrt(1 / (1 - part))
    return scene, replace(truth, velocity=velocity)


@cache
def loose_run() -> Planted:
    scene = SCENES["clearance-driven-0.1mm"]().model_copy(update={"end_time_s": 0.002})
    return scene, make_engine("reference").simulate(scene, RunSettings(1e-5, SAMPLES))


def penetration(radii: float) -> Planted:
    """Return a motion whose pin goes into its bearing's wall, by radii of 10 mm."""
    scene, run = loose_run()
    depth = run.contacts["B"].penetration_m.copy()
    depth[WRONG_FROM:] = radii * 0.01
    return scene, replace(run, contacts={"B": replace(run.contacts["B"], penetration_m=depth)})


def deep_impact(radii: float) -> Planted:
    """Return a motion with an impact that is deepest between two samples, of which none shows it."""
    scene, run = loose_run()
    contact = run.contacts["B"]
    between_s = np.full_like(contact.impacts.time_s, run.time_s[WRONG_FROM - 1 : WRONG_FROM + 1].mean())
    deep = {"largest_penetration_m": 0 * between_s + radii * 0.01, "largest_penetration_time_s": between_s}
    return scene, replace(run, contacts={"B": replace(contact, impacts=replace(contact.impacts, **deep))})


WALL = "penetration_part", "pin in the wall of its bearing by", 1.0
PLANTED: dict[Callable[[float], Planted], tuple[str, str, float]] = {
    energy: ("unaccounted_energy_part", "energy off by", 0.1),
    penetration: WALL,
    deep_impact: WALL,
}


@pytest.mark.parametrize("plant", PLANTED)
def test_an_error_of_known_size_is_found_warned_of_and_failed_at_its_time(
    plant: Callable[[float], Planted],
) -> None:
    column, words, limit = PLANTED[plant]
    for part in np.array([0.09, 0.11, 0.9, 1.1]) * limit:
        scene, run = plant(part)
        quality = quality_of(scene, run)
        assert quality.parts()[column] == pytest.approx(part, rel=1e-5), "rounding has a part of some 1e-6"
        assert len(quality.warnings()) == (part > limit / 10)
        for line in (*quality.warnings(), *filter(None, [quality.failure()])):
            assert line.startswith(f"{words} {100 * part:.3g} % of ")
            assert f"at t = {run.time_s[WRONG_FROM]:.6g} s with step {run.step_s:.3g} s: " in line
        if part > limit:
            with pytest.raises(SimulationFailed, match=words):
                require_quality(scene, run)
        else:
            assert require_quality(scene, run) is run


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300])
def test_what_is_not_finite_fails_first_and_without_a_warning_of_numpy(number: float) -> None:
    scene, run = penetration(2.0)
    velocity = run.velocity.copy()
    velocity[5:] = number
    failure = quality_of(scene, replace(run, velocity=velocity)).failure()
    expected = f"energy off by inf % of that in play, past 10 % at t = {run.time_s[5]:.6g} s"
    assert str(failure).startswith(expected)

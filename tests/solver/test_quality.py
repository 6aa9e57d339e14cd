"""The check of a run's quality, on true motions with errors of known size put into them."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.energy import kinetic_energy_J
from engine_models.mechanics.quality import quality_of, require_quality
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES, WRONG_FROM = 20, 8
Planted = tuple[Scene, Trajectory]


@cache
def loose_run(name: str) -> Planted:
    scene = SCENES[name]().model_copy(update={"end_time_s": 0.002, "gravity_m_s2": 0.0})
    return scene, make_engine("reference").simulate(scene, RunSettings(1e-5, SAMPLES))


def energy(part: float) -> Planted:
    """Return a weightless free motion, all of whose energy is kinetic, made faster from a sample on."""
    scene = SCENES["ideal-free"]().model_copy(update={"gravity_m_s2": 0.0})
    truth = exact(scene, SAMPLES)
    velocity = truth.velocity.copy()
    # With a part p gained, (1 + p) E is in play: the part of that is wanted.
    velocity[WRONG_FROM:] *= np.sqrt(1 / (1 - part))
    return scene, replace(truth, velocity=velocity)


def gap(part: float) -> Planted:
    """Return a driven motion with all bodies moved off the ground's pivot, by a part of the crank."""
    scene = SCENES["ideal-driven"]()
    truth = exact(scene, SAMPLES)
    position = truth.position.copy()
    position[WRONG_FROM:, :, 0] += part * scene.short.crank.length_m
    return scene, replace(truth, position=position)


def guide(part: float) -> Planted:
    """Return a motion without ideal joints whose slider leaves its guide, by a part of the crank."""
    scene, run = loose_run("clearance-free-OAB")
    position = run.position.copy()
    position[WRONG_FROM:, -1, 1] -= part * scene.short.crank.length_m
    return scene, replace(run, position=position)


def penetration(radii: float) -> Planted:
    """Return a motion whose pin goes into its bearing's wall, by radii of 10 mm."""
    scene, run = loose_run("clearance-driven-0.1mm")
    depth = run.contacts["B"].penetration_m.copy()
    depth[WRONG_FROM:] = radii * 0.01
    return scene, replace(run, contacts={"B": replace(run.contacts["B"], penetration_m=depth)})


PLANTED: dict[str, tuple[Callable[[float], Planted], str, float, float, str]] = {
    "energy": (energy, "unaccounted_energy_part", 0.01, 0.1, "energy off by"),
    "gap": (gap, "ideal_gap_part", 0.01, 0.1, "ideal joints or guide open by"),
    "guide": (guide, "ideal_gap_part", 0.01, 0.1, "ideal joints or guide open by"),
    "penetration": (penetration, "penetration_part", 0.1, 1.0, "pin in the wall of its bearing by"),
}


@pytest.mark.parametrize("kind", PLANTED)
def test_an_error_of_known_size_is_found_warned_of_and_failed_at_its_time(kind: str) -> None:
    plant, column, doubtful, failed, words = PLANTED[kind]
    for part in (0.9 * doubtful, 1.1 * doubtful, 0.9 * failed, 1.1 * failed):
        scene, run = plant(part)
        quality = quality_of(scene, run)
        assert quality.parts()[column] == pytest.approx(part, rel=1e-6)
        when = f"at t = {run.time_s[WRONG_FROM]:.6g} s with step {run.step_s:.3g} s: "
        warnings, failure = quality.warnings(), quality.failure() or ""
        assert len(warnings) == (part > doubtful)
        for line in (*warnings, *([failure] if failure else [])):
            assert line.startswith(f"{words} {100 * part:.3g} % of ")
            assert when in line
        assert bool(failure) == (part > failed), failure
        if failure:
            with pytest.raises(SimulationFailed, match=words):
                require_quality(scene, run)
        else:
            assert require_quality(scene, run) is run


def test_energy_is_in_parts_of_the_largest_in_play_not_of_next_to_nothing() -> None:
    """Begun at rest: what is lost in the first interval is as large as what there was, and little in all."""
    scene = SCENES["ideal-torque"]()
    truth = exact(scene, SAMPLES)
    assert truth.driver_work_J is not None
    work, kinetic = np.abs(truth.driver_work_J), kinetic_energy_J(scene, truth).max()
    for lost, in_play in ((work[1], kinetic), (0.5 * work.max(), 1.5 * work.max())):
        told = truth.driver_work_J + lost * (truth.time_s > 0)
        found = quality_of(scene, replace(truth, driver_work_J=told)).parts()["unaccounted_energy_part"]
        assert found == pytest.approx(lost / in_play, rel=1e-5), "rounding has a part of some 1e-6"
    assert work[1] < 0.01 * kinetic


def test_what_stabilisation_took_is_no_physics() -> None:
    """An engine that tells how much it is, is judged as one that does not."""
    scene, run = energy(0.05)
    told = replace(run, stabilisation_loss_J=np.linspace(0.0, 1.0, SAMPLES + 1))
    assert quality_of(scene, told) == quality_of(scene, run)


def test_of_several_failures_the_first_is_told() -> None:
    scene, run = gap(0.2)
    depart: dict[str, Any] = {"driver_work_J": run.driver_work_J - 1e6 * (run.time_s >= run.time_s[3])}
    assert "energy" in str(quality_of(scene, replace(run, **depart)).failure())
    assert "guide" in str(quality_of(scene, run).failure())


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300])
def test_what_is_not_finite_fails_without_a_warning_of_numpy(number: float) -> None:
    scene, run = penetration(0.0)
    velocity = run.velocity.copy()
    velocity[5:] = number
    quality = quality_of(scene, replace(run, velocity=velocity))
    assert quality.parts()["unaccounted_energy_part"] == np.inf
    assert f"energy off by inf % of that in play, past 10 % at t = {run.time_s[5]:.6g} s" in str(
        quality.failure()
    )


def test_a_scene_is_checked_for_what_it_has() -> None:
    ideal, loose = {"unaccounted_energy_part", "ideal_gap_part"}, {"penetration_part"}
    assert quality_of(*energy(0.0)).parts().keys() == ideal
    assert quality_of(*penetration(0.0)).parts().keys() == ideal | loose
    assert quality_of(*loose_run("clearance-pendulum")).parts().keys() == ideal - {"ideal_gap_part"} | loose
    flight = quality_of(*loose_run("clearance-pendulum")).parts()["penetration_part"]
    assert flight == 0.0, "the pin has not come to its wall yet"

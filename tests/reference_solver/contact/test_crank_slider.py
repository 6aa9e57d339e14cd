"""The reference solver on the scenes with compliant clearance: numbers known, independent truth, ledger."""

from functools import cache

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.contact_law import stiffness_of
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES, clearance, ideal_driven
from engine_models.scene.scene import Clearances, Scene
from reference_solver.solver import StepChoice
from studies.judges.converged_truth import COLLOCATION, EXTRAPOLATION
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J
from tests.helpers.crank_sliders import (
    FINE,
    POSITION_M,
    assert_same_touches,
    in_minimal_coordinates,
    short,
    solved,
    touches,
)
from tests.studies.truth.closed_forms.crank_slider import exact


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_slider_and_impacts_agree_with_an_independent_integration(name: str) -> None:
    scene = short(name)
    truth, twin = (in_minimal_coordinates(scene, solver=solver) for solver in (COLLOCATION, EXTRAPOLATION))
    doubt = np.abs(truth.position[:, -1, 0] - twin.position[:, -1, 0]).max()
    assert doubt < POSITION_M / 4, f"two independent integrations differ by {doubt:.1e} m: past the horizon"
    run = solved(scene, FINE["driven" if "driven" in name else "free"])
    off = np.abs(run.q[:, -3] - truth.position[:, -1, 0]).max()
    assert off < POSITION_M, f"slider off by {off:.1e} m"
    assert_same_touches(scene, run, truth)


def test_the_standard_cases_first_impacts_and_peak_force_are_those_known() -> None:
    scene = CLEARANCE_SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 0.001})
    first = touches(solved(scene, FINE["driven"]))[:3]
    np.testing.assert_allclose(first["time_s"], [0.000227285, 0.000636428, 0.000749140], atol=5e-10, rtol=0)
    np.testing.assert_allclose(first["rate"], [4.385827, 2.748345, 1.825504], atol=5e-7, rtol=0)
    around = scene.model_copy(update={"end_time_s": 0.0003})
    peak = solved(around, FINE["driven"], 30_000).normal_force_N.max()
    assert peak == pytest.approx(45870, abs=0.5)
    # t1 ~ sqrt(2c/a0), v1 ~ sqrt(2 c a0), a0 = r w^2 (1 + r/L): within 0.5 %.
    a0, c = 0.05 * (2 * np.pi * 5000 / 60) ** 2 * (1 + 0.05 / 0.12), 5e-4
    assert first["time_s"][0] == pytest.approx(np.sqrt(2 * c / a0), rel=5e-3)
    assert first["rate"][0] == pytest.approx(np.sqrt(2 * c * a0), rel=5e-3)


def test_hertz_stiffness_is_that_known_of_steel() -> None:
    assert stiffness_of(clearance(5e-4)) == pytest.approx(6.610e10, rel=1e-4)


@cache
def engine_run(name: str, step: float) -> tuple[Scene, Trajectory]:
    """Return a run with 800 steps per contact at 1e-5 s, and in proportion at other steps."""
    scene, engine = short(name), ReferenceEngine(steps_per_contact=800)
    return scene, engine.simulate(scene, RunSettings(step_s=step, samples=60))


@pytest.mark.parametrize("name", CLEARANCE_SCENES)
def test_the_energy_ledger_closes(name: str) -> None:
    scene, run = engine_run(name, 5e-6 if "driven" in name else 1e-5)
    play = kinetic_energy_J(scene, run).max()
    residual = np.abs(energy_balance_residual_J(scene, run)).max() / play
    assert residual < 1e-11, f"residual {residual:.1e} of {play:.3g} J"
    lost = run.dissipated_energy_J
    assert lost is not None
    assert lost[-1] > 1e-5 * play, "the contacts did dissipate, which the ledger has to know"


@pytest.mark.parametrize("name", RIGID_SCENES)
def test_the_rigid_twins_run_and_their_ledger_closes(name: str) -> None:
    scene = RIGID_SCENES[name]().model_copy(update={"end_time_s": 0.002 if "driven" in name else 0.02})
    run = ReferenceEngine().simulate(scene, RunSettings(step_s=5e-7, samples=10))
    play = kinetic_energy_J(scene, run).max()
    residual = np.abs(energy_balance_residual_J(scene, run)).max() / play
    # Largest where a pin follows its wall on the smallest circle, 0.02 mm: 5.6e-10, falling by 16 with half
    # the step; the others are below 1e-12.
    assert residual < 1e-9, f"residual {residual:.1e} of {play:.3g} J"
    for contact in run.contacts.values():
        assert contact.penetration_m.max() < 1e-12, "a rigid pin stays inside"
    assert run.dissipated_energy_J is not None
    assert run.dissipated_energy_J[-1] > 0


@pytest.mark.parametrize(
    ("steps", "per_contact"),
    # Round-off is at 1e-11 J, a hundredth of the smallest residual in contact, a fifteenth of that in flight.
    [((2e-6,) * 3, (80, 120, 160)), ((2e-5, 1.6e-5, 1.2e-5), (1000,) * 3)],
    ids=["in contact", "in flight"],
)
def test_the_ledgers_residual_falls_at_order_four(
    steps: tuple[float, ...], per_contact: tuple[float, ...]
) -> None:
    # The first impact of the standard case: one rate is refined, the other so fine that it does not show.
    scene = CLEARANCE_SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 0.0003})
    found = []
    for step, number in zip(steps, per_contact, strict=True):
        engine = ReferenceEngine(steps_per_contact=number * step / 1e-5)
        run = engine.simulate(scene, RunSettings(step_s=step, samples=1))
        found.append(abs(energy_balance_residual_J(scene, run)[-1]))
    rates = steps if len(set(steps)) > 1 else [1 / number for number in per_contact]
    order = np.polyfit(np.log(rates), np.log(found), 1)[0]
    assert abs(order - 4) < 0.2, f"order {order:.2f} of {found}"


def test_the_clearance_scene_tends_to_the_ideal_one_as_the_clearance_vanishes() -> None:
    ideal = ideal_driven().model_copy(update={"end_time_s": 0.002})
    truth = exact(ideal, 20).position[:, -1, 0]
    found = []
    for c in (1e-4, 1e-5, 1e-6):
        scene = ideal.model_copy(update={"clearance": Clearances(B=clearance(c, "hu-guo", 0.5))})
        found.append(np.abs(solved(scene, StepChoice(2e-6, 100), 20).q[:, 6] - truth).max())
    # The pin strays by the clearance and by the penetration, 1e-5 m for steel under 3e3 N.
    assert found[0] < 2e-4, f"{found}"
    assert found[1] < found[0] / 2, f"{found}"
    assert found[2] < found[1], f"{found}"


def test_the_plain_algorithm_without_located_events_is_less_accurate_and_says_so_in_its_ledger() -> None:
    scene = short("clearance-free-0.5mm")
    settings = RunSettings(step_s=2e-6, samples=60)
    plain = ReferenceEngine(locate_events=False).simulate(scene, settings)
    located = ReferenceEngine().simulate(scene, RunSettings(step_s=2e-5, samples=60))
    residuals = [np.abs(energy_balance_residual_J(scene, run)).max() for run in (plain, located)]
    assert plain.steps > located.steps, f"{plain.steps} against {located.steps} steps"
    assert residuals[0] > 100 * residuals[1], f"{residuals}"

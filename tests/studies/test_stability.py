"""The stability study: its cells, theory's first impact, and verdicts that keep their bounds."""

from math import sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engine_models.scene.library import SCENES
from reference_solver.mechanism.contacts import stiffness_of
from studies import stability
from studies.case import Case
from studies.stability import ERROR, GAIN, LOSS, VIOLATION, first_impact
from tests.helpers.crank_sliders import crank_slider


def the_case(engine: str, arm: str, step_s: float, factor: float = 1.0) -> Case:
    """Return the one case of the full set with a part of steel's stiffness and this step."""
    (match,) = [
        case
        for case in stability.cases(full=True)
        if (case.engine, case.arm.name) == (engine, arm)
        and case.scene.name == f"stability-stiffness-{factor:g}"
        and step_s == pytest.approx(case.run.step_s)
    ]
    return match


def test_a_hertz_bounce_has_the_limit_of_0_702_and_0_496_of_its_duration() -> None:
    # Stiff: far above any gravity or inertia force while in contact: the closed form of the free bounce.
    scene = the_case("reference", "located", 1e-5, 1000.0).scene
    energy, frequency = first_impact(scene)
    clearance, slider = scene.clearance["B"], crank_slider(scene)[2]
    assert clearance is not None
    speed = sqrt(2 * energy / slider.mass_kg)
    depth = (5 * slider.mass_kg * speed**2 / (4 * stiffness_of(clearance))) ** 0.4
    duration = 2.94327518 * depth / speed
    assert 2 * sqrt(2) / frequency == pytest.approx(0.702 * duration, rel=1e-3)
    assert 2 / frequency == pytest.approx(0.496 * duration, rel=2e-3)


# Verdicts


GOOD = dict.fromkeys((ERROR, VIOLATION, GAIN, LOSS), 0.0)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        (ERROR, 0.009, stability.ACCURATE),
        (ERROR, 0.011, stability.INACCURATE),
        (VIOLATION, 0.011, stability.INACCURATE),
        (VIOLATION, 1.1, stability.DIVERGED),
        (LOSS, 0.051, stability.INACCURATE),
        (GAIN, 0.049, stability.ACCURATE),
        (GAIN, 0.051, stability.GROWING),
        (GAIN, 11.0, stability.DIVERGED),
        (LOSS, 11.0, stability.DIVERGED),
        (ERROR, np.nan, stability.DIVERGED),
        (GAIN, np.inf, stability.DIVERGED),
    ],
)
def test_a_bound_exceeded_decides_the_verdict(name: str, value: float, expected: str) -> None:
    assert stability.verdict_of({**GOOD, name: value})[0] == expected


def test_gains_and_losses_are_those_of_the_residual_in_first_impacts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 2 J, 0.09 gained at most and 0.06 lost; 2 µm off before the sixth touch, of half a millimetre."""
    monkeypatch.setattr(stability, "energy_balance_residual_J", lambda *_: np.array([0.0, 0.09, -0.06, 0.0]))
    monkeypatch.setattr(stability, "constraint_violation_m", lambda *_: np.array([0.0, 1e-6, 0.0, 0.0]))
    monkeypatch.setattr(stability, "checked", lambda *_: {"quality_failure": ""})
    touches = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 2.5])
    joint = SimpleNamespace(impacts=SimpleNamespace(time_s=touches))
    still = np.zeros((4, 3, 3))
    truth: Any = SimpleNamespace(time_s=np.arange(4.0), position=still, velocity=still, contacts={"B": joint})
    place = still.copy()
    place[:, -1, 0] = 0.0, 1e-6, -2e-6, 1.0
    run: Any = SimpleNamespace(time_s=np.arange(4.0), position=place, velocity=still, contacts={})
    row = stability.judged(SCENES["clearance-driven-0.5mm"](), run, truth, 4, 2.0)
    names = (stability.GAIN, stability.LOSS, stability.VIOLATION, stability.ERROR)
    assert [row[name] for name in names] == pytest.approx([0.045, 0.03, 0.002, 0.004])
    assert (row["verdict"], row["compared_until_s"]) == ("accurate", 2.0)

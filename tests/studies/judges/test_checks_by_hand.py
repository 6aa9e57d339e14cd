"""Checks of the gallery of extremes on made-up motions, whose errors are worked out here."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engine_models.engine import Contact, FloatArray, Impacts
from studies.extremes import checks


def contact(gap_m: FloatArray, impulse_N_s: list[float], impulses: list[float]) -> Contact:
    zero, told = np.zeros(len(gap_m)), np.array(impulses)
    impacts = Impacts(told, told, told, told, told)
    return Contact(gap_m, zero, zero, None, zero, np.array(impulse_N_s), zero, None, None, impacts)


def test_a_loose_pin_is_judged_by_the_farther_of_the_truths_up_to_where_they_agree(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """5 m out, half a metre off one truth and a metre off the other, aslant; past the third sample by "
    "miles."""
    place = np.array([[3.0, 4.0], [0.0, 1.0], [0.0, 2.0], [0.0, 0.0]])
    off, far = (
        np.array([[0.0, 0.0], [0.3, -0.4], [0.0, 0.0], [0.0, 0.0]]),
        np.array([[0.0, 0.0]] * 3 + [[9.0, 9.0]]),
    )
    truth = SimpleNamespace(contacts={"B": contact(place, [0.0, 1.0, 2.0, 9.0], [])})
    repeat = SimpleNamespace(contacts={"B": contact(place - off, [0.0, 0.9, 2.0, 9.0], [])})
    run: Any = SimpleNamespace(
        contacts={"B": contact(place + off + far, [0.0, 1.1, 2.0, 0.0], [])}, time_s=np.arange(4.0)
    )
    monkeypatch.setattr(checks, "converged", lambda *_: (truth, (repeat,)))
    monkeypatch.setattr(checks, "followed", lambda *_: 3)
    scene: Any = SimpleNamespace(joints_with_clearance=("B",))
    assert checks.loose_motion(scene, run) == pytest.approx(
        {"place in the bearing at B": 1.0 / 5.0, "impulse at B": 0.2 / 2.0}
    )


def test_the_impulse_of_a_bounce_is_momentum_and_weight(monkeypatch: pytest.MonkeyPatch) -> None:
    """2 kg at 3 m/s upwards after a second's fall of 10 m/s²: 26 N s. It is 2 m lower a second later."""
    height = np.array([9.0, 4.0, 2.0])
    monkeypatch.setattr(checks, "dropped_wheel", lambda *_: height)
    scene: Any = SimpleNamespace(crank=SimpleNamespace(mass_kg=2.0), gravity_m_s2=10.0)
    position = np.zeros((3, 1, 3))
    position[:, 0, 1] = height + np.array([0.0, 0.0, 0.7])
    told = contact(np.zeros((3, 2)), [0.0, 0.0, 0.0], [20.0, 3.4])
    run: Any = SimpleNamespace(time_s=np.arange(3.0), position=position, contacts={"O": told})
    assert checks.bounced(scene, run) == pytest.approx({"height": 0.1, "impulse of the bounce": 0.1})

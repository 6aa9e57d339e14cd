"""Verdicts of extremes and stability on made-up motions, whose errors are worked out here."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engine_models.engine import Contact, FloatArray, Impacts
from engine_models.scene.library import SCENES
from studies import extremes, stability


def contact(gap_m: FloatArray, impulse_N_s: list[float], impulses: list[float]) -> Contact:
    zero, told = np.zeros(len(gap_m)), np.array(impulses)
    impacts = Impacts(*[told] * 9)
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
    monkeypatch.setattr(extremes, "converged", lambda *_: (truth, (repeat,)))
    monkeypatch.setattr(extremes, "followed", lambda *_: 3)
    scene: Any = SimpleNamespace(joints_with_clearance=("B",))
    assert extremes.loose_motion(scene, run) == pytest.approx(
        {"place in the bearing at B": 1.0 / 5.0, "impulse at B": 0.2 / 2.0}
    )


def test_a_bounce_is_judged_by_its_height_and_all_its_impulse(monkeypatch: pytest.MonkeyPatch) -> None:
    """It falls 7 m and is 0.7 m off in the end; of 26 N s 23.4 are told."""
    position = np.zeros((3, 1, 3))
    position[:, 0, 1] = 9.0, 4.0, 2.0
    true = SimpleNamespace(position=position, contacts={"O": contact(np.zeros((3, 2)), [0.0], [26.0])})
    monkeypatch.setattr(extremes, "converged", lambda *_: (true, ()))
    off = position + np.array([0.0, 0.0, 0.7])[:, None, None] * [0.0, 1.0, 0.0]
    told = contact(np.zeros((3, 2)), [0.0], [20.0, 3.4])
    run: Any = SimpleNamespace(time_s=np.arange(3.0), position=off, contacts={"O": told})
    scene: Any = SimpleNamespace()
    assert extremes.bounced(scene, run) == pytest.approx({"height": 0.1, "impulse of the bounce": 0.1})


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

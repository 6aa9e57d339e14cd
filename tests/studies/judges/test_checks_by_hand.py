"""Verdicts of stability on made-up motions, whose errors are worked out here."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engine_models.scene.library import SCENES
from studies import stability


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

"""The loop of error control without contacts takes the steps of the one that looks for events."""

import numpy as np
import pytest

from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from reference_solver.compiled import faces
from reference_solver.contact import adaptive_loop
from reference_solver.solution import Solution
from reference_solver.solver import ErrorControl, Solver
from tests.helpers.crank_sliders import start

#: Some steps of both, in numbers, with samples within them.
END_S, SAMPLES, CONTROL = 2e-3, 20, ErrorControl(1e-9)


def run(name: str) -> Solution:
    scene = IDEAL_SCENES[name]()
    q, v = start(scene)
    return Solver(mechanism_of(scene), q, CONTROL, compiled=False).run(q, v, END_S, SAMPLES)


@pytest.mark.parametrize("name", ["ideal-free", "ideal-compressor"])
def test_without_contacts_nothing_changes_if_no_events_are_sought(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = run(name)
    monkeypatch.setattr(faces, "loop_of", lambda _: adaptive_loop)
    seeking = run(name)
    assert own.steps == seeking.steps
    for column in ("q", "v", "multipliers"):
        assert np.array_equal(getattr(own, column), getattr(seeking, column)), column
    assert all(np.array_equal(own.sums[name], seeking.sums[name]) for name in own.sums)

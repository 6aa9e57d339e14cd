"""Evaluations that the reference tells, against the calls that its readable equations get in steps."""

from typing import Any

import pytest

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES
from reference_solver.equations import Equations

RUN = RunSettings(1e-4, 2)


@pytest.mark.parametrize("stabilisation", ["none", "baumgarte", "projection"])
@pytest.mark.parametrize("name", ["ideal-free", "ideal-driven"])
def test_the_evaluations_told_are_those_made(
    monkeypatch: pytest.MonkeyPatch, name: str, stabilisation: Any
) -> None:
    scene, calls, required = SCENES[name]().model_copy(update={"end_time_s": 0.002}), 0, Equations.required

    def counted(self: Equations, *given: Any) -> Any:
        nonlocal calls
        calls += 1
        return required(self, *given)

    engine = ReferenceEngine(stabilisation=stabilisation)
    told = engine.simulate(scene, RUN).evaluations
    monkeypatch.setattr(Equations, "required", counted)
    ReferenceEngine(stabilisation=stabilisation, kernel="readable").simulate(scene, RUN)
    assert told == calls


@pytest.mark.parametrize(
    ("name", "settings"),
    [("ideal-free", {"method": "dop853"}), ("clearance-free-0.5mm", {})],
)
def test_none_are_told_where_steps_may_be_tried_in_vain(name: str, settings: dict[str, Any]) -> None:
    scene = SCENES[name]().model_copy(update={"end_time_s": 0.002})
    assert ReferenceEngine(**settings).simulate(scene, RUN).evaluations is None


def test_none_are_told_where_a_singular_position_is_near() -> None:
    scene = SCENES["ideal-free"]()
    rod = scene.rod.model_copy(update={"length_m": 1.01 * scene.crank.length_m})  # type: ignore[union-attr]
    short = scene.model_copy(update={"end_time_s": 0.002, "rod": rod})
    assert ReferenceEngine().simulate(short, RUN).evaluations is None

"""Evaluations that the Exudyn engine tells, against a load in its model that counts how often it is asked."""

from typing import Any

import exudyn as exu
import pytest
from exudyn import itemInterface

from engine_models.engine import RunSettings
from engine_models.exudyn.engine import ExudynEngine
from engine_models.scene.library import SCENES

items: Any = itemInterface  # its constructors carry no types


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Have every model carry one more mass, with nothing but that load, and return the times it is asked."""
    times: list[float] = []
    assemble = exu.MainSystem.Assemble

    def counted(mbs: Any) -> None:
        node = mbs.AddNode(
            items.Node1D(referenceCoordinates=[0], initialCoordinates=[0], initialVelocities=[0])
        )
        mbs.AddObject(items.ObjectMass1D(physicsMass=1, nodeNumber=node))
        marker = mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))

        def count(_: Any, time_s: float, __: float) -> float:
            times.append(time_s)
            return 0.0

        mbs.AddLoad(items.LoadCoordinate(markerNumber=marker, load=1, loadUserFunction=count))
        assemble(mbs)

    monkeypatch.setattr(exu.MainSystem, "Assemble", counted)
    return times


@pytest.mark.parametrize(
    ("scene", "step_s", "settings"),
    [
        ("ideal-free", 1e-3, {}),
        ("ideal-free", 1e-3, {"solver": "GeneralizedAlpha"}),
        ("ideal-driven", 1e-4, {}),
        ("clearance-driven-0.5mm", 2e-6, {"solver": "TrapezoidalIndex2"}),
        ("clearance-driven-0.5mm", 1e-4, {"solver": "DOPRI5", "step_tolerance": 1e-8}),
        (
            "clearance-driven-0.5mm",
            1e-4,
            {"solver": "DOPRI5", "step_tolerance": 1e-8, "locate_events": False},
        ),
        ("clearance-driven-0.5mm", 2e-6, {"solver": "ODE23", "step_tolerance": 1e-6}),
        *(
            ("clearance-driven-0.5mm", 5e-6, {"solver": solver})
            for solver in ("RK67", "RK44", "RK33", "ExplicitMidpoint")
        ),
    ],
)
def test_the_evaluations_told_are_those_made(
    asked: list[float], scene: str, step_s: float, settings: dict[str, Any]
) -> None:
    short = SCENES[scene]().model_copy(update={"end_time_s": 0.004})
    run = ExudynEngine(**settings).simulate(short, RunSettings(step_s, 4))
    assert run.evaluations == len(asked)

"""What every engine owes on every scene that it supports (see ``studies.conform``)."""

import pytest

from engine_models.engine import Engine, UnsupportedScene
from engine_models.engines import ENGINES, make_engine
from engine_models.scene.library import ALL_SCENES, RIGID_SCENES
from studies.conform import verdicts

#: The reference's second method owes the same.
CONTROLLED = "reference by DOP853"
BOTH = [*ENGINES, CONTROLLED]


def engine_of(engine: str) -> Engine:
    """Return an engine at its defaults, or the reference with error control."""
    return make_engine("reference", method="dop853") if engine == CONTROLLED else make_engine(engine)


def refused(engine: str) -> set[str]:
    """Return the library scenes that an engine refuses."""
    names = set()
    for name, make in ALL_SCENES.items():
        try:
            engine_of(engine).check(make())
        except UnsupportedScene:
            names.add(name)
    return names


def test_every_engine_runs_all_scenes_but_what_its_model_lacks() -> None:
    assert {engine: names for engine in BOTH if (names := refused(engine))} == {
        "exudyn": {*RIGID_SCENES},
        "pymunk": {"scotch-yoke"},
        "scipy": {"rigid-driven-damped"},
    }


@pytest.mark.accuracy
@pytest.mark.parametrize("engine", BOTH)
def test_every_claim_holds(engine: str) -> None:
    failed = [verdict for verdict in verdicts(engine_of(engine)) if not verdict.holds]
    assert not failed, failed

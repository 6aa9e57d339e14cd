"""What every engine owes on every scene that it supports (see ``studies.conformance``)."""

from functools import cache

import pytest

from engine_models.engine import Engine
from engine_models.engines import ENGINES, make_engine
from engine_models.scene.library import RIGID_SCENES
from studies.conformance.claims import CLAIMS, Trial
from studies.conformance.mechanisms import NAMES, scene_of
from studies.conformance.orders import states_its_order
from studies.conformance.verdicts import scenes_of

#: The reference's second method owes the same.
CONTROLLED = "reference by DOP853"
BOTH = [*ENGINES, CONTROLLED]


def engine_of(engine: str) -> Engine:
    """Return an engine at its defaults, or the reference with error control."""
    return make_engine("reference", method="dop853") if engine == CONTROLLED else make_engine(engine)


def supported() -> list[tuple[str, str]]:
    return [(engine, name) for engine in BOTH for name in scenes_of(engine_of(engine))]


@cache
def trial(engine: str, name: str) -> Trial:
    return Trial(engine_of(engine), scene_of(name))


def test_every_engine_runs_all_scenes_but_rigid_walls_in_exudyn_and_a_slot_in_pymunk() -> None:
    left_out = {engine: {*NAMES} - {*scenes_of(engine_of(engine))} for engine in BOTH}
    assert {engine: names for engine, names in left_out.items() if names} == {
        "exudyn": {*RIGID_SCENES},
        "pymunk": {"scotch-yoke"},
    }


@pytest.mark.accuracy
@pytest.mark.parametrize(("engine", "name"), supported())
@pytest.mark.parametrize("claim", CLAIMS)
def test_a_claim_holds(engine: str, name: str, claim: str) -> None:
    if refusal := trial(engine, name).refusal:
        pytest.skip(refusal)
    holds, measured = CLAIMS[claim](trial(engine, name))
    assert holds, measured


@pytest.mark.accuracy
@pytest.mark.parametrize("engine", BOTH)
def test_errors_fall_by_the_order_or_the_tolerance_that_an_engine_states(engine: str) -> None:
    holds, measured = states_its_order(engine_of(engine))
    assert holds, measured

"""What every engine owes on every scene that it supports (see ``studies.conformance``)."""

from functools import cache

import pytest

from engine_models.engine import Engine
from engine_models.engines import ENGINES, make_engine
from engine_models.scene.library import SCENES
from studies.conformance.claims import CLAIMS, Trial
from studies.conformance.mechanisms import ENDS_S, scene_of
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


def test_every_engine_runs_some_scene_of_every_kind_it_claims() -> None:
    kinds: dict[str, set[str]] = {engine: set() for engine in BOTH}
    for engine, name in supported():
        if name in SCENES:
            kinds[engine].add(name.partition("-")[0])
    assert all(kinds.values())
    without_rigid = {"ideal", "clearance"}
    with_rigid = {"reference", CONTROLLED, "pymunk", "scipy"}
    known = {engine: {*without_rigid, "rigid"} for engine in with_rigid}
    known["exudyn"] = without_rigid
    assert {engine: kinds[engine] for engine in known} == known


def test_every_engine_runs_every_mechanism_but_a_slot_in_pymunk() -> None:
    runs = {engine: {name for one, name in supported() if one == engine} for engine in BOTH}
    left_out = {engine: ENDS_S.keys() - runs[engine] for engine in BOTH}
    assert {engine: names for engine, names in left_out.items() if names} == {"pymunk": {"scotch-yoke"}}


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

"""Twenty of the random scenes, of few topologies, so that few kernels are compiled."""

import pytest

from tests.random_scenes.judging import HELD, WARNED, verdicts
from tests.random_scenes.truths import DEFAULT, Kind, truths

#: Several joints, light links, friction with kinks and without, what is chaotic soon, bounces without end.
EVERYDAY: dict[Kind, tuple[int, ...]] = {
    "compliant": (2, 3, 9, 10, 13, 23, 53, 57, 61, 65, 73, 74),
    "rigid": (12, 16, 19, 29, 40, 41, 72, 76),
}


@pytest.mark.parametrize("kind", EVERYDAY)
def test_every_promise_is_held(kind: Kind) -> None:
    chosen = [truth for truth in truths(kind) if truth.seed in EVERYDAY[kind]]
    assert len(chosen) == len(EVERYDAY[kind])
    for truth in chosen:
        for verdict in verdicts(truth, "reference"):
            allowed = (HELD, WARNED) if verdict.tolerance == DEFAULT else (HELD,)
            assert verdict.outcome in allowed, f"{kind}: {verdict}"

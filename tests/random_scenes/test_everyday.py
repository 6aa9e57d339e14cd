"""Some twenty of the random scenes, of few topologies, so that few kernels are compiled."""

import pytest

from tests.random_scenes.judging import BROKEN, HELD, REFUSED, verdicts
from tests.random_scenes.truths import Kind, truths

#: Several joints, light links, friction, what is chaotic soon, and bounces without end.
EVERYDAY: dict[Kind, tuple[int, ...]] = {
    "compliant": (2, 3, 9, 10, 13, 53, 57, 61, 65, 73, 74, 117),
    "rigid": (12, 16, 19, 29, 40, 41, 72, 76, 83),
}
#: Verdicts of a kind that may be refusals: where a truth is certain to a hundredth of the tolerance just so.
REFUSALS = 1


@pytest.mark.accuracy
@pytest.mark.parametrize("kind", EVERYDAY)
def test_every_promise_is_held(kind: Kind) -> None:
    chosen = [truth for truth in truths(kind) if truth.seed in EVERYDAY[kind]]
    assert len(chosen) == len(EVERYDAY[kind])
    found = [verdict for truth in chosen for verdict in verdicts(truth, "reference")]
    assert [verdict for verdict in found if verdict.outcome == BROKEN] == []
    refused = [verdict for verdict in found if verdict.outcome == REFUSED]
    assert len(refused) <= REFUSALS, f"{kind}: {refused}"
    assert sum(verdict.outcome == HELD for verdict in found) > 0.9 * len(found)

"""Random runs past singular positions: none may be wrong without a word."""

from collections import Counter

from reference_solver.solver import Stabilisation
from tests.helpers.singular import PASSING, STABILISED, random_runs

RUNS = 1000
#: Stabilisation, and whether DOP853 chooses the steps. (Without projection its runs take for ever.)
WAYS: dict[str, tuple[Stabilisation, bool]] = {
    "RK4, projection": (STABILISED["projection"], False),
    "RK4, Baumgarte": (STABILISED["baumgarte"], False),
    "RK4, plain": ("none", False),
    "DOP853, projection": (STABILISED["projection"], True),
}


def singular(seed: int, count: int = RUNS) -> dict[str, int]:
    """Run each mechanism in each way so often; return what came, by words for it."""
    found: Counter[str] = Counter()
    for name, make in PASSING.items():
        passing = make()
        for way, (stabilisation, controlled) in WAYS.items():
            tally = random_runs(passing, stabilisation, count, seed, controlled)
            assert not tally.wrong, f"{name}, {way}: {tally.wrong}"
            why = Counter(type(error).__name__ for error in tally.refused)
            said = ", ".join(f"{number} {reason}" for reason, number in why.items())
            print(f"{name}, {way}: {tally.right} right, {len(tally.refused)} refused {said}", flush=True)
            found[f"{way}: right"] += tally.right
            found[f"{way}: refused"] += len(tally.refused)
    return dict(found)

"""Hold random scenes against their truths: ``python -m tests.random_scenes [--engine NAME]``.

It prints what became of them at every tolerance, and who broke a promise or refused one, and why; its exit
code is 1 if a promise was broken. Every scene compiles kernels of its own the first time. With ``--out`` the
engine's rows of a table are renewed, as in ``docs/reference/random-scenes.csv``.
"""

import argparse
import random
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import pandas as pd

from engine_models.engines import ENGINES
from tests.random_scenes.judging import BROKEN, HELD, REFUSED, WARNED, Verdict, is_judged, verdicts
from tests.random_scenes.truths import Kind, Truth, truths

KINDS: tuple[Kind, ...] = ("compliant", "rigid")
#: What tells the rows of a run in the table.
RUN = ["engine", "walls"]


def main() -> int:
    """Run the scenes asked for, and return how that ended."""
    parser = argparse.ArgumentParser(prog="python -m tests.random_scenes", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="compliant, rigid; both")
    parser.add_argument("--engine", choices=ENGINES, default="reference")
    parser.add_argument("--draw", type=int, help="how many scenes of a kind, drawn by a seeded lot; all")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="the table (CSV) to renew")
    asked, broken = parser.parse_args(), 0
    for kind in asked.kinds or KINDS:
        scenes = _drawn([truth for truth in truths(kind) if is_judged(truth, asked.engine)], asked.draw)
        found = list[Verdict]()
        with ProcessPoolExecutor(asked.jobs) as pool:
            runs = [pool.submit(_listed, asked.engine, scene) for scene in scenes]
            for number, run in enumerate(as_completed(runs), 1):
                found += run.result()
                for one in run.result():
                    if one.outcome in (BROKEN, REFUSED):
                        print(f"{kind} {one.seed} at {one.tolerance}: {one.outcome}, {one.error_m:.2g} m, "
                              f"{one.reason}", flush=True)  # fmt: skip
                if sys.stderr.isatty():
                    print(f"\r{kind}: {number} of {len(scenes)}", end="", file=sys.stderr)
        broken += sum(one.outcome == BROKEN for one in found)
        table = _table(asked.engine, kind, found)
        print(table.to_string(index=False))
        if asked.out and found:
            _renew(asked.out, table)
    return int(broken > 0)


def _drawn(scenes: list[Truth], count: int | None) -> list[Truth]:
    """Return so many scenes, or all, the same ones every time."""
    return scenes if count is None else random.Random(1).sample(scenes, min(count, len(scenes)))


def _listed(engine: str, truth: Truth) -> list[Verdict]:
    return list(verdicts(truth, engine))


def _table(engine: str, kind: str, found: list[Verdict]) -> pd.DataFrame:
    """Return a row for each tolerance, with how many scenes were judged at it and what became of them."""
    rows = []
    for tolerance in sorted({one.tolerance for one in found}, key=lambda at: (isinstance(at, str), str(at))):
        counts = Counter(one.outcome for one in found if one.tolerance == tolerance)
        outcomes = {name: counts[name] for name in (HELD, BROKEN, WARNED, REFUSED)}
        run = dict(zip(RUN, (engine, kind), strict=True))
        rows.append(run | {"asked for": tolerance, "scenes": counts.total()} | outcomes)
    return pd.DataFrame(rows)


def _renew(path: Path, table: pd.DataFrame) -> None:
    """Put a run's rows in the place of those that the file has of it."""
    if path.exists():
        old = pd.read_csv(path, dtype=str)
        mine = old[RUN].apply(tuple, axis=1).isin([tuple(table[RUN].iloc[0])])
        table = pd.concat([old[~mine], table]).sort_values(RUN, kind="stable")
    table.to_csv(path, index=False)


if __name__ == "__main__":
    sys.exit(main())

"""Plant bugs, and see who catches them: ``python -m tests.planted_bugs [NAME ...] [--sample K]``.

A bug that nobody catches, one that no longer fits its file, and a test that fails without any bug are
failures, and the exit code is then 1.
"""

import argparse
import sys
from collections.abc import Sequence
from random import Random, randrange

from tests.planted_bugs.catalogue import Bug, bugs
from tests.planted_bugs.planting import copies


def main() -> int:
    """Plant the bugs asked for, and return how that ended."""
    parser = argparse.ArgumentParser(prog="python -m tests.planted_bugs", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="bugs, or beginnings of their files; all")
    parser.add_argument("--jobs", type=int, default=2, help="how many copies are worked in at once")
    parser.add_argument("--sample", type=int, metavar="K", help="so many, drawn at random")
    parser.add_argument("--seed", type=int, default=randrange(10**6), help="what decides the draw")
    asked = parser.parse_args()
    chosen = [bug for bug in bugs() if _asked_for(bug, asked.names)]
    if not chosen:
        parser.error(f"NAME: expected bugs' names or files, got {', '.join(asked.names)}")
    if asked.sample is not None:
        print(f"seed {asked.seed}", flush=True)
        chosen = Random(asked.seed).sample(chosen, min(asked.sample, len(chosen)))
    wrong = planted(chosen, asked.jobs)
    print("\n".join([*wrong, f"{len(chosen)} bugs planted, {len(wrong)} failures"]))
    return int(bool(wrong))


def planted(chosen: Sequence[Bug], jobs: int) -> list[str]:
    """Plant bugs, and return in a line each what is wrong."""
    wrong, catching = list[str](), set[str]()
    with copies(jobs) as places:
        for number, one in enumerate(places.outcomes(chosen), 1):
            catching.add(one.caught_by)
            if not one.caught_by:
                wrong.append(f"{one.bug.name}: caught by nobody ({one.said or 'all passed'})")
            who = one.caught_by or "NOBODY"
            print(f"{number}/{len(chosen)} {one.bug.name}: {who}, {one.took_s:.0f} s: {one.said}", flush=True)
        anyway = places.failing(catching - {""})
    return wrong + [f"fails without a bug: {name}" for name in anyway]


def _asked_for(bug: Bug, names: Sequence[str]) -> bool:
    return not names or bug.name in names or any("/" in name and bug.file.startswith(name) for name in names)


if __name__ == "__main__":
    sys.exit(main())

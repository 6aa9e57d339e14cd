"""Hold all random scenes against their truths: ``python -m tests.random_scenes [--engine NAME]``.

It prints what became of them at every tolerance, and who broke a promise or refused one, and why; its exit
code is 1 if a promise was broken. Every scene compiles kernels of its own the first time.
"""

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed

from engine_models.engines import ENGINES
from tests.random_scenes.judging import BROKEN, HELD, REFUSED, WARNED, Verdict, verdicts
from tests.random_scenes.truths import Truth, truths


def main() -> int:
    """Run the scenes asked for, and return how that ended."""
    parser = argparse.ArgumentParser(prog="python -m tests.random_scenes", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="compliant, rigid; both")
    parser.add_argument("--engine", choices=ENGINES, default="reference")
    parser.add_argument("--first", type=int, help="how many scenes of a kind; all")
    parser.add_argument("--jobs", type=int, default=2)
    asked, broken = parser.parse_args(), 0
    for kind in asked.kinds or ("compliant", "rigid"):
        scenes, found = truths(kind)[: asked.first], list[Verdict]()
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
        print(_table(kind, found))
    return int(broken > 0)


def _listed(engine: str, truth: Truth) -> list[Verdict]:
    return list(verdicts(truth, engine))


def _table(kind: str, found: list[Verdict]) -> str:
    outcomes = (HELD, BROKEN, WARNED, REFUSED)
    lines = [f"| {kind} | " + " | ".join(outcomes) + " |", "|---" * 5 + "|"]
    for tolerance in dict.fromkeys(one.tolerance for one in found):
        counts = Counter(one.outcome for one in found if one.tolerance == tolerance)
        lines.append(f"| {tolerance} | " + " | ".join(str(counts[name]) for name in outcomes) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

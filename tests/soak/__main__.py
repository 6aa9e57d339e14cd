"""Soaks every part, ``python -m tests.soak [PART ...] [--seed N]``, and prints what it did and found."""

import argparse
from collections.abc import Callable
from pathlib import Path
from random import Random, randrange
from tempfile import TemporaryDirectory

from tests.soak import damage, fuzz, kills, library, singular

#: What was done and found, by words for it.
Figures = dict[str, int]
#: Scenes and options that are fuzzed, results that are damaged, and wrong calls of the library.
FUZZED, DAMAGED, CALLED = 2000, 100, 500
#: The parts by name; each raises AssertionError at what must not happen.
PARTS: dict[str, Callable[[Random, Path], Figures]] = {
    "kills": kills.kills,
    "pairs": kills.pairs,
    "full disk": kills.full_disk,
    "fuzz": lambda random, _: fuzz.fuzz(random.randrange(10**6), FUZZED),
    "damage": lambda random, _: damage.damage(random.randrange(10**6), DAMAGED),
    "library": lambda random, _: library.fuzz(random.randrange(10**6), CALLED),
    "singular": lambda random, _: singular.singular(random.randrange(10**6)),
}


def main() -> None:
    """Run the parts asked for, or all."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--seed", type=int, default=randrange(10**6), help="what decides the moments")
    asked = parser.parse_args()
    print(f"seed {asked.seed}", flush=True)
    found: dict[tuple[str, str], int] = {}
    for name in asked.parts or PARTS:
        with TemporaryDirectory(prefix="soak-") as folder:
            figures = PARTS[name](Random(f"{asked.seed} {name}"), Path(folder))
        found |= {(name, what): number for what, number in figures.items()}
    print("| part | what | how often |\n|---|---|---|")
    for (name, what), number in found.items():
        print(f"| {name} | {what} | {number} |")


main()

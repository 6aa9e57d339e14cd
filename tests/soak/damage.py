"""Results damaged in every way: what does not fit is refused in one line, or made again and said.

``python -m tests.soak.damage [SEED [CASES]]`` prints what came of each, and every case that broke the rules.
"""

import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from tests.helpers.command import Finished, crankslider
from tests.helpers.mischief import steady
from tests.helpers.row_files import read_rows

STUDY = ("run", "agreement", "--scene", "ideal-free", "--engine", "scipy", "--jobs", 1, "--out")
#: What a report says of rows that are not those of a finished run.
TO_DO = "run `crankslider run`"
#: What may be done to a file.
KINDS = (
    "cut",
    "emptied",
    "bits flipped",
    "lines left out",
    "noise",
    "more behind it",
    "gone",
    "there twice",
    "another in its place",
    "under another name",
    "under another's name",
)
#: What a case comes to when it breaks the rules, and else by its exit code.
BROKEN, CODES = "broken", {0: "made right", 1: "failed", 2: "refused"}


def damage(seed: int, cases: int) -> Counter[str]:
    """Damage a study from a seed, run the same commands again, and return what came of it."""
    some, found = random.Random(seed), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="damage-") as name:
        folder = Path(name)
        whole, again = studies(folder / "study")
        for number in range(cases):
            copy = Path(shutil.copytree(whole, folder / "copy"))
            file = some.choice(sorted(path for path in copy.rglob("*") if path.is_file()))
            others = [path for path in whole.rglob("*") if path.is_file() and path.suffix == file.suffix]
            kind = some.choice(KINDS)
            harm(some, kind, file, some.choice(sorted(others)))
            outcome = again(copy)
            found[outcome if outcome in CODES.values() else BROKEN] += 1
            if outcome not in CODES.values():
                print(
                    f"case {number} of seed {seed}: {file.relative_to(copy)}, {kind}: {outcome}", flush=True
                )
            shutil.rmtree(copy)
    return found


def studies(folder: Path) -> tuple[Path, Callable[[Path], str]]:
    """Return the folder of a small study, and what runs it again there and makes its report."""
    assert crankslider(*STUDY, folder).code == 0
    right, page = _rows(folder), _report(folder, folder.with_name("page"))
    assert page.code == 0, page.stderr

    def again(copy: Path) -> str:
        before, done = _report(copy, copy.with_name("before")), crankslider(*STUDY, copy)
        after = _report(copy, copy.with_name("after"))
        wrong = wrongs(before) or wrongs(done) or wrongs(after)
        if before.code == 0 and before.stdout != page.stdout and TO_DO not in before.stderr:
            wrong = wrong or f"another answer without a word: {before.stdout}{before.stderr}"
        if wrong or done.code:
            return wrong or CODES[int(str(done.code))]
        same = after.stdout == page.stdout and _rows(copy) == right
        return CODES[0] if same else f"other rows: {done.stderr}{after.stderr}"

    return folder, again


def wrongs(done: Finished) -> str:
    """Return what is wrong with how a command ended, empty if nothing is."""
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    if done.code not in CODES or "bug at" in done.stderr or "Traceback" in done.stderr:
        return f"exit {done.code}: {done.stderr}"
    return (
        ""
        if len(errors) == (done.code != 0)
        else f"exit {done.code} with {len(errors)} errors: {done.stderr}"
    )


def _report(results: Path, out: Path) -> Finished:
    done = crankslider("report", "--results", results, "--out", out)
    shutil.rmtree(out, ignore_errors=True)
    return done


def _rows(folder: Path) -> dict[str, object]:
    """Return the rows of a study by case, and its curves."""
    place = folder / "agreement"
    rows = {str(row["case"]): steady(row) for row in read_rows(place / "rows.jsonl")}
    curves = {case: (place / "curves" / f"{case}.npz").read_bytes() for case in rows}
    return {"rows": rows, "curves": curves}


def harm(some: random.Random, kind: str, file: Path, other: Path) -> None:
    """Do something to a file, which may take the place or the name of an ``other`` one like it."""
    content = file.read_bytes()
    match kind:
        case "cut":
            file.write_bytes(content[: some.randrange(len(content) + 1)])
        case "emptied":
            file.write_bytes(b"")
        case "bits flipped":
            flipped = bytearray(content)
            for _ in range(some.choice([1, 1, 8, 64]) if content else 0):
                flipped[some.randrange(len(content))] ^= 1 << some.randrange(8)
            file.write_bytes(flipped)
        case "lines left out":
            lines = content.splitlines(keepends=True)
            file.write_bytes(b"".join(line for line in lines if some.random() < 0.7))
        case "noise":
            file.write_bytes(some.randbytes(300))
        case "more behind it":
            file.write_bytes(content + b"{}\n")
        case "another in its place":
            file.write_bytes(other.read_bytes())
        case "under another name":
            file.rename(file.with_name(f"0{file.name}"))
        case "under another's name":
            file.rename(file.with_name(other.name))
        case "there twice":
            shutil.copy(file, file.with_name(f"9{file.name}"))
        case "gone":
            file.unlink()
        case _:
            raise AssertionError(kind)


if __name__ == "__main__":
    seed, cases = (int(word) for word in [*sys.argv[1:], *["1", "100"][len(sys.argv) - 1 :]])
    counts = damage(seed, cases)
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    sys.exit(BROKEN in counts)

"""Mutations made by machine: ``python -m tests.planted_bugs.mutations [FILE ...] [--sample K]``.

Of functions that judge, count or say, every comparison, sum, product, number, minimum and condition is
altered by itself, in a copy, and the function's tests are run. What survives is listed, and without an
explanation in ``EXPLAINED`` it is a failure. A test that does not come to its end has seen nothing.
"""

import argparse
import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random, randrange

from tests.planted_bugs.catalogue import ROOT, Inapplicable
from tests.planted_bugs.planting import copies

JUDGES = "tests/studies/judges"
BY_HAND = "tests/reports/test_by_hand.py"
#: Functions by their files, and the tests that are to see what is altered in them.
TARGETS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "reports/analysis/convergence.py": (
        ("observed_order", "local_orders", "_falling_stretch", "_bends"),
        ("tests/reports/test_convergence.py",),
    ),
    "reports/analysis/equal_error.py": (
        ("decided", "front", "_ways", "ratio", "levels", "candidates"),
        ("tests/reports/test_equal_error.py",),
    ),
    "reports/quantities.py": (("finished", "value", "scale", "floor", "with_largest"), (BY_HAND,)),
    "reports/tables.py": (
        ("number", "plain", "error", "listed"),
        ("tests/reports/test_page.py::test_errors_have_two_digits_and_none_below_the_uncertainty",),
    ),
    "reports/analysis/statistics.py": (
        ("student_interval", "difference", "_ratio", "verdict"),
        ("tests/reports/test_statistics.py", "tests/end_to_end/test_ensembles_page.py"),
    ),
    "studies/judges/metrics.py": (
        ("in_flight", "errors", "uncertainties", "scales", "with_suffix"),
        (f"{JUDGES}/test_metrics.py", f"{JUDGES}/test_by_hand.py"),
    ),
    "studies/judges/energy_rates.py": (
        ("blocks_of", "drift_rate", "growth_exponent", "thinned"),
        (f"{JUDGES}/test_energy_rates.py", f"{JUDGES}/test_by_hand.py"),
    ),
    "studies/judges/impact_matching.py": (
        ("match", "impact_errors"),
        (f"{JUDGES}/test_impact_matching.py", f"{JUDGES}/test_by_hand.py"),
    ),
    "studies/judges/converged_truth.py": (("reach",), (f"{JUDGES}/test_by_hand.py",)),
    "studies/judges/horizon.py": (("first_beyond_s",), (f"{JUDGES}/test_by_hand.py",)),
}
#: Why nobody sees what survives, by its name.
EXPLAINED: dict[str, str] = {
    "reports/analysis/convergence.py observed_order: < to <= at 16 of "
    "'if np.all(e < ABOVE_FLOOR * floor):'": (
        "an error is that many times the floor to the last bit nowhere"
    ),
    "reports/analysis/convergence.py observed_order: - to + at 11 of 'if end - begin < 2:'": (
        "a stretch is (0, 0), or has two points and more: difference and sum are below two together"
    ),
    "reports/analysis/convergence.py observed_order: > to >= at 14 of 'if spread > STRAIGHT:'": (
        "orders differ by the limit to the last bit nowhere"
    ),
    "reports/analysis/convergence.py _falling_stretch: 0 to 1 at 25 of "
    "'best, drop, begin = (0, 0), 0.0, 0'": ("a stretch of one point is as short as one of none"),
    "reports/analysis/convergence.py _falling_stretch: 0 to 1 at 28 of "
    "'best, drop, begin = (0, 0), 0.0, 0'": ("a stretch of one point is as short as one of none"),
    "reports/analysis/convergence.py _falling_stretch: < to <= at 39 of "
    "'if k == len(local) or local[k] < FALLING:'": ("a local order is the limit to the last bit nowhere"),
    "reports/analysis/convergence.py _falling_stretch: > to >= at 36 of 'if local[begin:k].sum() > drop:'": (
        "two stretches fall by as much to the last bit nowhere, and one of none is as good as none"
    ),
    "reports/analysis/convergence.py _bends: < to <= at 26 of 'return bool(local[-1] < BEND * local[-2])'": (
        "a local order is that part of the one before to the last bit nowhere"
    ),
    "reports/analysis/equal_error.py _ways: > to >= at 27 of "
    "'between = (errors[:-1] > error) & (error > errors[1:]) & np.isfinite(errors[:-1])'": (
        "at a setting itself the time is the setting's, which is first"
    ),
    "reports/analysis/equal_error.py _ways: > to >= at 45 of "
    "'between = (errors[:-1] > error) & (error > errors[1:]) & np.isfinite(errors[:-1])'": (
        "at a setting itself the time is the setting's, which is first"
    ),
    "reports/analysis/equal_error.py ratio: 0 to 1 at 34 of "
    "'drawn = np.random.default_rng(0).integers(len(ratios), "
    "size=(DRAWS, len(ratios)))'": "other draws of the same rounds",
    "reports/analysis/equal_error.py levels: < to <= at 19 of "
    "'if len(errors) < 2:'": "two settings have none between",
    "reports/analysis/equal_error.py levels: 2 to 3 at 21 of "
    "'if len(errors) < 2:'": "two settings have none between",
    "studies/judges/energy_rates.py blocks_of: < to <= at 13 of 'if whole < fewest:'": (
        "as many periods as the fewest blocks make as many blocks either way"
    ),
    "studies/judges/energy_rates.py growth_exponent: 60 to 61 at 55 of 'late = np.geomspace(LATE * "
    "time_s[-1], time_s[-1], 60)'": "one time more or less along the same curve",
    "studies/judges/energy_rates.py growth_exponent: - to + at 69 of 'at = np.unique(np.searchsorted(time_s, "
    "late).clip(1, len(time_s) - 1))'": "the last of the times is the run's last, to the bit",
    "studies/judges/converged_truth.py reach: > to >= at 41 of 'return int(np.argmax(np.append(apart > "
    "tolerance_m, True)))'": "a distance is the tolerance to the last bit nowhere",
}

OTHER_OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}
OTHER_NAMES = {"max": "min", "min": "max", "any": "all", "all": "any", "argmax": "argmin", "argmin": "argmax"}


@dataclass(frozen=True)
class Mutant:
    """A part of a file's text, from ``begin`` to ``end``, that becomes another."""

    name: str
    file: str
    tests: tuple[str, ...]
    begin: int
    end: int
    new: str

    def planted(self, text: str) -> str:
        """Return the text with the part replaced."""
        changed = text[: self.begin] + self.new + text[self.end :]
        try:
            ast.parse(changed)
        except SyntaxError:
            raise Inapplicable(f"{self.name}: no Python") from None
        return changed


def mutants(file: str) -> Iterator[Mutant]:
    """Yield the mutants of the functions of a file that are targets."""
    text = (ROOT / file).read_text(encoding="utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    functions, tests = TARGETS[file]

    def span(node: ast.AST) -> tuple[int, int]:
        """Return where a node stands; columns are counted in bytes, which lines of code have one of each."""
        place = ("lineno", "col_offset", "end_lineno", "end_col_offset")
        line, column, last, end = (int(getattr(node, name)) for name in place)
        return starts[line - 1] + column, starts[last - 1] + end

    def between(left: ast.AST, right: ast.AST, operator: ast.AST) -> Iterator[tuple[int, int, str]]:
        old, new = OTHER_OPERATORS.get(type(operator), ("", ""))
        begin = text.find(old, span(left)[1], span(right)[0]) if old else -1
        if begin >= 0:
            yield begin, begin + len(old), new

    def changes(node: ast.AST) -> Iterator[tuple[int, int, str]]:
        match node:
            case ast.BinOp(left=left, op=operator, right=right):
                yield from between(left, right, operator)
            case ast.Compare(left=left, ops=[operator], comparators=[right]):
                yield from between(left, right, operator)
            case ast.BoolOp(op=operator, values=[left, right, *_]):
                yield from between(left, right, operator)
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                yield *span(node), repr(value + 1)
            case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert(), operand=operand):
                yield *span(node), text[slice(*span(operand))]
            case ast.Attribute(attr=name) if name in OTHER_NAMES:
                end = span(node)[1]
                yield end - len(name), end, OTHER_NAMES[name]
            case ast.Name(id=name) if name in OTHER_NAMES:
                yield *span(node), OTHER_NAMES[name]

    for function in ast.walk(ast.parse(text)):
        if isinstance(function, ast.FunctionDef) and function.name in functions:
            parts = [part for statement in function.body for part in ast.walk(statement)]
            for begin, end, new in (change for part in parts for change in changes(part)):
                at = text[:begin].count("\n")
                line = text[starts[at] : starts[at + 1]].strip()
                what = f"{text[begin:end]} to {new} at {begin - starts[at]} of '{line}'"
                yield Mutant(f"{file} {function.name}: {what}", file, tests, begin, end, new)


def main() -> int:
    """Make the mutants asked for, and return how that ended."""
    parser = argparse.ArgumentParser(prog="python -m tests.planted_bugs.mutations", description=__doc__)
    parser.add_argument("files", nargs="*", metavar="FILE", help="beginnings of files; all")
    parser.add_argument("--jobs", type=int, default=2, help="how many copies are worked in at once")
    parser.add_argument("--sample", type=int, metavar="K", help="so many, drawn at random")
    parser.add_argument("--seed", type=int, default=randrange(10**6), help="what decides the draw")
    asked = parser.parse_args()
    files = [file for file in TARGETS if not asked.files or file.startswith(tuple(asked.files))]
    chosen = [mutant for file in files for mutant in mutants(file)]
    if asked.sample is not None:
        print(f"seed {asked.seed}", flush=True)
        chosen = Random(asked.seed).sample(chosen, min(asked.sample, len(chosen)))
    survived = list[str]()
    with copies(asked.jobs) as places:
        for number, one in enumerate(places.outcomes(chosen), 1):
            if sys.stderr.isatty():
                print(f"\r{number} of {len(chosen)}", end="", file=sys.stderr)
            if not one.caught_by:
                survived.append(one.bug.name)
                print(f"{one.bug.name}: {EXPLAINED.get(one.bug.name, one.said or 'survived')}", flush=True)
    print(f"{len(chosen)} mutants, {len(survived)} survived")
    return int(any(name not in EXPLAINED for name in survived))


if __name__ == "__main__":
    sys.exit(main())

"""What is compared: a measured column, or the largest of several, with the truth's uncertainty of it."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from reports.results import Run


@dataclass(frozen=True)
class Quantity:
    """The largest of some columns of a row; ``name`` is a column's name, real or as if."""

    name: str
    columns: tuple[str, ...]

    def value(self, run: Run) -> float | None:
        """Return the quantity of a finished run, None if the run failed or the scene has no such thing."""
        return self._largest(run, self.columns) if run.ok else None

    def uncertainty(self, run: Run) -> float | None:
        """Return the truth's uncertainty of the quantity, None if there is none."""
        return self._largest(
            run, [c.replace("_error_", "_uncertainty_") for c in self.columns if _is_error(c)]
        )

    def of_scene(self, runs: Iterable[Run], scene: str) -> bool:
        """Return whether any run of the scene has the quantity."""
        return any(run.scene == scene and self.value(run) is not None for run in runs)

    def floor(self, runs: Iterable[Run], scene: str) -> float:
        """Return the truth's uncertainty on a scene, 0 where there is none."""
        found = [self.uncertainty(run) for run in runs if run.scene == scene]
        return max((u for u in found if u is not None), default=0.0)

    @staticmethod
    def _largest(run: Run, columns: Iterable[str]) -> float | None:
        found = [run.values[column] for column in columns if column in run.values]
        return max(found) if found else None


def _is_error(column: str) -> bool:
    return "_error_" in column


def column(name: str) -> Quantity:
    """Return the quantity that is one column."""
    return Quantity(name, (name,))


def signal_errors(runs: Iterable[Run]) -> list[Quantity]:
    """Return the errors of all compared signals, in the order in which the rows have them."""
    names = [name for run in runs for name in run.values if _is_error(name)]
    return [column(name) for name in dict.fromkeys(names)]


def largest_joint_force_error(runs: Iterable[Run]) -> Quantity:
    """Return the largest force error of all joints."""
    return largest("largest_joint_force_error_N", runs, r"joint_\w_force_error_N")


def largest(name: str, runs: Iterable[Run], pattern: str) -> Quantity:
    """Return the largest of the signal errors whose columns match a pattern."""
    return Quantity(name, tuple(q.name for q in signal_errors(runs) if re.fullmatch(pattern, q.name)))

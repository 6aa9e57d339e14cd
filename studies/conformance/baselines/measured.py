"""A subject's numbers: those of its rows as the study writes them, and the orders between its two steps."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from engine_models.engine import RunSettings
from reports.analysis.convergence import observed_order
from studies.conformance.baselines.subjects import Subject
from studies.judges.converged_truth import INDEPENDENT, REFERENCE
from studies.judges.metrics import UNITS
from studies.running.case import Case, Row, Value
from studies.running.outcome import run_case

#: What a number is held against: nothing, a balance that an exact run closes, or a truth.
ITSELF, PHYSICS = "none, a count or a size of the run", "physics: a balance that an exact run closes"
TRUTHS = {
    INDEPENDENT: "minimal coordinates by collocation",
    REFERENCE: "the reference by DOP853",
}
#: What the columns have in their names that are held against a truth, and those against physics.
OF_TRUTH = ("_error", "_uncertainty_", "_model_difference_", "cross_check", "impacts_")
OF_PHYSICS = ("residual", "unaccounted", "gap_part", "constraint", "hidden_power", "gain")
#: What the columns have in their names that tell of a scene alone, the same for every arm.
UNHELD = ("_scale_", "smallest_clearance")
#: The study of smooth motion, at two steps: past impacts errors do not fall by the order of a method.
OF_ORDERS = "agreement"
#: An error is a point of an order while it is so many times the truth's uncertainty, of three distances.
ABOVE_UNCERTAINTY = 30.0


class Key(NamedTuple):
    """What a number is called in the tables; its ``resolution`` is a step or a tolerance."""

    study: str
    scene: str
    arm: str
    resolution: str
    quantity: str


@dataclass(frozen=True)
class Number:
    """A measured number in its ``unit``, and what it was held against; a ``count`` is whole.

    ``known_to`` is the uncertainty of the truth in the same unit, 0 where none was asked.
    """

    value: float
    unit: str
    truth: str
    count: bool = False
    known_to: float = 0.0


class NotMeasured(Exception):
    """A run that has a baseline came to no end; the message says which and why."""


def measured(subject: Subject) -> dict[Key, Number]:
    """Run a subject's cases and return all their numbers.

    Raises:
        NotMeasured: a run failed or was refused.
    """
    rows = {resolution(case): _row(case) for case in subject.cases}
    out = {}
    for at, row in rows.items():
        for name, value in row.items():
            if any(part in name for part in UNHELD):
                continue
            if isinstance(value, int | float) and not isinstance(value, bool):
                out[Key(*subject.key, at, name)] = _number(name, value, row)
    if subject.key[0] == OF_ORDERS:
        coarse, fine = rows.values()
        for name, order in orders([coarse, _row(_between(*subject.cases)), fine]).items():
            out[Key(*subject.key, "both steps", name)] = Number(order, "1", TRUTHS[INDEPENDENT])
    return out


def resolution(case: Case) -> str:
    """Return what varies on the ladder of a case: its tolerance if it has one, or else the step taken."""
    for name in case.arm.tolerances:
        return f"tolerance {case.settings[name]}"
    step_s = RunSettings(case.run.step_s, case.run.samples).step_used_s(case.scene.end_time_s)
    return f"step {step_s:.4g} s"


def orders(rows: Sequence[Row]) -> dict[str, float]:
    """Return the order of each error from the first of three or more rows, coarse to fine, to the last.

    It is none unless the rows between show the same order (see ``observed_order``) and the finest error is
    well above the truth's uncertainty.
    """
    steps = [1 / _float(row["steps"]) for row in rows]
    out = {}
    for name in (name for name in rows[0] if "_error_" in name):
        errors = [_float(row.get(name)) for row in rows]
        known_to = _float(rows[-1].get(name.replace("_error_", "_uncertainty_")))
        claimed = errors[-1] > ABOVE_UNCERTAINTY * known_to and observed_order(steps, errors, known_to).slope
        if claimed:
            order = math.log(errors[0] / errors[-1]) / math.log(steps[0] / steps[-1])
            out[name.partition("_error_")[0] + "_order"] = order
    return out


def _between(coarse: Case, fine: Case) -> Case:
    """Return the case with the mean number of steps of two, which shows where an error stops falling."""
    step_s = 2 / (1 / coarse.run.step_s + 1 / fine.run.step_s)
    return replace(coarse, run=replace(coarse.run, step_s=step_s))


def _row(case: Case) -> Row:
    """Return what a study measures in a case, without what only says which case that is."""
    row, _ = run_case(case)
    if row["status"] != "ok":
        where = f"{case.arm.label} on {case.scene.name} ({case.study}, {resolution(case)})"
        raise NotMeasured(f"{where}: expected a finished run, got '{row['status']}: {row['reason']}'")
    return {name: value for name, value in row.items() if name not in case.head()} | {"study": case.study}


def _number(name: str, value: float, row: Row) -> Number:
    unit = next((unit for unit in (*UNITS, "W") if name.endswith(f"_{unit}")), "1")
    known_to = _float(row.get(name.replace("_error_", "_uncertainty_"))) if "_error_" in name else 0.0
    return Number(value, unit, _truth(name, row), isinstance(value, int), known_to)


def _truth(name: str, row: Row) -> str:
    if any(word in name for word in OF_TRUTH):
        return TRUTHS[str(row.get("truth", INDEPENDENT))]
    return PHYSICS if any(word in name for word in OF_PHYSICS) else ITSELF


def _float(value: Value) -> float:
    """Return a number of a row, 0 where it has none."""
    return float(value) if isinstance(value, int | float) else 0.0

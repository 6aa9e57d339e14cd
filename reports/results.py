"""Rows of studies as data frames: those of a results folder (see ``studies.store``), and published ones.

What is published (see ``reports.publication``) is a compressed CSV file a study, and one file of where they
come from; it has no curves.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from engine_models.scene.plain_words import BadInput
from reports.style import in_legend_order, legend_place
from studies.store import FILE, Store

FloatArray = NDArray[np.float64]

#: How the file of a study's published rows ends, and the one that says where all come from.
ENDING, FACTS = ".csv.xz", "facts.json"


class NoResults(BadInput):
    """There is nothing to report; the message says what was missing where, and what to run."""


@dataclass(frozen=True)
class Results:
    """The rows of one study as ``frame`` has them, a row per run, and ``facts`` of where they come from.

    Without a ``store``, as of published rows, there are no curves.
    """

    rows: pd.DataFrame
    facts: Mapping[str, Any] = field(default_factory=dict)
    store: Store | None = None

    @property
    def has_curves(self) -> bool:
        """Whether the study's curves are there."""
        return self.store is not None

    def curve(self, case: str, column: str) -> FloatArray:
        """Return a curve of a finished run, (n,).

        Raises:
            BadInput: there is none.
        """
        curves = {} if self.store is None else self.store.curves(case)
        if column not in curves:
            raise BadInput(
                f"results: expected the curve {column} of case {case}, got {', '.join(curves) or 'none'}"
            )
        return np.asarray(curves[column], dtype=float)

    @property
    def note(self) -> str | None:
        """A line that says that the run has not come to its end, None if it has."""
        there, asked = len(self.rows), self.facts.get("cases", 0)
        what = f"{there} of {asked} cases are there; `crankslider run` goes on"
        return what if there < asked else None


def read_study(folder: Path, study: str) -> Results:
    """Read the rows of a study in a folder of results, or of published ones.

    Raises:
        NoResults: there are none.
        BadInput: a file there is none of ours, or damaged.
    """
    rows, facts, store = list[dict[str, Any]](), dict[str, Any](), None
    if (folder / FILE).exists():
        store = Store(folder)
        rows, facts = store.results(study)
    elif (folder / f"{study}{ENDING}").exists():
        rows, facts = published_rows(folder, study), _facts(folder)[study]
    if not rows:
        raise NoResults(f"no results of {study} in {folder}; run `crankslider run`")
    return Results(frame(rows), facts, store)


def published_rows(folder: Path, study: str) -> list[dict[str, Any]]:
    """Return the published rows of a study, each with what it has.

    Raises:
        BadInput: they are no rows.
    """
    path = folder / f"{study}{ENDING}"
    try:
        table = pd.read_csv(path, low_memory=False, keep_default_na=False, na_values=[""])
        rows = [row.dropna().to_dict() for _, row in table.astype(object).iterrows()]
        return [{"case": f"{study}-{n}", "study": study, "reason": "", **row} for n, row in enumerate(rows)]
    except Exception as error:  # whatever a damaged file makes of its reader
        raise BadInput(f"results: expected published rows in {path}, got '{error}'") from None


@cache
def _facts(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / FACTS).read_text(encoding="utf-8"))
    return found


def head_of(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that say what was run, whatever code and machine ran it."""
    told = dict(takewhile(lambda item: item[0] != "status", row.items()))
    return {name: value for name, value in told.items() if name not in ("case", "study")}


def frame(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return rows as a data frame, in an order that does not depend on when which case finished.

    They go by scene, by label in the order of legends, which is also that of the categories of ``label``, and
    from long steps to short ones. Numbers are float64, NaN where a row has none or one that is not finite;
    settings, text and flags are objects as they were written. Without a mean step of its own a run has its
    step in ``mean_step_s``.
    """
    table = pd.DataFrame(sorted(rows, key=_place), dtype=object)
    measured = {
        name: pd.to_numeric(table[name], errors="coerce").astype(float).replace([np.inf, -np.inf], np.nan)
        for name in table
        if not name.startswith("setting_") and table[name].map(_may_be_number).all()
    }
    measured["mean_step_s"] = measured.get("mean_step_s", measured["step_s"]).fillna(measured["step_s"])
    columns = {**dict(table.items()), **measured, "label": in_legend_order(table)}
    return pd.DataFrame(columns)  # in one piece, which is quicker to select from


def with_columns(rows: pd.DataFrame, *names: str) -> pd.DataFrame:
    """Return the rows with these columns, NaN throughout where no row has one."""
    return rows.reindex(columns=[*rows, *(name for name in names if name not in rows)])


def _place(row: Mapping[str, Any]) -> tuple[Any, ...]:
    place = row["scene"], legend_place(row["engine"], row["arm"]), -row["step_s"]
    return *place, json.dumps(head_of(row), sort_keys=True)


def _may_be_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))

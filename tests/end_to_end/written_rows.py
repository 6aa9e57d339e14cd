"""Rows of results as a study would write them, with round numbers, and what holds of every chapter."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from reports.results import Results, read_study
from tests.helpers.row_files import write_rows


def row(number: int, scene: str, engine: str, arm: str, step_s: float, **columns: Any) -> dict[str, Any]:
    """Return the row of a finished run, or of one that ended as ``status`` and ``reason`` say."""
    head = {
        "case": f"{number:016d}",
        "scene": scene,
        "engine": engine,
        "arm": arm,
        "label": f"{engine} ({arm})",
        "step_s": step_s,
        "status": "ok",
        "reason": "",
    }
    return {**head, **columns}


def results_of(
    folder: Path, rows: Sequence[Mapping[str, Any]], curves: Mapping[str, Mapping[str, Sequence[float]]]
) -> Results:
    """Write a study's files, ``curves`` by case and column, and read them as the report does."""
    write_rows(folder, "written", rows, curves)
    return read_study(folder, "written")

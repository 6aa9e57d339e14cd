"""Rows of results as a study would write them, with round numbers, and what holds of every chapter."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from reports.parts import Figure
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


def mixed(figures: Iterable[Figure | None]) -> list[str]:
    """Return the names of figures whose panels have several labels upwards."""
    labels = [
        (figure.name, {ax.get_ylabel() for ax in figure.drawing.axes} - {""}) for figure in figures if figure
    ]
    assert labels
    return [name for name, of in labels if len(of) > 1]

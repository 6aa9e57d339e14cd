"""Rows as studies would have written them, made up by tests, and in a store."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studies.running.store import Store


def row(number: int, scene: str, engine: str, arm: str, step_s: float, **columns: Any) -> dict[str, Any]:
    """Return the row of a finished run, or of one that ended as ``status`` and ``reason`` say."""
    head = {
        "case": f"{number:016d}",
        "scene": scene,
        "engine": engine,
        "arm": arm,
        "label": f"{engine} ({arm})",
        "samples": 4,
        "step_s": step_s,
        "status": "ok",
        "reason": "",
    }
    return {**head, **columns}


def write_rows(
    folder: Path,
    study: str,
    rows: Sequence[Mapping[str, Any]],
    curves: Mapping[str, Mapping[str, Sequence[float]]] | None = None,
    **facts: object,
) -> None:
    """Write rows of a study, each with a ``case`` and an ``engine``, and ``curves`` by case and column."""
    with Store(folder) as store:
        store.describe(study, {"set": "quick", "engines": {row["engine"]: "code" for row in rows}, **facts})
        for row in rows:
            own = {name: np.array(curve) for name, curve in (curves or {}).get(row["case"], {}).items()}
            told = {"study": study, **{name: value for name, value in row.items() if name != "case"}}
            store.keep(row["case"], "code", told, own)

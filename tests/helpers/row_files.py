"""Rows in a store, for tests that make up what studies would have written."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studies.store import Store


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

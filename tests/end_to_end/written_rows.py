"""Rows of results as a study would write them."""

from typing import Any


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

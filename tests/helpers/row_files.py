"""Files of rows as runs write them: for tests that look into them or change them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.running.finished_cases import checksum


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def write_rows(path: Path, rows: Sequence[Mapping[str, object]]) -> None:
    """Write rows, each with the checksum that it has now."""
    lines = [json.dumps({**row, "checksum": checksum(row)}) + "\n" for row in rows]
    path.write_text("".join(lines), encoding="utf-8")

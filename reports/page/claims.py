"""The findings as data: every sentence of the report with its numbers, for two reports to be compared."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from reports.parts import Finding, Number, Studies, quantity

#: The file of a report with its claims.
FINDINGS = "findings.json"


def write_claims(findings: Mapping[str, Iterable[Finding]], studies: Studies, folder: Path) -> None:
    """Write the findings of every chapter, by its name, and of which set and commit each study's rows are."""
    origins = {
        name: {key: results.facts.get(key) for key in ("set", "commit")} | {"runs": len(results.rows)}
        for name, results in studies.items()
    }
    claims = [
        {
            "id": f"{chapter}/{finding.name}",
            "text": str(finding),
            "numbers": [number._asdict() for number in finding.numbers],
        }
        for chapter, of_chapter in findings.items()
        for finding in of_chapter
    ]
    text = json.dumps({"studies": origins, "claims": claims}, ensure_ascii=False, indent=1)
    (folder / FINDINGS).write_text(text + "\n", encoding="utf-8")


def read_claims(report: Path) -> list[dict[str, Any]]:
    """Return the claims of a report.

    Raises:
        OSError: there is no report.
        ValueError: its findings are none.
    """
    try:
        return [
            {**claim, "numbers": [Number(**number) for number in claim["numbers"]]}
            for claim in json.loads((report / FINDINGS).read_text(encoding="utf-8"))["claims"]
        ]
    except (KeyError, TypeError) as error:
        raise ValueError(f"no findings of a report: {error!r}") from None


def compare_claims(before: Iterable[Mapping[str, Any]], after: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return the numbers of two reports' claims in columns ``before`` and ``after``, a row a number."""
    columns = {
        name: {
            f"{claim['id']} {k}": quantity(number.value, number.unit)
            for claim in claims
            for k, number in enumerate(claim["numbers"], 1)
        }
        for name, claims in (("before", before), ("after", after))
    }
    return pd.DataFrame(columns).fillna("–")

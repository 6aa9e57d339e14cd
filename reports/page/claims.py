"""The findings as data: every sentence of the report with its numbers, for two reports to be compared."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass

from reports.parts import Finding, Number, Studies


@dataclass(frozen=True)
class Claim:
    """A sentence of the report: ``id`` stays the same as long as it is about the same thing."""

    id: str
    text: str
    numbers: tuple[Number, ...]


def collect(findings: Mapping[str, Iterable[Finding]]) -> list[Claim]:
    """Return the findings of every chapter, by its name, as claims."""
    return [
        Claim(f"{chapter}/{finding.name}", str(finding), finding.numbers)
        for chapter, of_chapter in findings.items()
        for finding in of_chapter
    ]


def as_json(claims: Iterable[Claim], studies: Studies) -> str:
    """Return claims as a JSON object, with which set and commit each study's rows are of."""
    origins = {
        name: {key: (results.sidecar or {}).get(key) for key in ("set", "commit")}
        | {"runs": len(results.rows)}
        for name, results in studies.items()
    }
    told = [asdict(claim) | {"numbers": [of._asdict() for of in claim.numbers]} for claim in claims]
    return json.dumps({"studies": origins, "claims": told}, ensure_ascii=False, indent=1) + "\n"


def from_json(text: str) -> list[Claim]:
    """Return the claims of another report.

    Raises:
        ValueError: the text is no findings of a report.
    """
    try:
        claims = json.loads(text)["claims"]
        return [Claim(of["id"], of["text"], tuple(Number(**each) for each in of["numbers"])) for of in claims]
    except (KeyError, TypeError) as error:
        raise ValueError(f"no findings of a report: {error!r}") from None

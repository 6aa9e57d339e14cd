"""The findings as data: every sentence of the report with its numbers, for two reports to be compared."""

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass

from reports.chapters.answer import Answer
from reports.page.shown import ShownChapter
from reports.parts import Finding, Number
from reports.results import Results

#: Digits that are raised in a sentence, back to what they are.
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
#: A number in a sentence: digits, a power of ten, half an interval, a unit. Not those in names, as DOP853.
_NUMBER = re.compile(
    r"(?<![\w.-])(?P<sign>[+−-]?)(?P<digits>\d+(?:\.\d+)?(?:e[+-]\d+)?)(?:×10(?P<power>[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?"
    r"(?: ± (?P<half>\d+(?:\.\d+)?))?"
    r"(?: ?(?P<unit>%|rad|ms|mm|µm|nm|[mNJWs]\b|times|revolutions))?(?![\w.-]*\w)"
)


@dataclass(frozen=True)
class Claim:
    """A sentence of the report: ``id`` stays the same as long as it is about the same thing."""

    id: str
    text: str
    numbers: tuple[Number, ...]


def collected(said: Answer, chapters: Iterable[ShownChapter]) -> list[Claim]:
    """Return every sentence of the answer and of all chapters as a claim."""
    found = list(_claims("answer", (*said.text, *said.doubts)))
    for chapter in chapters:
        found += _claims(chapter.name, chapter.headline)
        for section in chapter.sections:
            found += _claims(f"{chapter.name}/{section.name}", section.text)
    return found


def _claims(place: str, sentences: Iterable[str]) -> Iterator[Claim]:
    """Yield the sentences of a place as claims; of those that differ by numbers alone each has its own id."""
    seen: Counter[str] = Counter()
    for text in sentences:
        known = text if isinstance(text, Finding) else Finding(text, _slug(text), numbers(text))
        name = known.name
        seen[name] += 1
        again = f"-{seen[name]}" if seen[name] > 1 else ""
        yield Claim(f"{place}/{name}{again}", str(text), known.numbers)


def numbers(text: str) -> Iterator[Number]:
    """Yield the numbers of a sentence in its order, each with its unit and the interval written with it."""
    for found in _NUMBER.finditer(text):
        sign = -1 if found["sign"] in ("−", "-") else 1
        value = sign * float(found["digits"]) * 10.0 ** int((found["power"] or "⁰").translate(_LOWERED))
        half = float(found["half"]) if found["half"] else None
        ends = (None, None) if half is None else (value - half, value + half)
        yield Number(value, found["unit"] or "", *ends)


def _slug(text: str) -> str:
    """Return a sentence as a name, without its numbers."""
    return "-".join(re.findall(r"\w+", _NUMBER.sub("", text).lower()))[:120]


def as_json(found: Iterable[Claim], studies: Mapping[str, Results]) -> str:
    """Return claims as a JSON object, with which set and commit each study's rows are of."""
    origins = {
        name: {key: (results.sidecar or {}).get(key) for key in ("set", "commit")}
        | {"runs": len(results.rows)}
        for name, results in studies.items()
    }
    claims = [asdict(claim) | {"numbers": [of._asdict() for of in claim.numbers]} for claim in found]
    return json.dumps({"studies": origins, "claims": claims}, ensure_ascii=False, indent=1) + "\n"


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

"""The pages that people read, and the blocks of code in them.

A block's first word is its language. ``file=NAME`` behind it has the block kept as a file, ``slow`` has it
checked but not run.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md")))
]
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))


@dataclass(frozen=True)
class Block:
    """A block of code: its language, the words behind it, its text, and the line that it begins on."""

    language: str
    words: tuple[str, ...]
    text: str
    line: int

    @property
    def file(self) -> str | None:
        """The name that the block is to be kept under."""
        return next((word.removeprefix("file=") for word in self.words if word.startswith("file=")), None)


def blocks(page: str) -> Iterator[Block]:
    """Yield the blocks of a page in their order; one that is indented has no language."""
    for token in MarkdownIt().parse((ROOT / page).read_text(encoding="utf-8")):
        if token.type in ("fence", "code_block"):
            language, *words = token.info.split() or [""]
            yield Block(language, tuple(words), token.content, (token.map or [0])[0] + 1)


def table(page: str, first: str) -> list[dict[str, str]]:
    """Return the rows of the tables of a page whose first column has this heading, by the headings."""
    rows: list[dict[str, str]] = []
    heading: list[str] = []
    for line in (ROOT / page).read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split(" | ")]
        if not line.startswith("|"):
            heading = []
        elif not heading:
            heading = cells
        elif heading[0] == first and not set(line) <= set("| -:"):
            rows.append(dict(zip(heading, cells, strict=True)))
    return rows

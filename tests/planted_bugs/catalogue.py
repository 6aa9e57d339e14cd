"""The bugs that are planted: each a change of one file, why somebody could make it, who could see it.

They stand in ``bugs/*.toml``, a file for each folder that they are planted in.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

ROOT = Path(__file__).parents[2]
FOLDER = Path(__file__).parent / "bugs"


class Inapplicable(Exception):
    """A change does not fit its file any more; the message says which and why."""


@dataclass(frozen=True)
class Bug:
    """A change of the ``file``, a path from the root: ``old`` text, which is there once, becomes ``new``.

    A published file is another after each run, so that there a ``pattern`` may say what is changed, where it
    matches first; its groups may be in ``new``. ``tests`` are the paths, or pytest's names, of those who
    could see it.
    """

    name: str
    file: str
    new: str
    why: str
    tests: tuple[str, ...]
    old: str = ""
    pattern: str = ""

    def planted(self, text: str) -> str:
        """Return the text of the file with the bug in it.

        Raises:
            Inapplicable: the old text is not there, or not once, or the change is none.
        """
        found = text.count(self.old) if self.old else len(re.findall(self.pattern, text)[:1])
        if found != 1:
            expected = self.old or self.pattern
            raise Inapplicable(f"{self.name}: expected once in {self.file}, got {found} times: {expected!r}")
        changed = (
            text.replace(self.old, self.new) if self.old else re.sub(self.pattern, self.new, text, count=1)
        )
        if changed == text:
            raise Inapplicable(f"{self.name}: expected a change of {self.file}, got none")
        return changed


def bugs() -> list[Bug]:
    """Return all bugs, by files and in their order there."""
    found: list[Bug] = []
    for path in sorted(FOLDER.glob("*.toml")):
        entries = tomllib.loads(path.read_text(encoding="utf-8"))["bug"]
        found += [Bug(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries]
    return found

"""In which line of a scene's TOML text a field stands."""

import re

#: A section's head, and a key before its value; a path of names with dots between them.
PATH = r"[\w\"'-]+(?:\s*\.\s*[\w\"'-]+)*"
HEAD, KEY = re.compile(rf"\s*\[\s*({PATH})\s*\]"), re.compile(rf"\s*({PATH})\s*=")


def line_of(text: str, field: str) -> int | None:
    """Return the number of the line, from 1, of a field such as ``rod.mass_kg``.

    Of one that is not there it is the line of what it would stand in, None if there is no such thing either.
    """
    lines, section = dict[str, int](), ""
    for number, line in enumerate(text.splitlines(), 1):
        if head := HEAD.match(line):
            section = _plain(head[1])
            lines.setdefault(section, number)
        elif key := KEY.match(line):
            lines.setdefault(f"{section}.{_plain(key[1])}".removeprefix("."), number)
    while field and field not in lines:
        field = field.rpartition(".")[0]
    return lines.get(field)


def _plain(path: str) -> str:
    """Return a path without quotes and blanks."""
    return re.sub(r"[\s\"']", "", path)

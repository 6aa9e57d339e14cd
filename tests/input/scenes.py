"""Sound scene files, which the table of bad input changes."""

from pathlib import Path

FOLDER = Path(__file__).parent / "bases"


def base(name: str) -> str:
    """Return the text of a scene file."""
    return (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def changed(text: str, *changes: tuple[str, str]) -> str:
    """Return a text with other pieces in it; where nothing is old, the new piece is a line at the end."""
    for old, new in changes:
        assert old in text, f"{old!r} is not there"
        text = text.replace(old, new, 1) if old else f"{text}{new}\n"
    return text

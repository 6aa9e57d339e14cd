"""A run as a notebook shows it: what ran, what there is to say of it, and its figure."""

from base64 import b64encode
from collections.abc import Iterable
from html import escape

from matplotlib.figure import Figure

from reports.run.picture import picture_bytes


def card(title: str, lines: Iterable[str], figure: Figure) -> str:
    """Return a piece of HTML that needs no other file."""
    text = "".join(f"<li>{escape(line)}</li>" for line in lines)
    image = b64encode(picture_bytes(figure, ".png")).decode("ascii")
    source = f'src="data:image/png;base64,{image}" alt="{escape(title)} over time"'
    return f'<b>{escape(title)}</b><ul>{text}</ul><img {source} style="max-width: 60em; width: 100%">'

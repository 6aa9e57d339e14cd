"""What a line or a patch on a figure belongs to, carried by its ``gid``: a page shows and hides it."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from matplotlib.artist import Artist
from matplotlib.figure import Figure as Drawing


@dataclass(frozen=True)
class Series:
    """An artist of the series ``label``, with a note for each of its points, such as its setting."""

    artist: Artist
    label: str
    notes: tuple[str, ...]


def mark(artists: Iterable[Artist], label: str, notes: Sequence[str] = ()) -> None:
    """Write on artists to which series they belong; ``notes`` (n,) are of their n points, in their order."""
    for artist in artists:
        artist.set_gid(json.dumps([label, *notes]))


def marked(drawing: Drawing) -> list[Series]:
    """Return the artists of a drawing that belong to series, in the order in which they lie on it."""
    found = []
    # To look at the axes' own parts as well would make ticks that nobody needs.
    for artist in (each for ax in drawing.axes for each in ax.get_children() if each.get_gid()):
        label, *notes = json.loads(str(artist.get_gid()))
        found.append(Series(artist, label, tuple(notes)))
    return found

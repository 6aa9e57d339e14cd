"""Basins of attraction: over two fields of the start, which motion each member ends in."""

import numpy as np
import pandas as pd
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.patches import Patch

from reports.plots.sweeps.motions import motions
from reports.plots.sweeps.two_fields import draw_places
from reports.run.picture import Picture
from reports.style import BLACK, BLUE, VERMILLION

#: Of the motions in which most members end, and of all others.
COLOURS, OTHERS = (BLUE, "#E69F00", "#009E73", VERMILLION, "#CC79A7", "#56B4E9", "#F0E442"), BLACK


def draw_basins(rows: pd.DataFrame, fields: tuple[str, str]) -> Picture:
    """Return the map of the motions in which members that did not fail end, most frequent first."""
    found = motions(rows[rows["status"] == "ok"])
    names = [*found.value_counts().index]
    shown, rest = names[: len(COLOURS)], names[len(COLOURS) :]
    numbers = found.map({name: min(k, len(COLOURS)) for k, name in enumerate(names)})
    colours = [*COLOURS[: len(shown)], *([OTHERS] if rest else [])]
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    picture, _ = draw_places(rows.assign(motion=numbers), fields, "motion", norm, ListedColormap(colours))
    words = [*shown, *([f"{len(rest)} other motions"] if rest else [])]
    counts = [int((numbers == k).sum()) for k in range(len(words))]
    handles = [
        Patch(color=colour, label=f"{word}: {count} member{'s' * (count != 1)}")
        for colour, word, count in zip(colours, words, counts, strict=True)
    ]
    picture.legend(handles=handles, loc="outside lower center", ncols=2)
    return picture

"""How a number is spread over the members of an ensemble, or over all their impacts or turns."""

import numpy as np
import pandas as pd

from reports.plots.sweeps.scales import scale_of
from reports.run.picture import Picture
from reports.style import BLUE

#: Bins of what goes round, which are of 10 degrees; of all else, fewest and most.
ROUND, FEWEST, MOST = 36, 5, 60


def draw_histogram(rows: pd.DataFrame, column: str) -> Picture:
    """Return the histogram of a column, per member where members have several numbers."""
    picture = Picture(3.0)
    ax = picture.add_subplot()
    values = rows[column].explode().dropna()
    scale = scale_of(column, values)
    numbers = scale.drawn(values)
    goes_round = column.endswith("phase_rad")
    bins = ROUND if goes_round else int(np.clip(np.sqrt(len(numbers)), FEWEST, MOST))
    weights = np.full(len(numbers), 1 / len(rows))
    span = (0.0, 360.0) if goes_round else None
    ax.hist(numbers, bins=bins, range=span, weights=weights, color=BLUE)
    if goes_round:
        ax.set_xticks(range(0, 361, 45))
    ax.set(xlabel=scale.label, ylabel="number in a bin, per member")
    return picture

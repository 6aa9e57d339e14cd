"""The path of a pin in its clearance circle."""

import matplotlib as mpl
import numpy as np
import pandas as pd

from reports.run.picture import Picture
from reports.style import BLUE, GREY, RC, VERMILLION

#: Points of the circle, and width and height of the figure in inches.
POINTS, SIZE_IN = 361, (5.2, 5.0)
UM_PER_M = 1e6


def orbit_plot(frame: pd.DataFrame, joint: str, radial_clearance_m: float, title: str) -> Picture:
    """Return the figure of a joint's gap, from the bearing's centre to the pin's, in a table of samples."""
    x, y = (UM_PER_M * frame[f"clearance_{joint}_{axis}_m"] for axis in "xy")
    touching = frame[f"contact_{joint}_penetration_m"] >= 0
    angle, radius = np.linspace(0, 2 * np.pi, POINTS), UM_PER_M * radial_clearance_m
    width, height = SIZE_IN
    with mpl.rc_context(RC):
        picture = Picture(height, width)
        ax = picture.add_subplot()
        ax.plot(radius * np.cos(angle), radius * np.sin(angle), color="black", label="clearance circle")
        ax.plot(x, y, color=GREY, linewidth=0.7, label="centre of the pin")
        ax.plot(x[touching], y[touching], ".", color=VERMILLION, markersize=3, label="in contact")
        ax.plot(x.iloc[0], y.iloc[0], "o", color=BLUE, label="start")
        ax.set(
            title=f"{title}: pin {joint} in its bearing",
            xlabel="x from the centre of the bearing [µm]",
            ylabel="y from the centre of the bearing [µm]",
            aspect="equal",
        )
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4)
    return picture

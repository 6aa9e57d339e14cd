"""Where the parts of a mechanism are drawn, from the samples of its run."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Mechanism:
    """What is drawn: the lengths of the links, no rod in a pendulum, and the radial clearances of joints."""

    crank_m: float
    rod_m: float | None
    radial_clearance_m: Mapping[str, float]

    @property
    def joints(self) -> str:
        """Names of the joints, a letter each."""
        return "O" if self.rod_m is None else "OAB"


@dataclass(frozen=True)
class Places:
    """Centres of the joints' bearings and pins, and where a pendulum's crank ends, in m, each (n, 2)."""

    bearing: Mapping[str, Points]
    pin: Mapping[str, Points]
    crank_end: Points


def places(frame: pd.DataFrame, mechanism: Mechanism, exaggeration: float) -> Places:
    """Return where everything is, with gaps ``exaggeration`` times as large.

    The crank keeps its angle and the slider its place. The rod goes from pin A to bearing B, and is as much
    longer or shorter as that takes.
    """
    angle = frame["crank_angle_rad"].to_numpy()
    crank = mechanism.crank_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    gap = {joint: exaggeration * _gap(frame, joint) for joint in mechanism.joints}
    ground = np.zeros_like(crank)
    end = gap["O"] + crank
    if mechanism.rod_m is None:
        return Places({"O": ground}, {"O": gap["O"]}, end)
    slider = np.stack([frame["slider_position_m"], ground[:, 1]], axis=-1)
    return Places(
        {"O": ground, "A": end, "B": slider - gap["B"]},
        {"O": gap["O"], "A": end + gap["A"], "B": slider},
        end,
    )


def _gap(frame: pd.DataFrame, joint: str) -> Points:
    """Return the gap of a joint, zero of one without clearance."""
    columns = [f"clearance_{joint}_{axis}_m" for axis in "xy"]
    return frame[columns].to_numpy() if columns[0] in frame else np.zeros((len(frame), 2))

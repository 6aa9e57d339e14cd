"""Engines compared on one scene of the user's: what the runs in a folder say of them."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pandas as pd

from crankslider.run import Run, write_file
from engine_models.scene.arguments import Place, check_arguments
from engine_models.scene.scene import Scene
from reports.comparison import write_comparison
from reports.results import Results
from reports.standings import Standings, sentences, standings_table
from studies.failures import writing


@dataclass(frozen=True, repr=False)
class Comparison:
    """A comparison of engines on a scene.

    ``results`` has the rows and their curves. ``run`` is the recommended run with more samples, None if there
    is no recommendation. ``given`` is the scene as it is typed in a command, ``folder`` has the kept rows.
    """

    scene: Scene
    results: Results
    given: str
    folder: Path
    run: Run | None = None

    @property
    def frame(self) -> pd.DataFrame:
        """The rows, one per recorded or timed run, with settings, errors, times and reasons."""
        return self.results.rows

    @cached_property
    def standings(self) -> Standings:
        """The result of every engine."""
        return Standings.of(self.frame)

    @property
    def recommendation(self) -> str:
        """The recommended engine and setting, its cost, and its limit, in sentences."""
        return "\n".join(sentences(self.standings, self.given))

    def table(self) -> pd.DataFrame:
        """Return a line for each engine, as on the page."""
        return standings_table(self.standings).cells()

    @check_arguments
    def save(self, folder: Place) -> None:
        """Write the page, ``index.html``, its figures and tables, and the rows, ``rows.csv``, to a folder."""
        pictures = {}
        if self.run is not None:
            pictures["What does the recommended run look like?"] = self.run.plot()
            for joint in self.scene.joints_with_clearance:
                pictures[f"Where is pin {joint} in its bearing?"] = self.run.plot_orbit(joint)
        with writing("folder", Path(folder)):
            write_comparison(Path(folder), self.results, pictures, self.scene.to_toml(), self.given)
        write_file("folder", Path(folder, "rows.csv"), self.frame.to_csv(index=False).encode())

    def __repr__(self) -> str:
        return self.recommendation

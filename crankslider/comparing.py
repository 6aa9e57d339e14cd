"""Engines compared on one scene of the user's: the runs that a folder lacks, and the recommendation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import pandas as pd

from crankslider.run import Run
from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.arguments import Place, check_arguments
from engine_models.scene.scene import Scene
from reports.comparison import write_comparison
from reports.results import Results, read_study
from reports.standings import Standings, sentences, standings_table
from studies.case import Case
from studies.compare import LIMIT_S, NAME, TRUTH_LIMIT_S, ask, cases
from studies.failures import BadInput, Failed, progress_console, writing
from studies.runner import run_cases
from studies.whole_file import require_folder, write_whole
from studies.workers import Ended, Pool

#: The output intervals of the run that is shown.
SHOWN_SAMPLES = 400


@dataclass(frozen=True, repr=False)
class Comparison:
    """A comparison of engines on a scene.

    ``results`` has the rows and their curves. ``run`` is the recommended run with more samples, None if there
    is no recommendation. ``given`` is the scene as it is typed in a command, ``folder`` has the kept rows.
    """

    scene: Scene
    results: Results
    run: Run | None
    given: str
    folder: Path

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
        place, pictures = Path(folder), {}
        if self.run is not None:
            pictures["What does the recommended run look like?"] = self.run.plot()
            for joint in self.scene.joints_with_clearance:
                pictures[f"Where is pin {joint} in its bearing?"] = self.run.plot_orbit(joint)
        with writing("folder", place):
            write_comparison(place, self.results, pictures, self.scene.to_toml(), self.given)
            write_whole(place / "rows.csv", self.frame.to_csv(index=False).encode("utf-8"))

    def __repr__(self) -> str:
        return self.recommendation


def compare_engines(
    scene: Scene,
    given: str,
    engines: Sequence[str],
    folder: Path,
    pool: Pool,
    error: float | None = None,
    signal: str | None = None,
) -> Comparison:
    """Run the cases of a comparison that a folder lacks and return it; see ``library.compare``."""
    with writing("out", folder):
        require_folder(folder)
    try:
        with progress_console().status(f"reference solution of {scene.name}"):
            question = pool.run(ask, scene, error, signal, limit_s=TRUTH_LIMIT_S)
    except UnsupportedScene as reason:
        expected = "a scene that has a reference solution"
        raise BadInput(f"scene: expected {expected}, got {scene.name}: {reason}") from None
    except (SimulationFailed, Ended) as reason:
        raise Failed(f"the reference solution of {scene.name} was not found: {reason}") from None
    wanted = {case.key: case for case in cases(scene, question, engines)}
    with writing("out", folder):
        run_cases({NAME: [*wanted.values()]}, folder, pool)
    results = read_study(folder, NAME)
    rows = results.rows[results.rows["case"].isin(wanted)].dropna(axis="columns", how="all")
    rows = rows.assign(label=rows["label"].cat.remove_unused_categories())
    comparison = Comparison(scene, replace(results, rows=rows), None, given, folder)
    standings = comparison.standings
    if not (standings.recorded["status"] == "ok").any():
        reasons = " ".join(standings.not_run)
        if (standings.recorded["status"] == "unsupported").all():
            raise BadInput(f"engine: expected one that can run this scene, got: {reasons}")
        raise Failed(f"no engine finished a run of this scene: {reasons}")
    if (chosen := standings.chosen) is None:
        return comparison
    return replace(comparison, run=_shown(wanted[str(standings.recorded["case"][chosen.Index])], pool))


def _shown(case: Case, pool: Pool) -> Run | None:
    """Return the run of a case with more samples, None if that fails."""
    settings = RunSettings(case.run.step_used_s(case.scene.end_time_s), SHOWN_SAMPLES)
    engine = make_engine(case.engine, **case.settings)
    try:
        trajectory = pool.run(type(engine).simulate, engine, case.scene, settings, limit_s=LIMIT_S)
    except (UnsupportedScene, SimulationFailed, Ended):
        return None
    return Run(case.scene, case.engine, engine, trajectory)

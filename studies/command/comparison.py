"""A user's scene on every engine: the recommendation, and the page with its reasons."""

import os
import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.arguments import Place, check_arguments
from engine_models.scene.parts import AnyScene
from reports.comparison.page import page
from reports.comparison.sentences import not_run, sentences
from reports.comparison.standing import Standings, standings_table
from reports.results import Results, read_study
from studies.case import Case, provenance
from studies.command.finished_run import Run
from studies.comparison.question import Question, asked
from studies.comparison.study import LIMIT_S, NAME, TRUTH_LIMIT_S, cases
from studies.failures import BadInput, Failed, progress_console, writing
from studies.runner import run_cases
from studies.store import Store
from studies.whole_file import write_whole
from studies.workers import Ended, Pool

if TYPE_CHECKING:
    import pandas as pd

#: The output intervals of the run that is shown.
SHOWN_SAMPLES = 400


@dataclass(frozen=True)
class Comparison:
    """A comparison of engines on a scene.

    ``results`` has the rows and their curves. ``run`` is the recommended run with more samples, None if there
    is no recommendation. ``given`` is the scene as it is typed in a command.
    """

    scene: AnyScene
    results: Results
    run: Run | None
    given: str

    @property
    def frame(self) -> "pd.DataFrame":
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

    def table(self) -> Any:
        """Return a table with a line for each engine, for ``rich``."""
        from rich import box
        from rich.markup import escape
        from rich.table import Table

        content = standings_table(self.standings)
        cells = content.cells()
        table = Table(*map(escape, cells), title=content.title, caption=content.caption, box=box.SIMPLE)
        for row in cells.itertuples(index=False):
            table.add_row(*map(escape, row))
        return table

    @check_arguments
    def save(self, folder: Place) -> None:
        """Write the page, ``index.html``, and the rows, ``rows.csv``, to a folder.

        Raises:
            BadInput: the folder cannot be written.
        """
        place = Path(folder)
        pictures = {}
        if self.run is not None:
            pictures["What does the recommended run look like?"] = self.run.plot()
            for joint in self.scene.joints_with_clearance:
                pictures[f"Where is pin {joint} in its bearing?"] = self.run.plot_orbit(joint)
        text = page(self.results, pictures, self.scene.to_toml(), self.given)
        with writing("folder", place):
            place.mkdir(parents=True, exist_ok=True)
            write_whole(place / "index.html", text.encode("utf-8"))
            write_whole(place / "rows.csv", self.frame.to_csv(index=False).encode("utf-8"))

    def __repr__(self) -> str:
        return self.recommendation


def default_folder(scene: AnyScene) -> Path:
    """Return the default folder of a scene's comparison."""
    return Path("comparison", re.sub(r"[^\w.-]+|^\.+", "-", scene.name))


def comparison(scene: AnyScene, given: str, engines: Collection[str], folder: Path) -> Comparison:
    """Run the cases of a comparison that ``folder`` lacks, on the named engines or on all, and return it.

    ``given`` is the scene as it is typed in a command.

    Raises:
        BadInput: the scene has no reference solution, or no engine can run it.
        Failed: the reference solution was not found, or no engine finished.
    """
    with Pool(os.cpu_count() or 1) as pool, Store(folder) as store, store.held():
        found = {case.key: case for case in cases(scene, _question(scene, pool), engines)}
        store.describe(NAME, provenance(False, found.values()))
        run_cases({NAME: list(found.values())}, store, pool)
        results = _of(read_study(folder, NAME), found)
        standings = Standings.of(results.rows)
        _require_a_run(standings)
        chosen = standings.chosen
        run = _shown(found[str(standings.rows["case"][chosen.row])], pool) if chosen else None
    return Comparison(scene, results, run, given)


def _question(scene: AnyScene, pool: Pool) -> Question:
    try:
        with progress_console().status(f"reference solution of {scene.name}"):
            return pool.run(asked, scene, limit_s=TRUTH_LIMIT_S)
    except UnsupportedScene as reason:
        expected = "a scene that has a reference solution"
        raise BadInput(f"SCENE: expected {expected}, got {scene.name}: {reason}") from None
    except (SimulationFailed, Ended) as reason:
        raise Failed(f"the reference solution of {scene.name} was not found: {reason}") from None


def _of(results: Results, found: Collection[str]) -> Results:
    """Return the results of these cases; the folder may have others."""
    rows = results.rows[results.rows["case"].isin(found)].dropna(axis="columns", how="all")
    return replace(results, rows=rows.assign(label=rows["label"].cat.remove_unused_categories()))


def _require_a_run(standings: Standings) -> None:
    recorded = standings.recorded
    if (recorded["status"] == "ok").any():
        return
    reasons = " ".join(not_run(standings))
    if (recorded["status"] == "unsupported").all():
        raise BadInput(f"--engine: expected one that can run this scene, got: {reasons}")
    raise Failed(f"no engine finished a run of this scene: {reasons}")


def _shown(case: Case, pool: Pool) -> Run | None:
    """Return the run of a case with more samples, None if that fails."""
    step_s = case.run.step_used_s(case.scene.end_time_s)
    run = RunSettings(step_s, SHOWN_SAMPLES)
    engine = make_engine(case.engine, **case.settings)
    try:
        trajectory = pool.run(_simulated, engine, case.scene, run, limit_s=LIMIT_S)
    except (UnsupportedScene, SimulationFailed, Ended):
        return None
    return Run(case.scene, case.engine, engine, None, trajectory, ())


def _simulated(engine: Engine, scene: AnyScene, run: RunSettings) -> Trajectory:
    return engine.simulate(scene, run)

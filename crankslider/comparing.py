"""Engines compared on one scene of the user's: the runs that a folder lacks, and the recommendation."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from crankslider.run import Comparison, Run
from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene
from reports.results import Results, read_study
from reports.standings import Standings
from studies.case import Case, provenance
from studies.compare import LIMIT_S, NAME, TRUTH_LIMIT_S, Question, ask, cases
from studies.failures import BadInput, Failed, progress_console, writing
from studies.runner import run_cases
from studies.store import Store
from studies.whole_file import require_folder
from studies.workers import Ended, Pool

#: The output intervals of the run that is shown.
SHOWN_SAMPLES = 400


def compare_engines(
    scene: Scene,
    given: str,
    engines: Collection[str],
    folder: Path,
    pool: Pool,
    error: float | None = None,
    signal: str | None = None,
) -> Comparison:
    """Run the cases of a comparison that ``folder`` lacks, on the named engines or on all, and return it.

    ``given`` is the scene as it is typed in a command; for ``error`` and ``signal`` see ``library.compare``.

    Raises:
        BadInput: the scene has no reference solution or no such signal, or no engine can run it.
        Failed: the reference solution was not found, or no engine finished.
    """
    with writing("out", folder):
        require_folder(folder)
    with Store(folder) as store, store.held():
        wanted = {case.key: case for case in cases(scene, _question(scene, error, signal, pool), engines)}
        store.describe(NAME, provenance(False, wanted.values()))
        run_cases({NAME: [*wanted.values()]}, store, pool)
        results = _of(read_study(folder, NAME), wanted)
        standings = Standings.of(results.rows)
        _require_a_run(standings)
        chosen = standings.chosen
        run = _shown(wanted[str(standings.recorded["case"][chosen.Index])], pool) if chosen else None
    return Comparison(scene, results, run, given)


def _question(scene: Scene, error: float | None, signal: str | None, pool: Pool) -> Question:
    try:
        with progress_console().status(f"reference solution of {scene.name}"):
            return pool.run(ask, scene, error, signal, limit_s=TRUTH_LIMIT_S)
    except UnsupportedScene as reason:
        expected = "a scene that has a reference solution"
        raise BadInput(f"scene: expected {expected}, got {scene.name}: {reason}") from None
    except (SimulationFailed, Ended) as reason:
        raise Failed(f"the reference solution of {scene.name} was not found: {reason}") from None


def _of(results: Results, wanted: Collection[str]) -> Results:
    """Return the results of these cases; the folder may have others."""
    rows = results.rows[results.rows["case"].isin(wanted)].dropna(axis="columns", how="all")
    return replace(results, rows=rows.assign(label=rows["label"].cat.remove_unused_categories()))


def _require_a_run(standings: Standings) -> None:
    recorded = standings.recorded
    if (recorded["status"] == "ok").any():
        return
    reasons = " ".join(standings.not_run)
    if (recorded["status"] == "unsupported").all():
        raise BadInput(f"engine: expected one that can run this scene, got: {reasons}")
    raise Failed(f"no engine finished a run of this scene: {reasons}")


def _shown(case: Case, pool: Pool) -> Run | None:
    """Return the run of a case with more samples, None if that fails."""
    settings = RunSettings(case.run.step_used_s(case.scene.end_time_s), SHOWN_SAMPLES)
    engine = make_engine(case.engine, **case.settings)
    try:
        trajectory = pool.run(type(engine).simulate, engine, case.scene, settings, limit_s=LIMIT_S)
    except (UnsupportedScene, SimulationFailed, Ended):
        return None
    return Run(case.scene, case.engine, engine, trajectory)

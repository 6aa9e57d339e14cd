"""The command ``crankslider``: exit code 0, 2 for bad input, 1 for work that failed, 130 on Ctrl-C."""

import logging
import os
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

from typer import Argument, Option, Typer

from studies import failures

app = Typer(
    add_completion=False,
    rich_markup_mode=None,
    help="Crank-slider simulations with the reference solver, Exudyn and Pymunk, and the study of them.",
)

#: What is checked as text, and not by Typer, so that it is refused in our own words.
Text = str | None
SceneName = Annotated[str, Argument(metavar="SCENE", help="A library scene or a TOML file.")]


@app.command()
def scenes() -> None:
    """List the library's scenes."""
    from studies.command.listings import scene_listing

    print(scene_listing())


@app.command()
def engines() -> None:
    """List the engines, their settings and the library scenes that each can run."""
    from studies.command.listings import engine_listing

    print(engine_listing())


@app.command()
def show(scene: SceneName) -> None:
    """Print a scene as TOML, the start of a file of your own."""
    from engine_models.scene.file import to_toml
    from studies.command.options import read_scene

    print(to_toml(read_scene(scene)), end="")


@app.command()
def simulate(
    scene: SceneName,
    engine: Annotated[str, Option(metavar="NAME", help="reference, exudyn, pymunk or scipy.")] = "reference",
    assignments: Annotated[
        list[str] | None,
        Option("--set", metavar="KEY=VALUE", help="A setting of the engine; see 'crankslider engines'."),
    ] = None,
    step: Annotated[Text, Option(metavar="H", help="Longest time step in s; 1e-5, none for dop853.")] = None,
    tolerance: Annotated[
        Text, Option(metavar="TOL", help="Sharpen the run until the slider is known to TOL in m.")
    ] = None,
    end: Annotated[Text, Option(metavar="T", help="End time in s, in place of the scene's.")] = None,
    samples: Annotated[str, Option(metavar="N", help="Output intervals of equal length.")] = "200",
    out: Annotated[Path | None, Option(metavar="FILE.csv", help="Output file; stdout.")] = None,
) -> None:
    """Run one scene and write motion, forces and energy as CSV."""
    import numpy as np

    from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
    from engine_models.memory import TooLarge
    from engine_models.reference.kernels import FolderRefused
    from engine_models.step_halving import simulate_to_tolerance
    from studies.command import options
    from studies.command.doubts import doubts
    from studies.command.progress_display import shown_progress
    from studies.command.trajectory_table import table
    from studies.running.whole_file import whole_file

    strings = {"step": step, "tolerance": tolerance, "end": end, "samples": samples}
    numbers = options.checked(options.SimulateOptions, "--", strings)
    physics = options.read_scene(scene, numbers.end)
    if out is not None and options.is_source(out, scene):
        raise failures.BadInput(f"--out: expected another file than the scene or its tables, got {out}")
    chosen = options.read_engine(engine, assignments or [], to_tolerance=numbers.tolerance is not None)
    longest_step = options.longest_step_s(numbers, physics.end_time_s, chosen)
    output = nullcontext(sys.stdout) if out is None else whole_file(out)
    with failures.writing("--out", out or Path("stdout")), output as file:
        try:
            # Engines look for non-finite numbers themselves.
            with np.errstate(all="ignore"), shown_progress(physics.end_time_s):
                if numbers.tolerance is not None:
                    result = simulate_to_tolerance(chosen, physics, numbers.tolerance, numbers.samples)
                else:
                    result = chosen.simulate(physics, RunSettings(longest_step, numbers.samples))
                warnings = doubts(chosen, physics, result, numbers.tolerance is not None)
        except TooLarge as reason:
            raise failures.BadInput(f"--{reason}") from None
        except UnsupportedScene as reason:
            raise failures.BadInput(
                f"--engine: expected one that can run this scene, got '{reason}'"
            ) from None
        except FolderRefused as reason:
            raise failures.BadInput(str(reason)) from None
        except SimulationFailed as reason:
            raise failures.Failed(str(reason)) from None
        table(physics, result).to_csv(file, index=False, lineterminator="\n")
    for warning in warnings:
        failures.say(f"warning: {warning}")
    of_method = f" of {chosen.method}" if hasattr(chosen, "method") else ""
    failures.say(f"note: {result.steps} steps{of_method}, the longest {result.step_s:.6g} s")


@app.command()
def run(
    studies: Annotated[list[str] | None, Argument(metavar="[STUDY]...", help="Studies to run; all.")] = None,
    full: Annotated[bool, Option("--full", help="The full set of cases, not the quick one.")] = False,
    jobs: Annotated[Text, Option(metavar="N", help="Cases run at once; one for each core.")] = None,
    out: Annotated[Path, Option(metavar="DIR", help="Where results are kept.")] = Path("results"),
    scheduler: Annotated[
        Text,
        Option(metavar="ADDRESS", help="A Dask scheduler to run cases; timed or limited ones run here."),
    ] = None,
    retry_failed: Annotated[
        bool, Option("--retry-failed", help="Also run again what neither finished nor was refused.")
    ] = False,
) -> None:
    """Run studies; finished cases are kept and skipped the next time."""
    from engine_models.reference.kernels import FolderRefused, writable_folder
    from engine_models.scene.plain_words import one_of, shown
    from studies.command.options import RunOptions, checked
    from studies.running.cluster import cluster
    from studies.running.finished_cases import DamagedRows
    from studies.running.folder_lock import FolderHeld
    from studies.running.registry import STUDIES
    from studies.running.runner import run_studies

    for name in studies or []:
        if name not in STUDIES:
            raise failures.BadInput(f"STUDY: expected {one_of(list(STUDIES))}, got {shown(name)}")
    options = checked(RunOptions, "--", {"jobs": str(os.cpu_count() or 1) if jobs is None else jobs})
    names = list(dict.fromkeys(studies or STUDIES))
    try:
        executors = nullcontext() if scheduler is None else cluster(scheduler)
        with (
            writable_folder(),
            executors as executor,
            failures.writing("--out", out),
            failures.terminated_as_interrupted(),
        ):
            run_studies(names, full, options.jobs, out, executor, retry_failed)
    except FolderRefused as reason:
        raise failures.BadInput(str(reason)) from None
    except (FolderHeld, DamagedRows) as reason:
        raise failures.BadInput(f"--out: expected {reason}") from None
    failures.say(f"note: the results are in {out}")


@app.command()
def report(
    results: Annotated[Path, Option(metavar="DIR", help="Where results are.")] = Path("results"),
    out: Annotated[Path, Option(metavar="DIR", help="Where the report goes.")] = Path("report"),
) -> None:
    """Make tables, figures and the HTML page from results."""
    os.environ.pop("MPLBACKEND", None)  # what is in there may end Matplotlib, and figures in files need none
    from reports.page import NoResults, write_report
    from reports.parts import Contradiction
    from reports.results import BrokenResults

    try:
        with failures.writing("--out", out):
            notes = write_report(results, out)
    except (NoResults, BrokenResults) as reason:
        raise failures.BadInput(f"--results: expected the results of a study, got '{reason}'") from None
    except Contradiction as reason:
        raise failures.Failed(str(reason)) from None
    for note in notes:
        failures.say(f"note: {note}")
    failures.say(f"note: the report is {out / 'index.html'}")


def main() -> None:
    """Run the command line and leave with its exit code."""
    logging.getLogger("reference_solver").handlers = [failures.Notes()]
    try:
        with failures.interrupted_in_silence():
            code = app(standalone_mode=False, prog_name="crankslider") or 0
        message = "interrupted" if code == failures.INTERRUPTED else ""  # typer returns it after Ctrl-C
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads stdout has seen enough
        message, code = "", 1
        # What stdout still holds cannot be written, and Python would say so once more at its end.
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  it lives as long as the process
    except Exception as error:
        message, code = failures.explained(error)
    if message:
        failures.say(f"error: {message}")
    sys.exit(code)

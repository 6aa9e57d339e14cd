"""The command ``crankslider``: exit code 0, 2 for bad input, 1 for failed work, 130 after Ctrl-C."""

import json
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option, Typer

from studies import failures
from studies.registry import STUDIES

if TYPE_CHECKING:
    from studies.command.finished_run import Run

app = Typer(
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Simulate crank-sliders with the reference solver, Exudyn, Pymunk and SciPy; compare them.",
)


def _version(wanted: bool) -> None:
    """Print the version and exit, if it is ``wanted``."""
    if wanted:
        from importlib.metadata import version

        print(f"crankslider {version('crankslider')}")
        raise Exit


def _scenes(begun: str) -> Iterator[str]:
    """Yield the library scenes whose names start with ``begun``, for completion in a shell."""
    from engine_models.scene.library.mechanisms import ALL_SCENES

    yield from (name for name in ALL_SCENES if name.startswith(begun))


def _engines(begun: str) -> Iterator[str]:
    """Yield the engines whose names start with ``begun``."""
    from engine_models.engines import ENGINES

    yield from (name for name in ENGINES if name.startswith(begun))


#: An option that is read as text and checked later, so that Typer does not write the error message.
Text = str | None
SceneName = Annotated[
    str, Argument(metavar="SCENE", help="A library scene or a TOML file.", autocompletion=_scenes)
]
Changes = Annotated[
    list[str] | None,
    Option(
        "--with",
        metavar="FIELD=VALUE",
        help="Change a field of the scene, for example clearance.B.radial_clearance_m=1e-4.",
    ),
]
EndTime = Annotated[Text, Option(metavar="T", help="End time in s; default: that of the scene.")]
SamplesFile = Annotated[
    Path, Option(metavar="FILE", help="Write samples to .csv, .json or .parquet; - is stdout, as CSV.")
]
ImpactsFile = Annotated[
    Path | None, Option(metavar="FILE", help="Write impacts, one row each, to .csv, .json or .parquet.")
]
Quiet = Annotated[bool, Option("--quiet", help="Print only warnings and errors.")]


@app.callback()
def about(
    version: Annotated[
        bool, Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Handle the options before a command."""


@app.command()
def scenes() -> None:
    """List the scenes of the library."""
    from studies.command.listings import scene_listing

    print(scene_listing())


@app.command()
def engines(
    name: Annotated[
        str | None, Argument(metavar="[NAME]", help="Describe this engine in full.", autocompletion=_engines)
    ] = None,
) -> None:
    """List the engines, their settings and the library scenes that each can run."""
    from studies.command.listings import engine_in_full, engine_listing

    print(engine_listing() if name is None else engine_in_full(name))


@app.command()
def show(scene: SceneName) -> None:
    """Print a scene as TOML, as a template for a file of your own."""
    from studies.command.options import read_scene

    print(read_scene(scene).to_toml(), end="")


@app.command()
def check(scene: SceneName, changes: Changes = None, quiet: Quiet = False) -> None:
    """Tell bodies, rows and freedoms of a mechanism, its start, and its nearest singular position."""
    from studies.command.options import read_scene
    from studies.command.progress_display import shown_progress
    from studies.command.simulation import checked_mechanism

    physics = read_scene(scene, changes or [])
    with failures.quietly(quiet), shown_progress(physics.end_time_s):
        lines = checked_mechanism(physics)
    print("\n".join(lines))


@app.command()
def schema() -> None:
    """Print the JSON schema of scene files, with which editors complete and check them."""
    from engine_models.scene.schema import scene_schema

    print(json.dumps(scene_schema(), indent=2, ensure_ascii=False))


@app.command()
def simulate(
    scene: SceneName,
    engine: Annotated[
        str,
        Option(metavar="NAME", help="reference, exudyn, pymunk or scipy.", autocompletion=_engines),
    ] = "reference",
    assignments: Annotated[
        list[str] | None,
        Option("--set", metavar="KEY=VALUE", help="A setting of the engine; see 'crankslider engines'."),
    ] = None,
    changes: Changes = None,
    step: Annotated[
        Text, Option(metavar="H", help="Longest time step in s; default: 1e-5, none for dop853.")
    ] = None,
    tolerance: Annotated[
        Text, Option(metavar="TOL", help="Refine the run until the slider position is accurate to TOL in m.")
    ] = None,
    end: EndTime = None,
    samples: Annotated[str, Option(metavar="N", help="Number of output intervals of equal length.")] = "200",
    out: SamplesFile = Path("-"),
    impacts: ImpactsFile = None,
    plot: Annotated[
        Path | None,
        Option(metavar="FILE", help="Draw motion, forces and energy to .png, .svg or .pdf."),
    ] = None,
    animate: Annotated[
        Path | None, Option(metavar="FILE", help="Animate the mechanism to .html, .gif or .mp4.")
    ] = None,
    exaggerate: Annotated[
        Text, Option(metavar="TIMES", help="Enlarge clearances in the animation by this factor; default: 1.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run a scene; write motion, forces and energy as a table, on request impacts, a figure, an animation."""
    from studies.command import options, outputs
    from studies.command.simulation import simulated

    strings = {"step": step, "tolerance": tolerance, "end": end, "samples": samples}
    numbers = options.checked(options.SimulateOptions, "--", strings)
    physics = options.read_scene(scene, changes or [], numbers.end)
    settings = options.assigned("--set", "KEY=VALUE", assignments or [])
    chosen = options.read_engine(engine, settings, to_tolerance=numbers.tolerance is not None)
    files = [outputs.samples(out)]
    if impacts is not None:
        files.append(outputs.impacts(impacts, physics))
    if plot is not None:
        files.append(outputs.plot(plot))
    if animate is not None:
        files.append(outputs.film(animate, exaggerate))
    elif exaggerate is not None:
        raise failures.BadInput(f"--exaggerate: expected nothing without --animate, got {exaggerate}")
    outputs.require_places(files, scene, changes or [])
    with failures.quietly(quiet):
        _say(outputs.write(files, physics, lambda: simulated(physics, engine, chosen, numbers)))


def _say(run: "Run") -> None:
    """Print the warnings and notes of a run."""
    for warning in run.warnings:
        failures.say(f"warning: {warning}")
    for note in run.notes():
        failures.note(note)


@app.command()
def truth(
    scene: SceneName,
    changes: Changes = None,
    end: EndTime = None,
    samples: Annotated[str, Option(metavar="N", help="Number of output intervals of equal length.")] = "120",
    out: SamplesFile = Path("-"),
    impacts: ImpactsFile = None,
    quiet: Quiet = False,
) -> None:
    """Write the reference solution of a scene, independent of all engines, as far as it is predictable."""
    from studies.command import options, outputs
    from studies.command.truth import true_run

    numbers = options.checked(options.SimulateOptions, "--", {"end": end, "samples": samples})
    physics = options.read_scene(scene, changes or [], numbers.end)
    files = [outputs.samples(out)]
    if impacts is not None:
        files.append(outputs.impacts(impacts, physics))
    outputs.require_places(files, scene, changes or [])
    with failures.quietly(quiet):
        _say(outputs.write(files, physics, lambda: true_run(physics, numbers)))


@app.command()
def sweep(
    scene: SceneName,
    vary: Annotated[
        list[str] | None,
        Option(
            metavar="FIELD=VALUES",
            help="Values of a field: LOW:HIGH[:log][:COUNT] or a list, 1e-5,1e-4; repeat for a grid.",
        ),
    ] = None,
    sample: Annotated[
        str, Option(metavar="NAME", help="grid, or a sampling: random, latin-hypercube or sobol.")
    ] = "grid",
    members: Annotated[
        Text, Option(metavar="N", help="Number of members, or of members at each point of a grid.")
    ] = None,
    jitter: Annotated[
        str,
        Option(
            metavar="RAD",
            help="Change the angle of crank or turning body at each start by up to RAD, randomly.",
        ),
    ] = "0",
    seed: Annotated[str, Option(metavar="S", help="Seed of the random members.")] = "0",
    engine: Annotated[
        str, Option(metavar="NAME", help="See 'crankslider engines'.", autocompletion=_engines)
    ] = "reference",
    assignments: Annotated[
        list[str] | None, Option("--set", metavar="KEY=VALUE", help="A setting of the engine.")
    ] = None,
    changes: Changes = None,
    step: Annotated[
        Text, Option(metavar="H", help="Longest time step in s; default: 1e-5, none for dop853.")
    ] = None,
    transient: Annotated[str, Option(metavar="R", help="Revolutions before the evaluation starts.")] = "0",
    revolutions: Annotated[str, Option(metavar="R", help="Revolutions that are evaluated.")] = "2",
    jobs: Annotated[Text, Option(metavar="N", help="Local processes; default: one for each core.")] = None,
    scheduler: Annotated[
        Text, Option(metavar="ADDRESS", help="Dask scheduler that runs the members.")
    ] = None,
    out: Annotated[Path, Option(metavar="FILE", help="Write the rows to .parquet or .csv.")] = Path(
        "sweep.parquet"
    ),
    plot: Annotated[
        Path | None,
        Option(metavar="FILE", help="Draw a column over one or two fields to .png, .svg or .pdf."),
    ] = None,
    show: Annotated[Text, Option(metavar="COLUMN", help="Column that the figure shows.")] = None,
    quiet: Quiet = False,
) -> None:
    """Run a scene with many values of its fields, one row each; an interrupted sweep resumes.

    Revolutions are those of the crank, or of the scene's turning body, at its speed at the start. Without
    such a speed, one revolution is the scene's end time.
    """
    from studies.command import options
    from studies.command import sweep as sweeps

    strings = {"sample": sample, "members": members, "jitter": jitter, "seed": seed, "step": step}
    strings |= {"transient": transient, "revolutions": revolutions}
    strings["jobs"] = str(os.cpu_count() or 1) if jobs is None else jobs
    chosen = options.checked(sweeps.SweepOptions, "--", strings)
    options.ending_of("--out", out, sweeps.TABLES)
    physics = options.read_scene(scene, changes or [])
    ranges = options.assigned("--vary", "FIELD=VALUES", vary or [])
    settings = options.assigned("--set", "KEY=VALUE", assignments or [])
    wanted = sweeps.read_sweep(physics, ranges, engine, settings, chosen)
    write_plot = sweeps.plotting(plot, show, wanted)
    with failures.quietly(quiet):
        swept = sweeps.run_sweep(wanted, out, chosen.jobs, scheduler)
        write_plot(swept)
        if swept.warning is not None:
            failures.say(f"warning: {swept.warning}")
        failures.note(f"{len(swept.frame)} rows are in {out}")


@app.command()
def run(
    studies: Annotated[
        list[str] | None,
        Argument(metavar="[STUDY]...", help=f"Studies to run; default: all of {', '.join(STUDIES)}."),
    ] = None,
    full: Annotated[
        bool, Option("--full", help="Run the full set of cases instead of the quick one.")
    ] = False,
    engines: Annotated[
        list[str] | None,
        Option(
            "--engine",
            metavar="NAME",
            help="Run only cases of this engine, or of your own: my_module:MyEngine.",
        ),
    ] = None,
    jobs: Annotated[
        Text, Option(metavar="N", help="Cases to run in parallel; default: one for each core.")
    ] = None,
    out: Annotated[Path, Option(metavar="DIR", help="Folder of the results.")] = Path("results"),
    scheduler: Annotated[
        Text,
        Option(metavar="ADDRESS", help="Dask scheduler that runs cases; timed or limited cases run locally."),
    ] = None,
    retry_failed: Annotated[
        bool, Option("--retry-failed", help="Run cases again that neither finished nor were refused.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run studies; finished cases are saved and skipped the next time."""
    from studies.cluster import Cluster
    from studies.command.options import RunOptions, checked
    from studies.command.study_run import joined, require_studies, running_in
    from studies.runner import run_studies

    require_studies(studies or [])
    joined(engines or [])
    options = checked(RunOptions, "--", {"jobs": str(os.cpu_count() or 1) if jobs is None else jobs})
    workers = nullcontext() if scheduler is None else Cluster(scheduler)
    with failures.quietly(quiet):
        names = list(dict.fromkeys(studies or STUDIES))
        with workers as cluster, running_in(out):
            run_studies(names, full, options.jobs, out, cluster, retry_failed, engines or ())
        failures.note(f"the results are in {out}")


@app.command()
def compare(
    scene: SceneName,
    engines: Annotated[
        list[str] | None,
        Option(
            "--engine",
            metavar="NAME",
            help="Run only this engine; repeat for several; my_module:MyEngine is your own.",
        ),
    ] = None,
    changes: Changes = None,
    out: Annotated[
        Path | None, Option(metavar="DIR", help="Folder of the page and the rows; default: comparison/NAME.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare engines on a scene: which configuration and setting to use, with its error and run time."""
    from studies.command.options import read_scene
    from studies.command.study_run import joined, running_in

    physics = read_scene(scene, changes or [])
    joined(engines or [])
    from rich.console import Console

    from studies.command.comparison import comparison, default_folder  # takes seconds

    folder = out or default_folder(physics)
    with failures.quietly(quiet):
        with running_in(folder):
            given = " ".join([quote(scene), *(f"--with {quote(change)}" for change in changes or [])])
            found = comparison(physics, given, engines or (), folder)
            found.save(folder)
        Console().print(found.table())
        print(found.recommendation)
        failures.note(f"the page is {folder / 'index.html'}")


@app.command()
def conform(
    engine: Annotated[str, Argument(metavar="ENGINE", help="An engine, or your own: my_module:MyEngine.")],
    baselines: Annotated[
        Path | None,
        Option(metavar="DIR", help="Also compare its numbers with the table in this folder."),
    ] = None,
    accept: Annotated[bool, Option("--accept", help="Accept the numbers as they are, with --why.")] = False,
    why: Annotated[Text, Option(metavar="TEXT", help="Reason why the numbers changed.")] = None,
    quiet: Quiet = False,
) -> None:
    """Run the checks that every engine has to pass; exit code 1 if one fails."""
    from rich.progress import track

    from engine_models.engines import join
    from studies.baselines import compare_or_accept, read
    from studies.command.options import read_engine
    from studies.conformance.verdicts import count, summary, verdicts
    from studies.whole_file import require_folder

    try:
        of = read_engine(engine, {})
    except failures.BadInput as reason:
        raise failures.BadInput(str(reason).replace("--engine", "ENGINE", 1)) from None
    _require_reason(accept, why)
    if accept and baselines is None:
        raise failures.BadInput("--accept: expected a folder with --baselines to write to, got none")
    join(engine)
    if accept and baselines is not None:
        with failures.writing("--baselines", baselines):
            require_folder(baselines)
    elif baselines is not None:
        read(baselines)
    with failures.quietly(quiet):
        console = failures.progress_console()
        lines, holds = summary(track(verdicts(of), engine, count(of), console=console, transient=True))
        print("\n".join(lines))
        if not holds:
            raise failures.Failed(f"{engine} does not pass all checks")
        if baselines is not None:
            compare_or_accept([engine], baselines, why)


@app.command()
def baseline(
    accept: Annotated[bool, Option("--accept", help="Accept the numbers as they are, with --why.")] = False,
    why: Annotated[Text, Option(metavar="TEXT", help="Reason why the numbers changed.")] = None,
    quiet: Quiet = False,
) -> None:
    """Compare the accuracy of all configurations with baselines; exit code 1 if a number left its band."""
    from engine_models.arms import NAMED
    from studies.baselines import FOLDER, compare_or_accept, read

    _require_reason(accept, why)
    if not accept:
        read(FOLDER)
    with failures.quietly(quiet):
        compare_or_accept(NAMED, FOLDER, why)


def _require_reason(accept: bool, why: str | None) -> None:
    """Raise BadInput if there is acceptance without a reason, or a reason without acceptance."""
    if accept != bool(why and why.strip()):
        came = "none" if accept else "one without --accept"
        raise failures.BadInput(f"--why: expected a reason with --accept, got {came}")


@app.command()
def report(
    results: Annotated[Path, Option(metavar="DIR", help="Folder of the results.")] = Path("results"),
    out: Annotated[Path, Option(metavar="DIR", help="Folder of the report.")] = Path("report"),
    against: Annotated[
        Path | None,
        Option(metavar="DIR", help="Folder of another report; print the numbers of both side by side."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write the HTML page, its figures as SVG and its tables as CSV from results, and print the answer."""
    from reports.page import (
        Contradiction,
        compare_claims,
        read_claims,
        require_replaceable,
        write_report,
    )
    from studies.whole_file import require_folder, whole_folder

    try:
        before = None if against is None else read_claims(against)
    except (OSError, ValueError) as reason:
        raise failures.BadInput(f"--against: expected the folder of a report, got '{reason}'") from None
    try:
        with failures.writing("--out", out):
            require_folder(out)
            require_replaceable(out)
            with whole_folder(out) as new:
                made = write_report(results, new)
    except Contradiction as reason:
        raise failures.Failed(str(reason)) from None
    with failures.quietly(quiet):
        for note in made.notes:
            failures.note(note)
        if before is None:
            print("\n".join(made.answer))
        else:
            print(compare_claims(before, read_claims(out)).to_string())
        failures.note(f"the report is {out / 'index.html'}")


def main() -> None:
    """Run the command line and exit with its exit code."""
    failures.make_ready()
    logging.getLogger("reference_solver").handlers = [failures.Notes()]
    try:
        with failures.interrupted_in_silence():
            code = app(standalone_mode=False, prog_name="crankslider") or 0
        message = "interrupted" if code == failures.INTERRUPTED else ""  # typer returns it after Ctrl-C
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of stdout has closed it
        message, code = "", 1
        # The buffer of stdout cannot be written; Python would report that again at exit.
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115  it lives as long as the process
    except Exception as error:
        message, code = failures.explained(error)
    if message:
        failures.say(f"error: {message}")
    sys.exit(code)

"""The command ``crankslider``: exit code 0, 2 for bad input, 1 for failed work, 130 after Ctrl-C."""

import json
import logging
import os
import signal
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Exit, Option, Typer

from studies.failures import BadInput, Failed, bug, log, progress_console, writing
from studies.registry import STUDIES

if TYPE_CHECKING:
    from crankslider.run import Run
    from engine_models.scene.scene import Scene

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

app = Typer(
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Simulate planar mechanisms with the reference solver, Exudyn, Pymunk and SciPy; compare them.",
)
INTERRUPTED = 130
#: Time between lines on the progress of a simulation, in s.
LINE_S = 10.0
#: The part of a run that tells which columns its table will have.
SHORT = 1e-6
#: Whose functions no interrupt may leave: LLVM calls them, and goes on with half a result. It comes again.
UNBREAKABLE, AGAIN_S = "llvmlite.", 0.01


def _quieten(wanted: bool) -> bool:
    """Keep notes and progress back, if that is ``wanted``."""
    log.setLevel(logging.WARNING if wanted else logging.INFO)
    return wanted


#: Options are read as text where the library takes numbers as people type them.
Text = str | None
Numbers = dict[str, Any]
SceneName = Annotated[str, Argument(metavar="SCENE", help="A library scene or a TOML file.")]
Changes = Annotated[
    list[str] | None,
    Option(
        "--with",
        metavar="FIELD=VALUE",
        help="Change a field of the scene, for example clearance.B.radial_clearance_m='\"0.1 mm\"'.",
    ),
]
EndTime = Annotated[Text, Option(metavar="T", help="End time in s, or as 10ms; default: that of the scene.")]
Step = Annotated[
    Text, Option(metavar="H", help="Longest step in s, or as 5us; default: 1e-5, none for dop853.")
]
EngineName = Annotated[str, Option("--engine", metavar="NAME", help="See 'crankslider engines'.")]
Engines = Annotated[
    list[str] | None,
    Option(
        "--engine", metavar="NAME", help="Only this engine; repeat for more. Your own: my_module:MyEngine."
    ),
]
Settings = Annotated[
    list[str] | None,
    Option("--set", metavar="KEY=VALUE", help="A setting of the engine; see 'crankslider engines'."),
]
SamplesFile = Annotated[
    Path | None,
    Option(metavar="FILE", help="Write samples to .csv, .json or .parquet; - is stdout, the default alone."),
]
ImpactsFile = Annotated[
    Path | None, Option(metavar="FILE", help="Write impacts, one row each, to .csv, .json or .parquet.")
]
Figure = Annotated[Path | None, Option(metavar="FILE", help="Draw it to .png, .svg or .pdf.")]
Samples = Annotated[str, Option(metavar="N", help="Number of output intervals of equal length.")]
Jobs = Annotated[Text, Option(metavar="N", help="Local processes; default: one for each core.")]
Scheduler = Annotated[Text, Option(metavar="ADDRESS", help="Dask scheduler; timed cases run here.")]
Quiet = Annotated[
    bool,
    Option("--quiet", callback=_quieten, help="Print neither notes nor progress, and no table of samples."),
]
Json = Annotated[bool, Option("--json", help="Print JSON.")]
Accept = Annotated[bool, Option("--accept", help="Accept the numbers as they are, with --why.")]
Why = Annotated[Text, Option(metavar="TEXT", help="Reason why the numbers changed.")]


@app.callback(invoke_without_command=True)
def about(
    context: typer.Context, version: Annotated[bool, Option("--version", help="Print the version.")] = False
) -> None:
    """Handle the options before a command."""
    if version:
        from importlib.metadata import version as installed

        print(f"crankslider {installed('crankslider')}")
        raise Exit
    if context.invoked_subcommand is None:
        raise BadInput(f"COMMAND: expected one of {', '.join(context.command.commands)}, got nothing")  # type: ignore[attr-defined]


@app.command()
def scenes(as_json: Json = False) -> None:
    """List the scenes of the library."""
    from engine_models.scene.library import ALL_SCENES

    rows = []
    for name, make in ALL_SCENES.items():
        scene = make()
        joints = ", ".join(scene.joints_with_clearance) or "none"
        about = (make.__doc__ or "").partition("\n")[0]
        rows.append((name, scene.drive.kind, joints, f"{scene.end_time_s:g} s", about))
    _print_rows(("scene", "drive", "clearance", "end time", "about"), rows, as_json)


@app.command()
def engines(
    name: Annotated[Text, Argument(metavar="[NAME]", help="Describe this engine in full.")] = None,
    as_json: Json = False,
) -> None:
    """List the engines, their settings and the library scenes that each can run."""
    from inspect import cleandoc

    from engine_models.engine import UnsupportedScene
    from engine_models.engines import ENGINES, engine_class, make_engine
    from engine_models.scene.library import ALL_SCENES
    from engine_models.scene.plain_words import expectation, fields, shown, unknown

    if name is not None and name not in ENGINES:
        raise BadInput(unknown("NAME", name, ENGINES))
    listed = list[dict[str, Any]]()
    for each in ENGINES if name is None else [name]:
        kind = engine_class(each)
        settings = [(f"  {key}", shown(it["default"]), expectation(it)) for key, it in fields(kind).items()]
        refused = dict[str, str]()
        for scene, make in ALL_SCENES.items():
            try:
                make_engine(each).check(make())
            except UnsupportedScene as reason:
                refused[scene] = str(reason)
        text = cleandoc(kind.__doc__ or "")
        listed.append({"engine": each, "about": text, "settings": settings, "refused": refused})
    if as_json:
        print(json.dumps(listed, indent=2))
        return
    for engine in listed:
        about = str(engine["about"])
        print(f"{engine['engine']}: {about if name else about.partition(chr(10))[0]}")
        _print_rows((), engine["settings"])
        why = dict[str, list[str]]()
        for scene, refusal in engine["refused"].items():
            why.setdefault(refusal, []).append(scene)
        for refusal, some in why.items():
            print(f"  not {', '.join(some)}: {refusal}")


def _print_rows(head: Sequence[str], rows: Any, as_json: bool = False) -> None:
    """Print rows in aligned columns, or as JSON."""
    if as_json:
        print(json.dumps([dict(zip(head, row, strict=True)) for row in rows], indent=2))
        return
    lines = [head, *rows] if head else rows
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


@app.command()
def show(scene: SceneName, changes: Changes = None) -> None:
    """Print a scene as TOML, as a template for a file of your own."""
    print(_scene(scene, changes).to_toml(), end="")


@app.command()
def check(scene: SceneName, changes: Changes = None, quiet: Quiet = False) -> None:
    """Tell freedoms and start of a mechanism, singular positions, dead centres, transmission angles."""
    from engine_models.engine import ImpossibleStart, SimulationFailed
    from engine_models.reference.inspection import inspect

    physics = _scene(scene, changes)
    try:
        with _progress(physics.end_time_s):
            lines = inspect(physics)
    except ImpossibleStart as reason:
        raise BadInput(str(reason)) from None
    except SimulationFailed as reason:
        raise Failed(str(reason)) from None
    print("\n".join(lines))


@app.command()
def schema() -> None:
    """Print the JSON schema of scene files, with which editors complete and check them."""
    from engine_models.scene.schema import scene_schema

    print(json.dumps(scene_schema(), indent=2, ensure_ascii=False))


@app.command()
def simulate(
    scene: SceneName,
    engine: EngineName = "reference",
    settings: Settings = None,
    changes: Changes = None,
    step: Step = None,
    tolerance: Annotated[
        Text, Option(metavar="TOL", help="Refine the run until the slider position is accurate to TOL in m.")
    ] = None,
    end: EndTime = None,
    start: Annotated[
        str,
        Option(
            "--from",
            "--start",
            metavar="T",
            help="The largest contact force is that after T: a transient is over.",
        ),
    ] = "0",
    samples: Samples = "200",
    out: SamplesFile = None,
    impacts: ImpactsFile = None,
    plot: Figure = None,
    plot_columns: Annotated[Text, Option(metavar="A,B", help="Columns that the figure shows.")] = None,
    animate: Annotated[
        Path | None, Option(metavar="FILE", help="Animate the mechanism to .html, .gif or .mp4.")
    ] = None,
    exaggerate: Annotated[
        Text, Option(metavar="TIMES", help="Enlarge clearances in the animation by this factor; default: 1.")
    ] = None,
    quick: Annotated[
        bool, Option("--quick", help="Do not check the run by a second one, at half its step.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run a scene; write motion, forces and energy as a table, on request impacts, a figure, an animation."""
    from crankslider import library
    from crankslider.run import FILMS, PICTURES, factor, require_file

    physics = _scene(scene, changes, end)
    if exaggerate is not None and animate is None:
        raise BadInput(f"exaggerate: expected nothing without animate, got {exaggerate}")
    inputs = _require_tables(scene, changes, physics, out, impacts)
    for name, path, endings in (("plot", plot, PICTURES), ("animate", animate, FILMS)):
        if path is not None:
            require_file(name, path, endings, inputs)
    given = _assigned("set", "KEY=VALUE", settings)
    numbers: Numbers = {"step": step, "tolerance": tolerance, "samples": samples, "start": start}
    film: Numbers = {} if exaggerate is None else {"exaggerate": exaggerate}
    times, columns = factor(**film), tuple(plot_columns.split(",")) if plot_columns else ()
    if columns:  # those of a run of no length
        short = physics.replace("end_time_s", SHORT * physics.end_time_s)
        library.simulate(short, engine, settings=given, samples=1, quick=True).require_columns(columns)
    with _progress(physics.end_time_s):
        run = library.simulate(physics, engine, settings=given, quick=quick, **numbers)
        if out is None and not (impacts or plot or animate or quiet):
            out = Path("-")
        run.write(out, impacts, plot, animate, columns, times)
    _tell(run)


def _require_tables(
    scene: str, changes: Any, physics: "Scene", out: Path | None, impacts: Path | None
) -> list[Path]:
    """Refuse tables that cannot be written, and return what no other file may be: they and the scene's."""
    from crankslider.run import TABLES, require_file
    from engine_models.scene.file import sources

    inputs = sources(Path(scene), _fields(changes)) if os.path.isfile(scene) else []
    if impacts is not None and not physics.joints_with_clearance:
        raise BadInput(f"impacts: expected a scene with clearance, got {physics.name}, which has no impacts")
    for name, path in (("out", out), ("impacts", impacts)):
        if path is not None:
            require_file(name, path, TABLES, inputs)
            inputs = [*inputs, path]
    return inputs


def _tell(run: "Run") -> None:
    for note in run.notes():
        log.info(note)


@app.command()
def truth(
    scene: SceneName,
    changes: Changes = None,
    end: EndTime = None,
    samples: Samples = "120",
    out: SamplesFile = None,
    impacts: ImpactsFile = None,
    quiet: Quiet = False,
) -> None:
    """Write the reference solution of a scene, independent of all engines, as far as it is predictable."""
    from crankslider import library

    physics = _scene(scene, changes, end)
    _require_tables(scene, changes, physics, out, impacts)
    numbers: Numbers = {"samples": samples}
    with _progress(physics.end_time_s):
        run = library.truth(physics, **numbers)
    run.write(Path("-") if out is None and not (impacts or quiet) else out, impacts)
    _tell(run)


@app.command()
def sweep(
    scene: SceneName,
    vary: Annotated[
        list[str] | None,
        Option(
            metavar="FIELD=VALUES",
            help="Values of a field: LOW:HIGH[:log][:COUNT] or a list, 0.1mm,0.2mm; repeat for a grid.",
        ),
    ] = None,
    sample: Annotated[
        str, Option(metavar="NAME", help="grid, or a sampling: random, latin-hypercube or sobol.")
    ] = "grid",
    members: Annotated[
        Text, Option(metavar="N", help="Number of members, or of members at each point of a grid.")
    ] = None,
    jitter: Annotated[
        str, Option(metavar="RAD", help="Change the angle of the turning body at each start by up to RAD.")
    ] = "0",
    seed: Annotated[str, Option(metavar="S", help="Seed of the random members.")] = "0",
    engine: EngineName = "reference",
    settings: Settings = None,
    changes: Changes = None,
    step: Step = None,
    transient: Annotated[str, Option(metavar="R", help="Revolutions before the evaluation starts.")] = "0",
    revolutions: Annotated[str, Option(metavar="R", help="Revolutions that are evaluated.")] = "2",
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    out: Annotated[Path, Option(metavar="FILE", help="Write the rows to .parquet or .csv.")] = Path(
        "sweep.parquet"
    ),
    plot: Figure = None,
    show: Annotated[Text, Option(metavar="COLUMN", help="Column that the figure shows.")] = None,
    quiet: Quiet = False,
) -> None:
    """Run a scene with many values of its fields, one row each; an interrupted sweep resumes.

    Revolutions are those of the crank, or of the scene's turning body, at its speed at the start. Without
    such a speed, one revolution is the scene's end time.
    """
    from crankslider import library
    from crankslider.run import PICTURES, require_file
    from studies.whole_file import write_whole

    ranges = _assigned("vary", "FIELD=VALUES", vary)
    if plot is not None:
        require_file("plot", plot, PICTURES)
        if len(ranges) + (jitter != "0") > 2:
            raise BadInput(
                f"plot: expected at most 2 fields that differ, got {len(ranges) + (jitter != '0')}"
            )
    elif show is not None:
        raise BadInput(f"show: expected nothing without plot, got {show}")
    numbers: Numbers = {"members": members, "jitter": jitter, "seed": seed, "step": step, "jobs": jobs}
    numbers |= {"sample": sample, "transient": transient, "revolutions": revolutions}
    given = _assigned("set", "KEY=VALUE", settings)
    physics = _scene(scene, changes)
    swept = library.sweep(physics, ranges, engine, settings=given, scheduler=scheduler, out=out, **numbers)
    if plot is not None:
        from reports.look import picture_bytes

        with writing("plot", plot):
            write_whole(plot, picture_bytes(swept.plot(show), plot.suffix.lower()))
    log.info(f"{len(swept.frame)} rows are in {out}")


@app.command()
def run(
    studies: Annotated[
        list[str] | None,
        Argument(metavar="[STUDY]...", help=f"Studies to run; default: all of {', '.join(STUDIES)}."),
    ] = None,
    full: Annotated[bool, Option("--full", help="Run the full set of cases, not the quick one.")] = False,
    engines: Engines = None,
    jobs: Jobs = None,
    out: Annotated[Path, Option(metavar="DIR", help="Folder of the results.")] = Path("results"),
    scheduler: Scheduler = None,
    retry_failed: Annotated[
        bool, Option("--retry-failed", help="Run cases again that neither finished nor were refused.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run studies; finished cases are saved and skipped the next time."""
    from crankslider import library

    numbers: Numbers = {"jobs": jobs}
    library.run_studies(
        studies or (), full, engines or (), out=out, scheduler=scheduler, retry_failed=retry_failed, **numbers
    )
    log.info(f"the results are in {out}")


@app.command()
def compare(
    scene: SceneName,
    engines: Engines = None,
    changes: Changes = None,
    error: Annotated[Text, Option(metavar="E", help="Error asked for, in the signal's unit.")] = None,
    signal: Annotated[Text, Option(metavar="NAME", help="Signal that is judged: joint_B_force.")] = None,
    out: Annotated[
        Path | None, Option(metavar="DIR", help="Folder of the page and the rows; default: comparison/NAME.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare engines on a scene: which configuration and setting to use, with its error and run time."""
    from crankslider import library

    physics = _scene(scene, changes)
    given = " ".join([quote(scene), *(f"--with {quote(change)}" for change in changes or [])])
    numbers: Numbers = {"error": error}
    result = library.compare(physics, engines or (), out, signal=signal, given=given, **numbers)
    folder = out or library.comparison_folder(physics)
    result.save(folder)
    if as_json:
        print(result.table().to_json(orient="records", indent=2))
    else:
        print(result.table().to_string(index=False))
        print(result.recommendation)
    log.info(f"the page is {folder / 'index.html'}")


@app.command()
def conform(
    engine: Annotated[
        Text, Argument(metavar="[ENGINE]", help="An engine, or your own: my_module:MyEngine.")
    ] = None,
    table: Annotated[
        Path | None, Option("--from", metavar="FILE.csv", help="A table of another solver, with --scene.")
    ] = None,
    scene: Annotated[Text, Option(metavar="SCENE", help="The scene that the table is of.")] = None,
    baselines: Annotated[
        Path | None, Option(metavar="DIR", help="Also compare its numbers with the table in this folder.")
    ] = None,
    accept: Accept = False,
    why: Why = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run the checks that every engine has to pass; exit code 1 if one fails."""
    from rich.progress import track

    from crankslider import library

    _require_reason(accept, why)
    if accept and baselines is None:
        raise BadInput("accept: expected a folder with baselines to write to, got none")
    if (engine is None) == (table is None) or (scene is None) != (table is None):
        raise BadInput("ENGINE: expected an engine, or --from FILE.csv with --scene SCENE, got another call")
    if table is not None:
        verdicts, subject = library.verdicts_on_file(table, _scene(str(scene), None)), str(table)
    else:
        verdicts, subject = library.verdicts_on(str(engine)), str(engine)
    if baselines is not None:
        library.require_baselines(baselines, accept)
    results = [*track(verdicts, subject, None, console=progress_console(), transient=True)]
    failed = [each for each in results if not each.holds]
    if as_json:
        print(json.dumps([each._asdict() for each in results], indent=2))
    else:
        for claim in dict.fromkeys(each.claim for each in results):
            ones = [each for each in results if each.claim == claim]
            wrong = [each for each in ones if not each.holds]
            held = f"{len(ones) - len(wrong)} of {len(ones)} scenes" if ones[0].scene else ones[0].measured
            print(f"{'FAILS' if wrong else 'holds'}  {claim}: {held}")
            for each in wrong if ones[0].scene else ():
                print(f"         {each.scene}: {each.measured}")
    if failed:
        raise Failed(f"{subject} does not pass all checks")
    if baselines is not None:
        _tell_differences(library.compare_baselines([subject], baselines, why), as_json)


@app.command()
def baseline(accept: Accept = False, why: Why = None, as_json: Json = False, quiet: Quiet = False) -> None:
    """Compare the accuracy of all configurations with baselines; exit code 1 if a number left its band."""
    from crankslider import library

    _require_reason(accept, why)
    _tell_differences(library.compare_baselines(why=why), as_json)


def _tell_differences(lines: list[str], as_json: bool) -> None:
    """Print the numbers that left their bands; raise Failed if there are any."""
    print(json.dumps(lines, indent=2) if as_json else "\n".join(lines))
    if lines:
        raise Failed(f"{len(lines)} numbers left their bands")


def _require_reason(accept: bool, why: str | None) -> None:
    """Raise BadInput if there is acceptance without a reason, or a reason without acceptance."""
    if accept != bool(why and why.strip()):
        came = "none" if accept else "one without accept"
        raise BadInput(f"why: expected a reason with accept, got {came}")


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
    from reports.contents import CHAPTERS
    from reports.page import Contradiction, read_claims, require_replaceable, write_report
    from studies.whole_file import require_folder, whole_folder

    try:
        before = None if against is None else read_claims(against)
    except (OSError, ValueError, LookupError, TypeError) as reason:
        raise BadInput(f"against: expected the folder of a report, got '{reason}'") from None
    try:
        with writing("out", out):
            require_folder(out)
            require_replaceable(out)
            with whole_folder(out) as new:
                made = write_report(results, new, CHAPTERS)
    except Contradiction as reason:
        raise Failed(str(reason)) from None
    for note in made.notes:
        log.info(note)
    if before is None:
        print("\n".join(made.answer))
    else:
        from pandas import DataFrame

        print(DataFrame({"before": before, "after": read_claims(out)}).fillna("–").to_string())
    log.info(f"the report is {out / 'index.html'}")


def _scene(scene: str, changes: Sequence[str] | None, end: str | None = None) -> "Scene":
    from crankslider.library import read_scene

    numbers: Numbers = {"end": end}
    return read_scene(scene, _fields(changes), **numbers)


def _fields(assignments: Sequence[str] | None) -> dict[str, object]:
    """Return assignments ``FIELD=VALUE`` with values as in TOML, or as text where they are none."""
    fields: dict[str, object] = {}
    for field, text in _assigned("with", "FIELD=VALUE", assignments).items():
        try:
            fields[field] = tomllib.loads(f"value = {text}")["value"]
        except (ValueError, RecursionError):
            fields[field] = text
    return fields


def _assigned(option: str, form: str, assignments: Sequence[str] | None) -> dict[str, str]:
    """Return the values of assignments, each of a ``form`` such as ``KEY=VALUE``, by their keys."""
    from engine_models.scene.plain_words import shown

    values: dict[str, str] = {}
    for assignment in assignments or ():
        key, equals, value = assignment.partition("=")
        if not (key and equals):
            raise BadInput(f"{option}: expected {form}, got {shown(assignment)}")
        if key in values:
            raise BadInput(f"{option} {key}: expected one value, got {values[key]} and {value}")
        values[key] = value
    return values


@contextmanager
def _progress(end_time_s: float) -> Iterator[None]:
    """Say now and then how far the simulations of the block have come, each to its end."""
    from engine_models.progress import told_to

    began = last = time.monotonic()

    def tell(time_s: float) -> None:
        nonlocal last
        if time.monotonic() > last + LINE_S:
            last = time.monotonic()
            log.info(f"t = {time_s:.6g} s of {end_time_s:g} s after {last - began:.0f} s")

    with told_to(tell):
        yield


class _Lines(logging.Formatter):
    """Formats records as lines of their own: ``note: ...``, ``warning: ...``, ``error: ...``."""

    def format(self, record: logging.LogRecord) -> str:
        """Return one line."""
        level = {logging.INFO: "note"}.get(record.levelno, record.levelname.lower())
        return f"{level}: {' '.join(record.getMessage().split())}"


def _interrupt(_: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, unless that would break LLVM: then the signal comes again."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith(UNBREAKABLE):
            signal.signal(signal.SIGALRM, _interrupt)
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _explained(error: BaseException) -> tuple[str, int]:
    """Return the message and the exit code for an error."""
    if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):
        return "interrupted", INTERRUPTED  # a native solver passes Ctrl-C on as a cause
    if isinstance(error, typer.TyperException):
        return _usage(error), 2
    if isinstance(error, BadInput):
        return str(error), 2
    if isinstance(error, Failed):
        return str(error), 1
    if isinstance(error, BrokenPipeError):  # the reader of stdout has closed it
        return "", 1
    if isinstance(error, MemoryError):
        return "the run needs more memory than there is", 1
    if isinstance(error, OSError):
        return f"{error.filename or 'output'}: {error.strerror or error}", 2
    assert isinstance(error, Exception)
    return bug(error), 1


def _usage(error: typer.TyperException) -> str:
    """Return typer's refusal of a command line in one line, with what it expected."""
    context, parameter = getattr(error, "ctx", None), getattr(error, "param", None)
    if parameter is not None or context is None:  # an argument or an option's value is missing
        name = parameter.metavar if parameter is not None else getattr(error, "option_name", "command line")
        return f"{name}: expected a value, got nothing"
    came = error.format_message()
    if commands := getattr(context.command, "commands", None):
        return f'COMMAND: expected {", ".join([*commands, "--help"])}, got "{came}"'
    known = [p.metavar if p.param_type_name == "argument" else p.opts[0] for p in context.command.params]
    return f'{context.command_path}: expected {", ".join([*known, "--help"])}, got "{came}"'


def main() -> None:
    """Run the command line and exit with its exit code."""
    handler = logging.StreamHandler()
    handler.setFormatter(_Lines())
    for logger in (log, logging.getLogger("reference_solver")):
        logger.handlers = [handler]
    log.setLevel(logging.INFO)
    warnings.showwarning = lambda message, *_: log.warning(str(message))
    warnings.simplefilter("ignore")
    warnings.simplefilter("always", UserWarning)
    if sys.stdout is None:  # closed: what is printed must not be lost in silence
        sys.stdout = open(os.devnull)  # noqa: SIM115  it lives as long as the process
    elif hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8", errors="surrogateescape")
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handled in before.items():
        if handled is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    try:
        code = app(standalone_mode=False, prog_name="crankslider") or 0
        sys.stdout.flush()
    except (Exception, KeyboardInterrupt) as error:
        message, code = _explained(error)
        if isinstance(error, OSError):
            # What stdout holds back may be what cannot be written; Python would try again at exit.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115  it lives as long as the process
        if message:
            log.error(message)
    finally:
        log.setLevel(logging.INFO)
        for number, handled in before.items():
            signal.signal(number, handled)
    if code == INTERRUPTED:  # typer returns it after Ctrl-C
        log.error("interrupted")
    sys.exit(code)

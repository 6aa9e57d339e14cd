"""The command ``crankslider``: exit code 0, 2 for bad input, 1 for failed work, 130 after Ctrl-C.

A command is a function of the same name. Its options are the arguments that its docstring describes, and
those of the library's functions that it names. Behind an argument there may be in brackets what is typed
for it: ``[--with FIELD=VALUE]``, or ``[SCENE]`` for one without an option's name.
"""

import inspect
import json
import logging
import os
import re
import signal
import sys
import warnings
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from shlex import quote
from traceback import walk_stack
from types import FrameType
from typing import Annotated, Any, get_args, get_origin

import typer
from typer import Argument, Option, Typer

from studies.failures import BadInput, Failed, bug, log, progress_console, writing

INTERRUPTED = 130
#: Whose functions no interrupt may leave: it comes again. LLVM, which calls them, would go on with half a
#: result, and pydantic without having heard it.
UNBREAKABLE, AGAIN_S = ("llvmlite.", "pydantic."), 0.01
#: What a figure shows.
OF_PLOT = "plot_columns", "show"
QUIET = Annotated[bool, Option("--quiet", help="Print neither notes nor progress, and no table of samples.")]


def use(function: Callable[..., Any] | str, given: Mapping[str, Any], /, **more: Any) -> Any:
    """Return what a function, or that of this name in ``library``, makes of those arguments that it has."""
    function = of_library(function) if isinstance(function, str) else function
    names = inspect.signature(function).parameters
    return function(**{name: it for name, it in {**given, **more}.items() if name in names})


def of_library(path: str) -> Callable[..., Any]:
    """Return a function of ``library``, which takes a second to load."""
    return attrgetter(path)(import_module("crankslider.library"))  # type: ignore[no-any-return]


def make_app(name: str) -> Typer:
    """Return the command line; the command of this name alone has its options: others load nothing."""
    app = Typer(
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
        help="Simulate planar mechanisms with the reference solver, Exudyn, Pymunk and SciPy; compare them. "
        "--version prints the version.",
    )
    for function, paths in COMMANDS.items():
        run = with_options(function, paths) if function.__name__ == name else lambda: None
        app.command(function.__name__, help=described(function)[0])(run)
    return app


def with_options(function: Callable[..., None], paths: Sequence[str]) -> Callable[..., None]:
    """Return a command as typer takes it: all its options are text, lists of texts or flags."""
    parameters, forms = dict[str, inspect.Parameter](), dict[str, list[str]]()
    for each in (*map(of_library, paths), function):
        arguments = inspect.signature(inspect.unwrap(each)).parameters
        for name, (typed, text) in described(each)[1].items():
            forms[name] = typed.split() or [f"--{name.replace('_', '-')}", name.upper()]
            parameters[name] = option(arguments[name], forms[name], text)
    quiet = inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=QUIET)

    def run(quiet: bool, **values: Any) -> None:
        log.setLevel(logging.WARNING if quiet else logging.INFO)
        given = {name: it for name, it in values.items() if it not in (None, [])}
        for name in given:
            if name in OF_PLOT and "plot" not in given:
                raise BadInput(f"{forms[name][0][2:]}: expected --plot FILE beside it, got none")
            if "=" in forms[name][-1]:
                given[name] = dict(each.partition("=")[::2] for each in given[name])
        use(function, given, given=given)

    run.__signature__ = inspect.Signature([*parameters.values(), quiet])  # type: ignore[attr-defined]
    return run


def option(argument: inspect.Parameter, typed: Sequence[str], text: str) -> inspect.Parameter:
    """Return an argument of a function as a parameter of typer's, with what is typed for it and its help."""
    origins = {get_origin(each) for each in (argument.annotation, *get_args(argument.annotation))}
    several, flag = bool(origins & {Mapping, Sequence}), argument.default is False
    kind: Any = bool if flag else list[str] | None if several else str | None
    names, form = [word for word in typed if word.startswith("--")], typed[-1]
    info = (Option if names else Argument)(*names, metavar=None if flag else form, help=text)
    default = None if several else argument.default
    return argument.replace(default=default, annotation=Annotated[kind, info], kind=argument.KEYWORD_ONLY)


def described(function: Callable[..., Any]) -> tuple[str, dict[str, tuple[str, str]]]:
    """Return what a docstring says of a function, and of its arguments: what is typed, and the help."""
    head, _, rest = (inspect.getdoc(function) or "").partition("\n\nArgs:\n")
    lines = re.findall(r"^    (\w+)(?: \[(.*)\])?: (.*(?:\n {8,}.*)*)", rest, re.MULTILINE)
    return head, {name: (typed, " ".join(text.split())) for name, typed, text in lines}


def print_rows(rows: Sequence[Sequence[str]]) -> None:
    """Print rows in aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print("  ".join(map(str.ljust, row, widths)).rstrip())


def scenes(as_json: bool = False) -> None:
    """List the scenes of the library.

    Args:
        as_json [--json]: print JSON.
    """
    from engine_models.scene.library import ALL_SCENES

    rows = [("scene", "drive", "clearance", "end time", "about")]
    for name, make in ALL_SCENES.items():
        scene = make()
        joints, end = ", ".join(scene.clearances) or "none", f"{scene.end_time_s:g} s"
        rows.append((name, scene.drive.kind, joints, end, described(make)[0].partition("\n")[0]))
    if as_json:
        print(json.dumps([dict(zip(rows[0], row, strict=True)) for row in rows[1:]], indent=2))
    else:
        print_rows(rows)


def engines(name: str | None = None, as_json: bool = False) -> None:
    """List the engines, their settings and the library scenes that each can run.

    Args:
        name [[NAME]]: describe this engine in full.
        as_json [--json]: print JSON.
    """
    from engine_models.engine import UnsupportedScene
    from engine_models.engines import ENGINES, engine_class
    from engine_models.scene.library import ALL_SCENES
    from engine_models.scene.plain_words import expectation, fields, shown

    listed = list[dict[str, Any]]()
    for engine in [name] if name else ENGINES:
        kind, refused = engine_class(engine), defaultdict[str, list[str]](list)
        for scene, make in ALL_SCENES.items():
            try:
                kind().check(make())
            except UnsupportedScene as reason:
                refused[str(reason)].append(scene)
        about = inspect.getdoc(kind) or ""
        settings = [(key, shown(it["default"]), expectation(it)) for key, it in fields(kind).items()]
        listed.append({"engine": engine, "about": about, "settings": settings, "refused": refused})
    if as_json:
        print(json.dumps(listed, indent=2))
    for each in () if as_json else listed:
        print(f"{each['engine']}: {each['about'] if name else each['about'].partition(chr(10))[0]}")
        print_rows([(f"  {key}", *told) for key, *told in each["settings"]])
        for why, names in each["refused"].items():
            print(f"  not {', '.join(names)}: {why}")


def show(given: dict[str, Any]) -> None:
    """Print a scene as TOML, as a template for a file of your own."""
    print(use("read_scene", given).to_toml(), end="")


def check(given: dict[str, Any]) -> None:
    """Tell freedoms and start of a mechanism, singular positions, dead centres, transmission angles."""
    from crankslider.library import refusing
    from engine_models.reference.inspection import inspect

    with refusing():
        print("\n".join(inspect(use("read_scene", given))))


def schema() -> None:
    """Print the JSON schema of scene files, with which editors complete and check them."""
    from engine_models.scene.file import scene_schema

    print(json.dumps(scene_schema(), indent=2, ensure_ascii=False))


def simulate(given: dict[str, Any]) -> None:
    """Run a scene; write motion, forces and energy as a table, on request impacts, a figure, an animation."""
    write(given, "simulate")


def truth(given: dict[str, Any]) -> None:
    """Write the reference solution of a scene, independent of all engines, as far as it is predictable."""
    write(given, "truth")


def write(given: dict[str, Any], solve: str) -> None:
    """Write what was asked for of a run, without files its samples to stdout, and notes."""
    from engine_models.watch import told_to

    scene = use("read_scene", given)
    files = {name: given[name] for name in ("out", "impacts", "plot", "animate") if name in given}
    of_library("require_outputs")(scene, **files)
    if "plot_columns" in given:
        given["plot_columns"] = [name for each in given["plot_columns"] for name in each.split(",")]
    if not files and log.isEnabledFor(logging.INFO):
        given["out"] = "-"

    def tell(time_s: float) -> None:
        status.update(f"t = {time_s:.6g} s of {scene.end_time_s:g} s")

    with progress_console().status("") as status, told_to(tell):
        run = use(solve, given, scene=scene, end=None)
        use(run.write, given)
    for note in run.notes():
        log.info(note)


def sweep(given: dict[str, Any]) -> None:
    """Run a scene with many values of its fields, one row each; an interrupted sweep resumes.

    Revolutions are those of the crank, or of the scene's turning body, at its speed at the start. Without
    such a speed, one revolution is the scene's end time.
    """
    given.setdefault("out", "sweep.parquet")
    swept = use("sweep", given, scene=use("read_scene", given))
    log.info(f"{len(swept.frame)} rows are in {given['out']}")


def run(given: dict[str, Any]) -> None:
    """Run studies; finished cases are saved and skipped the next time."""
    use("run_studies", given)
    log.info(f"the results are in {given['out']}")


def compare(given: dict[str, Any], as_json: bool = False) -> None:
    """Compare engines on a scene: which configuration and setting to use, with its error and run time.

    Args:
        as_json [--json]: print JSON.
    """
    from reports.standings import standings_table

    changes = [f"--with {quote('='.join(change))}" for change in given.get("changes", {}).items()]
    end = [f"--end {quote(str(given['end']))}"] if "end" in given else []
    typed = " ".join([quote(given["scene"]), *changes, *end])
    result = use("compare", given, scene=use("read_scene", given), given=typed)
    result.save(result.folder)
    table = standings_table(result.standings).cells()
    if as_json:
        print(table.to_json(orient="records", indent=2))
    else:
        print(table.to_string(index=False), result.recommendation, sep="\n")
    log.info(f"the page is {result.folder / 'index.html'}")


def conform(
    name: str | None = None, table: str | None = None, table_scene: str | None = None, as_json: bool = False
) -> None:
    """Run the checks that every engine has to pass; exit code 1 if one fails.

    Args:
        name [[NAME]]: an engine, or your own: my_module:MyEngine.
        table [--from FILE.csv]: a CSV table of another solver in place of an engine.
        table_scene [--scene SCENE]: the scene that the table is of.
        as_json [--json]: print JSON.
    """
    from crankslider.library import verdicts_on_table
    from engine_models.engines import make_engine
    from studies.conform import verdicts

    if (name is None) == (table is None) or (table_scene is None) != (table is None):
        raise BadInput("NAME: expected an engine, or --from FILE.csv with --scene SCENE, got another call")
    checks = verdicts(make_engine(name)) if name else verdicts_on_table(str(table), str(table_scene))
    with progress_console().status(f"checks of {name or table}"):
        made = list(checks)
    if as_json:
        print(json.dumps([each._asdict() for each in made], indent=2))
    for claim in () if as_json else dict.fromkeys(each.claim for each in made):
        ones = [each for each in made if each.claim == claim]
        wrong = [each for each in ones if not each.holds]
        held = f"{len(ones) - len(wrong)} of {len(ones)} scenes" if ones[0].scene else ones[0].measured
        print(f"{'FAILS' if wrong else 'holds'}  {claim}: {held}")
        for each in wrong if ones[0].scene else ():
            print(f"         {each.scene}: {each.measured}")
    if not all(each.holds for each in made):
        raise Failed(f"{name or table} does not pass all checks")


def baseline(
    name: str | None = None, folder: str = "accuracy", accept: str | None = None, as_json: bool = False
) -> None:
    """Compare the accuracy of all configurations with baselines; exit code 1 if a number left its band.

    Args:
        name [[NAME]]: an engine alone, or your own: my_module:MyEngine.
        folder: folder of that engine's baselines.
        accept [--accept REASON]: accept the numbers as they are, for this reason.
        as_json [--json]: print JSON.
    """
    from engine_models.arms import NAMED as ALL
    from engine_models.engines import join
    from studies.baselines import FOLDER, compare_or_accept

    if name:
        join(name)
    lines = compare_or_accept([name] if name else ALL, Path(folder) if name else FOLDER, accept)
    print(json.dumps(lines, indent=2) if as_json else "\n".join(lines))
    if lines:
        raise Failed(f"{len(lines)} numbers left their bands")


def report(results: str = "results", out: str = "report", against: str | None = None) -> None:
    """Write the HTML page, its figures as SVG and its tables as CSV from results, and print the answer.

    Args:
        results: folder of the results.
        out: folder of the report.
        against: folder of another report; print the numbers of both side by side.
    """
    from pandas import DataFrame

    from reports.chapters.contents import CHAPTERS
    from reports.page import read_claims, write_report

    place = Path(out)
    before = read_claims(Path(against)) if against else {}
    with writing("out", place):
        made = write_report(Path(results), place, CHAPTERS)
    for note in made.notes:
        log.info(note)
    if against:
        print(DataFrame({"before": before, "after": read_claims(place)}).fillna("–").to_string())
    else:
        print("\n".join(made.answer))
    log.info(f"the report is {place / 'index.html'}")


#: The commands, each with the names of those in ``library`` whose arguments are options of it.
COMMANDS: dict[Callable[..., None], tuple[str, ...]] = {
    scenes: (),
    engines: (),
    show: ("read_scene",),
    check: ("read_scene",),
    schema: (),
    simulate: ("read_scene", "simulate", "Run.write"),
    truth: ("read_scene", "truth", "Run.write"),
    sweep: ("read_scene", "sweep"),
    run: ("run_studies",),
    compare: ("read_scene", "compare"),
    conform: (),
    baseline: (),
    report: (),
}


def interrupt(_: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, unless it would do harm or be lost: then the signal comes again."""
    if any(each.f_globals.get("__name__", "").startswith(UNBREAKABLE) for each, _ in walk_stack(frame)):
        signal.signal(signal.SIGALRM, interrupt)
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
    else:
        raise KeyboardInterrupt


def explain(error: BaseException) -> tuple[str, int]:
    """Return the message and the exit code for an error."""
    if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):
        return "interrupted", INTERRUPTED  # a native solver passes Ctrl-C on as a cause
    if isinstance(error, typer.TyperException):
        return f"command line: expected what --help tells, got '{error.format_message()}'", 2
    if isinstance(error, BadInput | Failed):
        return str(error), 2 if isinstance(error, BadInput) else 1
    if isinstance(error, BrokenPipeError):  # the reader of stdout has closed it
        return "", 1
    if isinstance(error, OSError):
        return f"{error.filename or 'output'}: {error.strerror or error}", 2
    return bug(error), 1


def main() -> None:
    """Run the command line and exit with its exit code."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(levelname)s: %(message)s"))
    for word in ("INFO", "WARNING", "ERROR"):
        logging.addLevelName(getattr(logging, word), "note" if word == "INFO" else word.lower())
    for logger in (log, logging.getLogger("reference_solver")):
        logger.handlers = [handler]
    warnings.showwarning = lambda message, *_: log.warning(str(message))
    warnings.simplefilter("ignore")
    warnings.simplefilter("always", UserWarning)
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(encoding="utf-8", errors="surrogateescape")
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, interrupt)
    try:
        named = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
        if sys.argv[1:] == ["--version"]:
            print(f"crankslider {version('crankslider')}")
            sys.exit()
        code = make_app(named)(standalone_mode=False, prog_name="crankslider") or 0
        sys.stdout.flush()
        message = "interrupted" if code == INTERRUPTED else ""  # which typer returns after Ctrl-C
    except (Exception, KeyboardInterrupt) as error:
        message, code = explain(error)
        if isinstance(error, OSError):
            # What stdout holds back may be what cannot be written; Python would try again at exit.
            sys.stdout = open(os.devnull, "w")  # noqa: SIM115  it lives as long as the process
    if message:
        log.error(" ".join(message.split()))
    log.setLevel(logging.INFO)
    sys.exit(code)

"""What a command hears of its environment, and says on stderr: notes, and how it failed, in one line.

A failure has an exit code, and never a traceback.
"""

import io
import logging
import os
import re
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO, cast

import typer

from engine_models.scene.plain_words import BadInput as BadInput  # exit code 2

if TYPE_CHECKING:
    from rich.console import Console

#: Beginnings of variables that are not heard: another backend of Matplotlib, Numba without its compiler or
#: with words of its own on stdout, warnings that end the run of a library.
UNHEARD = ("MPLBACKEND", "NUMBA_", "PYTHONWARNINGS")
#: Widths of a terminal on which help can be read.
WIDTHS = re.compile("[1-9][0-9]{1,3}")
INTERRUPTED = 130
#: After this time an interrupt comes again that got lost.
AGAIN_S = 0.01
#: Whose functions no exception may leave: LLVM calls them, and goes on with half a result or crashes.
UNBREAKABLE = "llvmlite."

#: Held while a signal is to come again: once, since a second one would strike as the process ends.
_coming = threading.Lock()

#: Whether nothing but warnings and errors is wanted.
_quiet = ContextVar("quiet", default=False)


class Failed(Exception):
    """The work broke down: exit code 1. The message says when and why."""


def make_ready() -> None:
    """Make this process, and those that it will start, ready for a command."""
    for name in list(os.environ):
        unreadable = name == "COLUMNS" and not WIDTHS.fullmatch(os.environ[name])
        if name.startswith(UNHEARD) or unreadable:
            del os.environ[name]
    if sys.warnoptions:  # which other processes would inherit
        sys.warnoptions.clear()
        warnings.simplefilter("ignore")
    _open_streams()


def _open_streams() -> None:
    """Open those that were closed, so that no other file gets their numbers; stdout so that it refuses text.

    What goes there is UTF-8, as in files, whatever the locale is.
    """
    for name, mode in (("stdin", "r"), ("stdout", "r"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115  it lives as long as the process
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8", errors="surrogateescape")


class Listener:
    """A stream on which is said what no result depends on: what cannot be written there is lost."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text and return its length."""
        with suppress(OSError):
            self._stream.write(text)
        self.flush()
        return len(text)

    def flush(self) -> None:
        """Write what is held back."""
        try:
            self._stream.flush()
        except OSError:
            # What the stream holds back cannot be written; Python would report that again at exit.
            sys.stderr = self._stream = open(os.devnull, "w")  # noqa: SIM115  it lives as long as the process

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def say(message: str) -> None:
    """Print one line on stderr."""
    Listener(sys.stderr).write(" ".join(message.split()) + "\n")


@contextmanager
def quietly(wanted: bool) -> Iterator[None]:
    """Say nothing in the block but warnings and errors, if that is ``wanted``."""
    before = _quiet.set(wanted)
    try:
        yield
    finally:
        _quiet.reset(before)


def is_quiet() -> bool:
    """Return whether notes and progress are not wanted."""
    return _quiet.get()


def note(message: str) -> None:
    """Print one line on stderr that a user can do without."""
    if not is_quiet():
        say(f"note: {message}")


def progress_console() -> "Console":
    """Return the console on which progress is shown."""
    from rich.console import Console  # which most runs are over without

    return Console(file=cast(TextIO, Listener(sys.stderr)), quiet=is_quiet())


class Notes(logging.Handler):
    """Prints what is logged as notes on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record."""
        note(record.getMessage())


@contextmanager
def writing(field: str, place: Path) -> Iterator[None]:
    """Turn an OSError into a BadInput that names the option with the place that cannot be written."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"{field}: expected a place that can be written, got {place} ({reason})") from None


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, unless that would break LLVM: then the signal comes again."""
    while frame is not None:
        if frame.f_globals.get("__name__", "").startswith(UNBREAKABLE):
            _again(number)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _again(number: int) -> None:
    if _coming.acquire(blocking=False):
        threading.Timer(AGAIN_S, _come, (number,)).start()


def _come(number: int) -> None:
    _coming.release()
    os.kill(os.getpid(), number)


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does, unless whoever started us wants it ignored."""
    before = signal.getsignal(signal.SIGTERM)
    if before is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def interrupted_in_silence() -> Iterator[None]:
    """Let Ctrl-C end the block, and nothing be said of what it leaves half done.

    It may strike inside a constructor, of which the destructor then complains, or inside a destructor, whose
    exceptions are printed and forgotten: from there it comes again.
    """
    before, hook, heard = signal.getsignal(signal.SIGINT), sys.unraisablehook, False
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal heard
        heard = True
        _interrupt(number, frame)

    def say(unraisable: "sys.UnraisableHookArgs") -> None:
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            _again(signal.SIGINT)
        elif not heard:
            hook(unraisable)

    signal.signal(signal.SIGINT, interrupt)
    sys.unraisablehook = say
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if not heard:  # what is half done may go as late as with the process
            sys.unraisablehook = hook


def explained(error: Exception) -> tuple[str, int]:
    """Return the message and the exit code for an error."""
    if isinstance(error.__cause__, KeyboardInterrupt):  # Ctrl-C as a native solver passes it on
        return "interrupted", INTERRUPTED
    if isinstance(error, typer.TyperException):
        return _usage(error), 2
    if isinstance(error, BadInput):
        return str(error), 2
    if isinstance(error, Failed):
        return str(error), 1
    if isinstance(error, MemoryError):
        return "the run needs more memory than there is", 1
    if isinstance(error, OSError):
        return f"{error.filename or 'output'}: {error.strerror or error}", 2
    return bug(error), 1


def bug(error: Exception) -> str:
    """Return in one line what went wrong where: the file with its folder, since many files share a name."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    file = "/".join(Path(place.filename).parts[-2:])
    return f"bug at {file}:{place.lineno}: {type(error).__name__}: {error}"


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

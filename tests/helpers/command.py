"""The command line in this process: what a user would see of one call."""

import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from unittest.mock import patch

from studies.command import progress_display
from studies.command.main import main


@dataclass(frozen=True)
class Finished:
    """Exit code and output of a finished command."""

    code: object
    stdout: str
    stderr: str


def crankslider(*arguments: object) -> Finished:
    """Run ``crankslider`` with these arguments."""
    argv = ["crankslider", *map(str, arguments)]
    code: object = None
    with (
        patch.object(sys, "argv", argv),
        redirect_stdout(StringIO()) as out,
        redirect_stderr(StringIO()) as err,
        patch.object(progress_display, "LINE_S", 1e6),  # what is said does not depend on the machine
    ):
        try:
            main()
        except SystemExit as leave:
            code = leave.code
    return Finished(code, out.getvalue(), err.getvalue())

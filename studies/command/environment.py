"""What a command makes of the environment that it is started in: nothing there changes or ends its work."""

import io
import os
import re
import sys
import warnings

#: Beginnings of variables that are not heard: another backend of Matplotlib, Numba without its compiler or
#: with words of its own on stdout, warnings that end the run of a library.
UNHEARD = ("MPLBACKEND", "NUMBA_", "PYTHONWARNINGS")
#: Widths of a terminal on which help can be read.
WIDTHS = re.compile("[1-9][0-9]{1,3}")


def make_ready() -> None:
    """Make this process, and those that it will start, ready for a command."""
    for name in list(os.environ):
        unreadable = name == "COLUMNS" and not WIDTHS.fullmatch(os.environ[name])
        if name.startswith(UNHEARD) or unreadable:
            del os.environ[name]
    if sys.warnoptions:  # which other processes would inherit
        sys.warnoptions.clear()
        warnings.simplefilter("ignore")
    _open_standard_streams()


def _open_standard_streams() -> None:
    """Open those that were closed, so that no other file gets their numbers; stdout so that it refuses text.

    What goes there is UTF-8, as in files, whatever the locale is.
    """
    for name, mode in (("stdin", "r"), ("stdout", "r"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115  it lives as long as the process
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(encoding="utf-8", errors="surrogateescape")

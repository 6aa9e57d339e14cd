"""How far a simulation has come, on stderr: a bar on a terminal, elsewhere a line now and then."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from engine_models.progress import told_to
from studies.running.failures import is_quiet, note, progress_console

#: A run that is over before is not worth a bar; the bar moves this often; a line comes this often, in s.
DELAY_S, REFRESH_S, LINE_S = 1.5, 0.2, 30.0


@contextmanager
def shown_progress(end_time_s: float, line_s: float | None = None) -> Iterator[None]:
    """Show how far the simulations in this block, each to ``end_time_s``, have come.

    A thread of its own does, so that an engine that tells nothing is not silent either.
    """
    if is_quiet():
        yield
        return
    reached, over = [0.0], Event()

    def reach(time_s: float) -> None:
        reached[0] = time_s

    show = _bar if sys.stderr.isatty() else _lines
    thread = Thread(target=show, args=(reached, end_time_s, over, line_s or LINE_S), daemon=True)
    thread.start()
    try:
        with told_to(reach):
            yield
    finally:
        over.set()
        thread.join()


def _bar(reached: list[float], end_time_s: float, over: Event, _: float) -> None:
    if over.wait(DELAY_S):
        return
    # Most runs are over without.
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    text = TextColumn("t = {task.completed:.3g} s of {task.total:g} s")
    columns = text, BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=progress_console(), transient=True, auto_refresh=False) as progress:
        bar = progress.add_task("", total=end_time_s)
        while not over.wait(REFRESH_S):
            progress.update(bar, completed=reached[0], refresh=True)


def _lines(reached: list[float], end_time_s: float, over: Event, line_s: float) -> None:
    began = time.monotonic()
    while not over.wait(line_s):
        elapsed, part = time.monotonic() - began, reached[0] / end_time_s
        left = f"about {elapsed * (1 / part - 1):.3g} s left" if part > 0 else "no end in sight yet"
        note(f"t = {reached[0]:.6g} s of {end_time_s:g} s after {elapsed:.0f} s, {left}")

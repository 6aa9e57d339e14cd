"""Progress of a simulation on stderr: a bar on a terminal, otherwise a line from time to time."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from engine_models.progress import told_to
from studies.failures import is_quiet, note, progress_console

#: Time before the bar appears, time between its updates, and time between lines, in s.
DELAY_S, REFRESH_S, LINE_S = 1.5, 0.2, 30.0


class Reached:
    """The time that the present simulation has reached; if time goes back, another simulation has started."""

    def __init__(self) -> None:
        self.time_s, self.run, self.began = 0.0, 1, time.monotonic()

    def __call__(self, time_s: float) -> None:
        """Set the time that has been reached."""
        if time_s < self.time_s:
            self.run, self.began = self.run + 1, time.monotonic()
        self.time_s = time_s


@contextmanager
def shown_progress(end_time_s: float, line_s: float | None = None) -> Iterator[None]:
    """Show the progress of the simulations in this block, each to ``end_time_s``.

    It is shown by a thread, so that the elapsed time appears also for an engine that reports no progress.
    """
    if is_quiet():
        yield
        return
    reached, over = Reached(), Event()
    show = _bar if sys.stderr.isatty() else _lines
    thread = Thread(target=show, args=(reached, end_time_s, over, line_s or LINE_S), daemon=True)
    thread.start()
    try:
        with told_to(reached):
            yield
    finally:
        over.set()
        thread.join()


def _bar(reached: Reached, end_time_s: float, over: Event, _: float) -> None:
    if over.wait(DELAY_S):
        return
    # Most runs end before the bar is needed.
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    text = TextColumn("run {task.description}: t = {task.completed:.3g} s of {task.total:g} s")
    columns = text, BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=progress_console(), transient=True, auto_refresh=False) as progress:
        bar, shown = progress.add_task("1", total=end_time_s), 1
        while not over.wait(REFRESH_S):
            if reached.run != shown:
                shown = reached.run
                progress.reset(bar, description=str(shown))
            progress.update(bar, completed=reached.time_s, refresh=True)


def _lines(reached: Reached, end_time_s: float, over: Event, line_s: float) -> None:
    while not over.wait(line_s):
        elapsed, part = time.monotonic() - reached.began, reached.time_s / end_time_s
        left = (
            f"about {elapsed * (1 / part - 1):.3g} s left" if part > 0 else "no estimate of the time left yet"
        )
        of_run = f" in run {reached.run}" if reached.run > 1 else ""
        note(f"t = {reached.time_s:.6g} s of {end_time_s:g} s{of_run} after {elapsed:.0f} s, {left}")

"""The files that ``simulate`` and ``truth`` write: tables and figures, by the ending of the name."""

import csv
import io
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from engine_models.scene.parts import AnyScene
from studies.command.finished_run import Run
from studies.command.options import PICTURES, FilmOptions, checked, ending_of, film_ending, is_source
from studies.command.progress_display import shown_progress
from studies.command.trajectory_table import impact_columns, sample_columns
from studies.failures import BadInput, writing
from studies.whole_file import require_place, whole_file, write_through

Columns = Mapping[str, NDArray[Any]]

#: The place of a table without a file.
STDOUT = Path("-")


@dataclass(frozen=True)
class Output:
    """A file to be written: its option, its path, and the function that makes its content from a run."""

    option: str
    path: Path
    content: Callable[[Run], bytes]

    def require_place(self) -> None:
        """Refuse a path that cannot be written."""
        if self.path != STDOUT:
            with writing(self.option, self.path):
                require_place(self.path)

    @contextmanager
    def opened(self) -> Iterator[Callable[[bytes], None]]:
        """Open the file and yield its write function; an old file stays until the new one is complete."""
        if self.path == STDOUT:
            if not sys.stdout.writable():
                raise BadInput(
                    f"{self.option}: expected a place that can be written, got stdout, which is closed"
                )
            yield lambda content: print(content.decode("utf-8"), end="")
            return
        with writing(self.option, self.path), whole_file(self.path) as file:

            def write(content: bytes) -> None:
                with writing(self.option, self.path):
                    write_through(file, content)

            yield write


def write(files: Sequence[Output], scene: AnyScene, result: Callable[[], Run]) -> Run:
    """Make a run, write all files or none, and return the run; progress is shown."""
    for file in files:
        file.require_place()
    with shown_progress(scene.end_time_s):
        run = result()
        contents = [file.content(run) for file in files]
    with ExitStack() as stack:
        opened = [stack.enter_context(file.opened()) for file in files]
        for write, content in zip(opened, contents, strict=True):
            write(content)
    return run


def samples(path: Path) -> Output:
    """Return the file of a run's samples."""
    encode = FORMATS[ending_of("--out", path, FORMATS)]
    return Output("--out", path, lambda run: encode(sample_columns(run.scene, run.trajectory), run))


def impacts(path: Path, scene: AnyScene) -> Output:
    """Return the file of a run's impacts."""
    encode = FORMATS[ending_of("--impacts", path, FORMATS)]
    if not scene.joints_with_clearance:
        raise BadInput(f"--impacts: expected a scene with clearance, got {scene.name}, which has no impacts")
    return Output("--impacts", path, lambda run: encode(impact_columns(run.trajectory.contacts), run))


def plot(path: Path) -> Output:
    """Return the file of a run's figure."""
    ending = ending_of("--plot", path, PICTURES)

    def content(run: Run) -> bytes:
        from reports.plots.picture import picture_bytes

        return picture_bytes(run.plot(), ending)

    return Output("--plot", path, content)


def film(path: Path, exaggerate: str | None) -> Output:
    """Return the file of a run's animation, with clearances enlarged by the factor ``exaggerate``."""
    times, ending = checked(FilmOptions, "--", {"exaggerate": exaggerate}).exaggerate, film_ending(path)
    return Output("--animate", path, lambda run: run.film(ending, times))


def require_places(files: Sequence[Output], scene: str, changes: Sequence[str]) -> None:
    """Refuse two outputs to one file, and an output to a file of the scene."""
    for number, file in enumerate(files):
        if is_source(file.path, scene, changes):
            expected = "another file than the scene or its tables"
            raise BadInput(f"{file.option}: expected {expected}, got {file.path}")
        for other in files[:number]:
            if os.path.realpath(file.path) == os.path.realpath(other.path):
                expected = f"another place than {other.option}"
                raise BadInput(f"{file.option}: expected {expected}, got {file.path}")


def _csv(columns: Columns, _: Run) -> bytes:
    """Return a table as CSV, with all digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return text.getvalue().encode("utf-8")


def _json(columns: Columns, run: Run) -> bytes:
    """Return a table as JSON: its provenance, and a list for each column, null for NaN."""
    lists = {name: [None if x != x else x for x in values.tolist()] for name, values in columns.items()}
    return (json.dumps({"made_by": run.made_by, "columns": lists}) + "\n").encode("utf-8")


def _parquet(columns: Columns, run: Run) -> bytes:
    """Return a table as Parquet, with its provenance in the metadata of the schema."""
    import pyarrow as pa
    from pyarrow import parquet

    made_by = {name: x if isinstance(x, str) else json.dumps(x) for name, x in run.made_by.items()}
    sink = io.BytesIO()
    parquet.write_table(pa.table(dict(columns)).replace_schema_metadata(made_by), sink)
    return sink.getvalue()


#: The encoding of a table by the ending of the file name.
FORMATS: Mapping[str, Callable[[Columns, Run], bytes]] = {
    "": _csv,
    ".csv": _csv,
    ".json": _json,
    ".parquet": _parquet,
}
